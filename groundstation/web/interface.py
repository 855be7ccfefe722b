"""What the page is fed with: messages from anywhere, a way to command, a way to play.

The live fleet and a recording differ only in the three objects behind these protocols. All of
them are called from the server's own thread, except `CommandPort.send`, which may block and is
called from a worker's.
"""

from collections.abc import Mapping, Sequence
from typing import Protocol

import msgspec

from config.messages import CommandReply
from groundstation.heard import Heard


class Source(Protocol):
    """Where messages come from: the network, or a recording."""

    @property
    def epoch(self) -> int:
        """Changes when time has jumped: the page then forgets everything that it has shown."""

    def now_s(self) -> float:
        """The instant that ages are counted to [s]: the wall clock, or the recording's time."""

    def poll(self) -> Sequence[Heard]:
        """What has arrived since the last call, in order; called about 30 times a second."""

    def alive(self) -> set[str] | None:
        """Processes that announce that they live; None where nothing can tell."""

    def show_truth(self, wanted: bool) -> None:
        """Whether anybody wants to see where simulated robots really are."""


class Order(msgspec.Struct, frozen=True):
    """A command of the operator: arm, start, stop, reset or formation, for every robot.

    `formation` is the name of the formation to change to.
    """

    name: str
    operator: str
    formation: str = ""


class CommandPort(Protocol):
    """The way to live robots. A page without one cannot command anything."""

    def send(self, order: Order) -> Mapping[str, CommandReply]:
        """Give an order to every robot and collect the answers; may take seconds."""

    def publish_estop(self, operator: str) -> None:
        """Publish the emergency stop once; the page repeats it."""

    def announce_command(self, operator: str, since_ns: int) -> None:
        """Tell other ground stations who is in command here."""


class PlaybackState(msgspec.Struct, frozen=True):
    """Where a player is: position and length [s], speed as a factor of real time."""

    position_s: float
    duration_s: float
    speed: float
    playing: bool


class Playback(Protocol):
    """A player of a recording; with one, the page shows its controls and disables commands."""

    def state(self) -> PlaybackState:
        """Where it is now."""

    def play(self) -> None:
        """Go on."""

    def pause(self) -> None:
        """Stand still."""

    def seek(self, position_s: float) -> None:
        """Go to a position; the source's `epoch` changes."""

    def set_speed(self, factor: float) -> None:
        """Play at 0.1 to 10 times real time."""
