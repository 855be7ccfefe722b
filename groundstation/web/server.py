"""The web server of the operator's page: assets, one WebSocket for the page, one for Foxglove."""

from collections.abc import Callable
from dataclasses import dataclass

from config.fleet import Fleet
from groundstation.web.interface import CommandPort, Playback, Source

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8080


@dataclass(frozen=True, slots=True)
class Listen:
    """Where the page is served. `token` None: one is made where `host` is not loopback.

    `or_any_port` takes a free port where `port` is in use.
    """

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT
    token: str | None = None
    or_any_port: bool = False


class PageServer:
    """Shows one fleet on a page.

    Use `run` to serve in this thread until `stop` is called (from any thread) or the process is
    told to end, or use it as a context manager to serve in a thread of its own. `url` is where to
    point a browser, known from construction on. Raises GroundError when the port is in use.
    """

    def __init__(
        self,
        fleet: Fleet,
        source: Source,
        commands: CommandPort | None = None,
        playback: Playback | None = None,
        listen: Listen = Listen(),
        say: Callable[[str], None] = print,
    ) -> None: ...


def serve(
    fleet: Fleet,
    source: Source,
    commands: CommandPort | None = None,
    playback: Playback | None = None,
    listen: Listen = Listen(),
    say: Callable[[str], None] = print,
) -> None:
    """Serve the page until the process is interrupted; says where with `say`.

    A replay gives its own `source` and `playback`, and no `commands`.
    """
