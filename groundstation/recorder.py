"""Recording of a run: what was heard, as it came, and the scene that viewers draw from it.

A full disk or a lost folder stops the recording, never the caller: `take_notes` tells people, and
the recording goes on in a new part once there is room again.
"""

import shutil
from dataclasses import dataclass
from pathlib import Path

from config.closing import Closing
from config.fleet import Fleet
from config.messages import encode
from groundstation import keys, scene
from groundstation.errors import GroundError
from groundstation.keys import Address
from groundstation.mcap_part import McapPart
from groundstation.recording_format import INFO, expected_keys, info, part_path

MB = 1_000_000
FLUSH_PERIOD_S = 0.5
"""A killed process loses no more than what came in this time."""
RETRY_PAUSE_NS = 5_000_000_000
"""After a failed write, no new part is tried for so long."""


@dataclass(frozen=True, slots=True)
class Limits:
    """A part ends at `part_mb`; nothing is written while less than `keep_free_mb` are free."""

    part_mb: float = 1000.0
    keep_free_mb: float = 200.0


@dataclass(frozen=True, slots=True)
class About:
    """How the run came about, for the recording's first message."""

    wall_ns: int
    mode: str
    seed: int


class Recorder(Closing):
    """Writes `path` and, where it grows too large, its further parts.

    The same calls give the same bytes. The owner calls `tick`, or `flush`, all the time.

    Raises:
        GroundError: the first part cannot be begun.
    """

    def __init__(
        self, path: Path, fleet: Fleet, about: About, limits: Limits | None = None
    ) -> None:
        self.problem: str | None = None
        self.dropped = 0
        self._path, self._fleet, self._about = path, fleet, about
        self._limits = limits or Limits()
        self._addresses: dict[str, Address] = {}
        self._notes: list[str] = []
        self._parts = 0
        self._last_ns = self._retry_ns = about.wall_ns
        self._flush_s = 0.0
        self._scene = scene.Scene(fleet)
        self._part: McapPart | None = None
        self._begin_part()
        if self._part is None:
            raise GroundError(f"cannot record: {self.problem}")

    def write(self, topic: str, payload: bytes, log_time_ns: int) -> None:
        """Add one message; `log_time_ns` is its wall time.

        Raises ValueError for a key that is no published topic of the registry.
        """
        address = self._addresses.get(topic)
        if address is None:
            address = self._addresses[topic] = keys.parse(topic)
        self._last_ns = log_time_ns
        self._put(topic, payload, log_time_ns)
        for drawn in self._scene.hear(address, payload, log_time_ns):
            self._put(drawn.topic, encode(drawn.message), log_time_ns)

    def tick(self, now_s: float) -> None:
        """Flush every 0.5 s of the caller's clock, whatever the rhythm of the calls."""
        if now_s >= self._flush_s:
            periods = 1 + int((now_s - self._flush_s) // FLUSH_PERIOD_S)
            self._flush_s += periods * FLUSH_PERIOD_S
            self.flush()

    def flush(self) -> None:
        """Hand everything to the operating system; look after size and room on the disk."""
        if self._part is None:
            self._resume()
            return
        try:
            self._part.flush()
        except OSError as error:
            self._give_up(error)
            return
        if self._part.size >= self._limits.part_mb * MB:
            self._end_part()
            self._begin_part()
        else:
            self._guard()

    def take_notes(self) -> list[str]:
        """What people should know of the recording since the last call."""
        notes, self._notes = self._notes, []
        return notes

    def close(self) -> None:
        """Finish the file and give it its final name. Closing again does nothing."""
        if self._part is not None:
            self._end_part()

    def _put(self, topic: str, payload: bytes, log_time_ns: int) -> None:
        if self._part is None:
            self.dropped += 1
            return
        try:
            self._part.write(topic, payload, log_time_ns)
        except OSError as error:
            self._give_up(error)
            self.dropped += 1

    def _begin_part(self) -> None:
        """Open the next part; its first chunk holds all schemas and is on disk at once."""
        part = None
        try:
            part = McapPart(part_path(self._path, self._parts + 1))
            part.register([INFO, *scene.CHANNELS, *expected_keys(self._fleet)])
            first = info(
                self._fleet, self._last_ns, self._parts + 1, self._about.mode, self._about.seed
            )
            part.write(INFO, encode(first), self._last_ns)
            part.flush()
        except OSError as error:
            self._part = part
            self._give_up(error)
            return
        self._part = part
        self._parts += 1

    def _end_part(self) -> None:
        assert self._part is not None, "only called with an open part"
        try:
            self._part.close()
        except OSError as error:
            self._give_up(error)
            return
        self._part = None

    def _guard(self) -> None:
        free_mb = self._free_mb()
        if free_mb is None or free_mb >= self._limits.keep_free_mb:
            return
        self._end_part()
        self._stop(
            f"{free_mb:.0f} MB free on the disk of {self._path.parent}, limit "
            f"{self._limits.keep_free_mb:.0f} MB: make room, then recording goes on by itself"
        )

    def _resume(self) -> None:
        """Go on in a new part once twice the room is there that the guard asks for."""
        free_mb = self._free_mb()
        if self._last_ns < self._retry_ns:
            return
        if free_mb is None or free_mb < 2 * self._limits.keep_free_mb or free_mb < 1.0:
            return
        problem, self.problem = self.problem, None
        self._begin_part()
        if self._part is None:
            self.problem = problem
            self._notes.pop()
            return
        self._notes.append(f"recording goes on; {self.dropped} messages are missing")

    def _give_up(self, error: OSError) -> None:
        """The part is not whole any more: leave it for `recover`."""
        if self._part is not None:
            self._part.abandon()
        self._retry_ns = self._last_ns + RETRY_PAUSE_NS
        where = part_path(self._path, max(self._parts, 1))
        self._stop(f"{where}: {error.strerror or error}: `echelon recover` saves what is there")

    def _stop(self, problem: str) -> None:
        self._part, self.problem = None, problem
        self._notes.append(f"nothing is recorded any more: {problem}")

    def _free_mb(self) -> float | None:
        try:
            return shutil.disk_usage(self._path.parent).free / MB
        except OSError:
            return None
