"""The web server of the operator's page: assets, one WebSocket for the page, one for Foxglove."""

import asyncio
import contextlib
import hmac
import secrets
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from typing import Self

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from config.closing import Closing
from config.fleet import Fleet
from groundstation.errors import GroundError
from groundstation.web import wire
from groundstation.web.access import Guarded, is_loopback
from groundstation.web.hub import Hub
from groundstation.web.interface import CommandPort, Playback, Source
from groundstation.web.page_client import PageClient

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8080
LARGEST_FROM_PAGE = 65_536
STOP_PATIENCE_S = 1


@dataclass(frozen=True, slots=True)
class Listen:
    """Where the page is served. `token` None: one is made where `host` is not loopback.

    `or_any_port` takes a free port where `port` is in use.
    """

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT
    token: str | None = None
    or_any_port: bool = False


class PageServer(Closing):
    """Shows one fleet on a page.

    Use `run` to serve in this thread until `stop` is called (from any thread) or the process is
    told to end, or use it as a context manager to serve in a thread of its own. `url` is where to
    point a browser, known from construction on. `prefix` is what the source's keys begin with.

    Raises GroundError when the port is in use.
    """

    def __init__(
        self,
        fleet: Fleet,
        source: Source,
        commands: CommandPort | None = None,
        playback: Playback | None = None,
        listen: Listen | None = None,
        prefix: str = "",
    ) -> None:
        listen = listen or Listen()
        self._hub = Hub(fleet, source, commands, playback, prefix)
        self._pages = 0
        self._token = listen.token
        if self._token is None and commands is not None and not is_loopback(listen.host):
            self._token = secrets.token_urlsafe(12)
        self._socket = _bound(listen)
        self.port: int = self._socket.getsockname()[1]
        host = listen.host if listen.host not in ("0.0.0.0", "::") else socket.gethostname()
        host = f"[{host}]" if ":" in host else host
        fragment = "" if self._token is None else f"#token={self._token}"
        self.url = f"http://{host}:{self.port}/{fragment}"
        self._server = uvicorn.Server(
            uvicorn.Config(
                self._app(is_loopback(listen.host)),
                log_level="warning",
                access_log=False,
                lifespan="off",
                ws="websockets-sansio",
                ws_max_size=LARGEST_FROM_PAGE,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=STOP_PATIENCE_S,
            )
        )
        self._thread: threading.Thread | None = None

    def run(self) -> None:
        """Serve in this thread."""
        asyncio.run(self._serve())

    def stop(self) -> None:
        """Let `run` end; from any thread."""
        self._server.should_exit = True

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self.run, name="page", daemon=True)
        self._thread.start()
        return self

    def close(self) -> None:
        """Stop, and wait for the thread."""
        self.stop()
        if self._thread is not None:
            self._thread.join()

    async def _serve(self) -> None:
        ticking = asyncio.create_task(self._hub.run())
        ticking.add_done_callback(lambda _: self.stop())
        await self._server.serve(sockets=[self._socket])
        ticking.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await ticking

    def _app(self, loopback: bool) -> Starlette:
        static = StaticFiles(directory=str(files("groundstation.web") / "static"), html=True)
        return Starlette(
            routes=[
                WebSocketRoute("/ws", self._page),
                WebSocketRoute("/foxglove", self._hub.foxglove.serve),
                Mount("/", static),
            ],
            middleware=[Middleware(Guarded, loopback=loopback)],
        )

    async def _page(self, websocket: WebSocket) -> None:
        """One page, from its handshake to its end."""
        await websocket.accept()
        self._pages += 1
        client = PageClient(self._pages, websocket, f"page {self._pages}")
        sender = asyncio.create_task(client.send())
        try:
            self._introduce(client, await self._read(websocket, wire.Introduce()))
            self._hub.join(client)
            while True:
                await self._handle(client, await self._read(websocket, None))
        except (WebSocketDisconnect, KeyError):
            pass
        finally:
            self._hub.leave(client)
            sender.cancel()

    async def _read(
        self, websocket: WebSocket, instead: wire.FromPage | None
    ) -> wire.FromPage | None:
        """The page's next message; `instead` where it cannot be read."""
        try:
            said: wire.FromPage = wire.FROM_PAGE.decode(await websocket.receive_text())
            return said
        except msgspec.MsgspecError:
            return instead

    def _introduce(self, client: PageClient, said: wire.FromPage | None) -> None:
        if not isinstance(said, wire.Introduce):
            return
        client.name = " ".join(said.name.split())[:40] or client.name
        client.authorised = self._token is None or hmac.compare_digest(
            said.token.encode(), self._token.encode()
        )
        if self._hub.commanding is not None and client.authorised:
            self._hub.commanding.back(client)

    async def _handle(self, client: PageClient, said: wire.FromPage | None) -> None:
        commanding = self._hub.commanding
        if isinstance(said, wire.Got):
            client.drawn(said.n)
        elif isinstance(said, wire.ShowTruth):
            client.wants_truth = said.wanted
        elif isinstance(said, wire.Introduce):
            self._introduce(client, said)
            self._hub.tell_control()
        elif isinstance(said, wire.Play):
            self._play(said)
        elif commanding is None:
            return
        elif isinstance(said, wire.Estop):
            commanding.estop(client)
        elif isinstance(said, wire.Give):
            asyncio.get_running_loop().create_task(self._give(client, said))
        elif client.authorised and isinstance(said, wire.Withdraw):
            commanding.withdraw(client)
        elif client.authorised and isinstance(said, wire.TakeCommand):
            commanding.take(client)
        elif isinstance(said, wire.GiveBack):
            commanding.give_back(client)

    async def _give(self, client: PageClient, order: wire.Give) -> None:
        commanding = self._hub.commanding
        assert commanding is not None, "checked by the caller"
        self._hub.answer(client, await commanding.give(client, order))

    def _play(self, said: wire.Play) -> None:
        playback = self._hub.playback
        if playback is None:
            return
        if said.action == "play":
            playback.play()
        elif said.action == "pause":
            playback.pause()
        elif said.action == "seek":
            playback.seek(min(max(said.value, 0.0), playback.state().duration_s))
        elif said.action == "speed":
            playback.set_speed(min(max(said.value, 0.1), 10.0))


def serve(
    fleet: Fleet,
    source: Source,
    commands: CommandPort | None = None,
    playback: Playback | None = None,
    listen: Listen | None = None,
    prefix: str = "",
    say: Callable[[str], None] = print,
) -> None:
    """Serve the page in this thread until the process is interrupted; `say` tells where.

    A replay gives its own `source` and `playback`, the prefix of its keys, and no `commands`.
    Raises GroundError when the port is in use.
    """
    server = PageServer(fleet, source, commands, playback, listen, prefix)
    say(f"page: {server.url}")
    server.run()


def _bound(listen: Listen) -> socket.socket:
    family = socket.AF_INET6 if ":" in listen.host else socket.AF_INET
    made = socket.socket(family, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        try:
            made.bind((listen.host, listen.port))
        except OSError:
            if not listen.or_any_port:
                raise
            made.bind((listen.host, 0))
        made.listen()
    except OSError as error:
        made.close()
        raise GroundError(
            f"cannot serve the page on {listen.host} port {listen.port}: "
            f"{error.strerror or error}. Choose another port with --port; 0 takes a free one."
        ) from error
    return made
