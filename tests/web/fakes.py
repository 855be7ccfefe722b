"""A source, a command path and a player of recordings that a test holds in its hands."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import msgspec
from websockets.sync.client import ClientConnection, connect

from config.fleet import Fleet
from config.messages import CommandReply, Message, encode
from groundstation.heard import Heard
from groundstation.web.interface import Order, PlaybackState
from groundstation.web.server import PageServer
from tests.groundstation.synthetic import WALL_NS

NOW_S = WALL_NS * 1e-9
LIMIT_S = 10.0


class FakeSource:
    """Hands on what the test gives it; time stands still."""

    def __init__(self) -> None:
        self.epoch = 0
        self.waiting: list[Heard] = []
        self.truth_wanted = False

    def give(self, key: str, message: Message) -> None:
        """A message arrives."""
        self.waiting.append(Heard(NOW_S, key, encode(message), message))

    def now_s(self) -> float:
        """Always the same."""
        return NOW_S

    def poll(self) -> Sequence[Heard]:
        """Everything that was given."""
        arrived, self.waiting = self.waiting, []
        return arrived

    def alive(self) -> set[str] | None:
        """Nothing can tell."""
        return None

    def show_truth(self, wanted: bool) -> None:
        """Remember it."""
        self.truth_wanted = wanted


class FakeCommands:
    """Remembers what was ordered; robots in `refuses` say no."""

    def __init__(self, fleet: Fleet, refuses: str = "") -> None:
        self.orders: list[Order] = []
        self.estops: list[str] = []
        self.announced: list[str] = []
        self._fleet, self._refuses = fleet, refuses

    def send(self, order: Order) -> Mapping[str, CommandReply]:
        """Every robot answers at once."""
        self.orders.append(order)
        return {
            name: CommandReply(
                robot=name, accepted=name != self._refuses, reason="drive not calibrated"
            )
            for name in self._fleet.robots
        }

    def publish_estop(self, operator: str) -> None:
        """Count it."""
        self.estops.append(operator)

    def announce_command(self, operator: str, since_ns: int) -> None:
        """Remember it."""
        self.announced.append(operator)


class FakePlayback:
    """A recording of 60 s."""

    def __init__(self) -> None:
        self.done: list[tuple[str, float]] = []

    def state(self) -> PlaybackState:
        """Paused at 12 s."""
        return PlaybackState(12.0, 60.0, 1.0, False)

    def play(self) -> None:
        """Remember it."""
        self.done.append(("play", 0.0))

    def pause(self) -> None:
        """Remember it."""
        self.done.append(("pause", 0.0))

    def seek(self, position_s: float) -> None:
        """Remember it."""
        self.done.append(("seek", position_s))

    def set_speed(self, factor: float) -> None:
        """Remember it."""
        self.done.append(("speed", factor))


class Page:
    """A page without a browser: the same WebSocket, read message by message."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self._unread: deque[dict[str, Any]] = deque()

    def say(self, do: str, **fields: object) -> None:
        """Send a message."""
        self.socket.send(msgspec.json.encode({"do": do, **fields}).decode())

    def next(self, kind: str, **wanted: object) -> dict[str, Any]:
        """The next message of this kind in which these fields are so; frames are acknowledged."""
        while True:
            while not self._unread:
                self._unread.extend(msgspec.json.decode(self.socket.recv(LIMIT_S)))
            message = self._unread.popleft()
            if message["kind"] == "frame":
                self.say("got", n=message["n"])
            if message["kind"] == kind and wanted.items() <= message.items():
                return message


@contextmanager
def opened(server: PageServer, token: str = "", name: str = "") -> Iterator[Page]:
    """A page that is connected and has introduced itself."""
    url = f"ws://127.0.0.1:{server.port}/ws"
    with connect(url, compression=None, close_timeout=1) as socket:
        page = Page(socket)
        page.say("introduce", token=token, name=name)
        yield page
