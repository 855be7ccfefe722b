"""`echelon replay`: a recording on the operator's page, by the same view as a live fleet.

There is no Zenoh session in this process and no command path, and every key that leaves it bears
a prefix that no robot's key has: what is replayed cannot reach a robot.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from groundstation.heard import Heard
from groundstation.player import Played, Player, open_player
from groundstation.recording import read_info, recorded_fleet
from groundstation.web.interface import PlaybackState
from groundstation.web.server import Listen, serve

PREFIX = "replay/"
Clock = Callable[[], float]


class RecordedSource:
    """A player as the page's source of messages and as its playback controls."""

    def __init__(self, player: Player, clock: Clock = time.monotonic) -> None:
        self._player, self._clock = player, clock
        self._jumped: list[Heard] = []
        self._epoch = 0

    @property
    def epoch(self) -> int:
        """Changes with every jump in time."""
        return self._epoch

    def now_s(self) -> float:
        """Wall time of the recording."""
        return self._player.start_wall_s + self._player.position_s(self._clock())

    def poll(self) -> Sequence[Heard]:
        """What the recording has by now."""
        jumped, self._jumped = self._jumped, []
        return [*jumped, *self._heard(self._player.due(self._clock()))]

    def show_truth(self, wanted: bool) -> None:
        """A recording's truth is read in any case."""

    def alive(self) -> set[str] | None:
        """A recording does not tell."""
        return None

    def state(self) -> PlaybackState:
        """Where it is now."""
        player = self._player
        position_s = player.position_s(self._clock())
        return PlaybackState(position_s, player.duration_s, player.speed, player.playing)

    def play(self) -> None:
        """Go on, from the beginning once it has ended."""
        if self._player.ended:
            self.seek(0.0)
        self._player.play(self._clock())

    def pause(self) -> None:
        """Stand still."""
        self._player.pause(self._clock())

    def seek(self, position_s: float) -> None:
        """Go to a position; the page forgets what it has shown and gets what stood there."""
        self._epoch += 1
        self._jumped = self._heard(self._player.seek(self._clock(), position_s))

    def set_speed(self, factor: float) -> None:
        """Play at 0.1 to 10 times real time."""
        self._player.set_speed(self._clock(), factor)

    def _heard(self, played: Sequence[Played]) -> list[Heard]:
        start_s = self._player.start_wall_s
        return [
            Heard(start_s + each.time_s, PREFIX + each.key, each.payload, each.message)
            for each in played
        ]


def show(path: Path, listen: Listen, say: Callable[[str], None]) -> None:
    """Serve the page with the recording until the process is interrupted.

    Raises GroundError when the file is no whole recording, or the page's port is in use.
    """
    fleet = recorded_fleet(read_info(path))
    player = open_player(path, time.monotonic())
    say(f"{path}: {player.duration_s:.1f} s of fleet {fleet.name}")
    source = RecordedSource(player)
    source.play()
    serve(fleet, source, None, source, listen, PREFIX, say)
