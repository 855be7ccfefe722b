"""Plays a recording: play, pause, seek, 0.1 to 10 times real time. Pure: time is an argument."""

from bisect import bisect_left
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from config import topics
from config.messages import Message
from groundstation import keys
from groundstation.errors import GroundError
from groundstation.recording import keys_in, read_messages
from groundstation.series import topic_of

SLOWEST, FASTEST = 0.1, 10.0
NOT_SHOWN = frozenset(topics.STEP_RECORD)
"""Topics that only a replay check needs."""


class Played(NamedTuple):
    """One message of the recording, `time_s` after the recording's first."""

    time_s: float
    key: str
    payload: bytes
    message: Message


class Row(NamedTuple):
    """One message as recorded."""

    time_s: float
    key: str
    payload: bytes


class Player:
    """A recording and where it is being played; paused at its beginning at first.

    `now_s` is the caller's clock, any that goes on steadily; `start_wall_s` is the wall time of the
    first message.
    """

    def __init__(self, rows: Sequence[Row], now_s: float, start_wall_s: float = 0.0) -> None:
        self.start_wall_s = start_wall_s
        self._rows = rows
        self._times = [row.time_s for row in rows]
        self._decoders: dict[str, msgspec.json.Decoder[msgspec.Struct]] = {}
        self._now_s, self._position_s = now_s, 0.0
        self._next = 0
        self.speed = 1.0
        self.playing = False

    @property
    def duration_s(self) -> float:
        """Time from the first message to the last."""
        return self._times[-1] if self._times else 0.0

    @property
    def ended(self) -> bool:
        """All of it has been played."""
        return self._next >= len(self._rows)

    def position_s(self, now_s: float) -> float:
        """Time of the recording that is being shown now."""
        if not self.playing:
            return self._position_s
        position_s = self._position_s + max(0.0, now_s - self._now_s) * self.speed
        return min(position_s, self.duration_s)

    def play(self, now_s: float) -> None:
        """Go on from where it is, from the beginning once it has ended."""
        if self.ended:
            self.seek(now_s, 0.0)
        self._settle(now_s)
        self.playing = True

    def pause(self, now_s: float) -> None:
        """Hold."""
        self._settle(now_s)
        self.playing = False

    def set_speed(self, now_s: float, speed: float) -> None:
        """Play so many times as fast. Raises GroundError outside 0.1 to 10."""
        if not SLOWEST <= speed <= FASTEST:
            raise GroundError(f"speed {speed:g}: between {SLOWEST:g} and {FASTEST:g}")
        self._settle(now_s)
        self.speed = speed

    def seek(self, now_s: float, position_s: float) -> list[Played]:
        """Jump; returns the latest message of every key before that instant, to show at once."""
        self._now_s = now_s
        self._position_s = min(max(0.0, position_s), self.duration_s)
        self._next = bisect_left(self._times, self._position_s)
        latest = {row.key: row for row in self._rows[: self._next]}
        return [self._played(row) for row in sorted(latest.values(), key=lambda row: row.time_s)]

    def due(self, now_s: float) -> list[Played]:
        """Messages whose time has come since the last call, in order."""
        position_s = self.position_s(now_s)
        first = self._next
        while self._next < len(self._rows) and self._times[self._next] <= position_s:
            if not self.playing:
                break
            self._next += 1
        found = [self._played(row) for row in self._rows[first : self._next]]
        if self.ended and self.playing:
            self.pause(now_s)
        return found

    def _settle(self, now_s: float) -> None:
        self._position_s, self._now_s = self.position_s(now_s), now_s

    def _played(self, row: Row) -> Played:
        decoder = self._decoders.get(row.key)
        if decoder is None:
            kind = keys.parse(row.key).topic.message
            decoder = self._decoders[row.key] = msgspec.json.Decoder(kind)
        message = decoder.decode(row.payload)
        assert isinstance(message, Message), "published topics carry messages"
        return Played(row.time_s, row.key, row.payload, message)


def open_player(path: Path, now_s: float) -> Player:
    """A player of a recording.

    Raises GroundError when the file is no whole recording, or holds nothing to show.
    """
    wanted = [key for key in keys_in(path) if _shown(topic_of(key))]
    found = list(read_messages(path, wanted)) if wanted else []
    if not found:
        raise GroundError(f"{path} holds no message of a fleet: there is nothing to show")
    first_ns = found[0].wall_ns
    rows = [Row((each.wall_ns - first_ns) * 1e-9, each.key, each.payload) for each in found]
    return Player(rows, now_s, first_ns * 1e-9)


def _shown(topic: topics.Topic | None) -> bool:
    return topic is not None and topic not in NOT_SHOWN
