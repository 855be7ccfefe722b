"""Mutual bearings between the leader's messages and the filter: late, in any order, once."""

from typing import NamedTuple

from config.messages import Motion, Sighting
from onboard.estimate.motion_history import KEPT_S
from onboard.leader_messages import usable

REMEMBERED = 256
"""Bearings known as used: more than come within `KEPT_S`."""


class AgedSighting(NamedTuple):
    """A bearing that the leader took `age_s` ago."""

    sighting: Sighting
    age_s: float


class SightingBox:
    """Collects what a leader saw of one robot; messages may repeat and overtake each other."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._waiting: list[tuple[float, Sighting]] = []
        self._known: dict[tuple[int, int], None] = {}

    def put(self, motion: Motion) -> None:
        """Keep the bearings of a message that are new."""
        clock_offset_ns = motion.wall_ns - motion.t_ns
        for seen in motion.sightings:
            key = seen.t_ns, seen.marker
            if seen.target == self._robot and key not in self._known and usable(seen):
                self._known[key] = None
                self._waiting.append(((seen.t_ns + clock_offset_ns) * 1e-9, seen))
        while len(self._known) > REMEMBERED:
            del self._known[next(iter(self._known))]

    def take(self, wall_s: float) -> list[AgedSighting]:
        """What came in since the last call, oldest first; nothing older than `KEPT_S`."""
        waiting, self._waiting = sorted(self._waiting, key=lambda each: each[0]), []
        return [
            AgedSighting(seen, max(0.0, wall_s - taken_s))
            for taken_s, seen in waiting
            if wall_s - taken_s <= KEPT_S
        ]
