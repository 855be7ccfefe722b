"""What truly happens in a run, and what the robots say about it."""

import math
import re
from itertools import combinations
from typing import NamedTuple

import msgspec

from config.fleet import Fleet
from config.messages import Event
from groundstation.lockstep import Lockstep

MOVING_MPS = 0.02
_CHANGE = re.compile(r"(\w+) -> (\w+): (.*)", re.DOTALL)
_GIVEN_UP = ("STOPPING", "FAULT", "ESTOP")


class Fate(msgspec.Struct):
    """What became of one robot; times count from the first fault [s].

    `reason` is the first one for which it stopped, or refused to start, `gave_up_s` when. `moved_s`
    is when it last moved, None if it never did; `started_s` when it was told to start, where that
    was after the fault.
    """

    state: str
    reason: str = ""
    gave_up_s: float | None = None
    started_s: float | None = None
    moved_s: float | None = None
    told: list[str] = []


class Outcome(msgspec.Struct):
    """One run. `off_place_m` is the worst distance of a running follower from its place."""

    min_distance_m: float
    off_place_m: float
    ran_s: float
    robots: dict[str, Fate]


class _Place(NamedTuple):
    follower: str
    leader: str
    x_m: float
    y_m: float


class Witness:
    """Looks at the truth after every tick; `hear` is the run's recorder."""

    def __init__(self, fleet: Fleet) -> None:
        self._places = [
            _Place(name, robot.leader, robot.offset.x_m, robot.offset.y_m)
            for name, robot in fleet.robots.items()
            if robot.leader is not None and robot.offset is not None
        ]
        self._zero_s = math.inf
        self._now_s = 0.0
        self._nearest_m = math.inf
        self._off_place_m = 0.0
        self._fates = {name: Fate("") for name in fleet.robots}

    def begin(self, lockstep: Lockstep) -> None:
        """The first fault begins now."""
        self._zero_s = self._now_s = lockstep.now_s

    def hear(self, key: str, body: bytes, _t_ns: int) -> None:
        """Keep what robots tell people."""
        if self._zero_s is math.inf or not key.endswith("/event"):
            return
        event = msgspec.json.decode(body, type=Event)
        fate = self._fates.get(event.source)
        if fate is None:
            return
        change = _CHANGE.match(event.text)
        if change is None:
            fate.told.append(event.text)
        elif change[2] in _GIVEN_UP and change[2] != change[1]:
            self.gives_up(event.source, change[3])

    def gives_up(self, name: str, reason: str) -> None:
        """A robot stops, or does not start, for a reason; only the first one counts."""
        fate = self._fates[name]
        if fate.gave_up_s is None:
            fate.gave_up_s, fate.reason = self._now_s - self._zero_s, reason

    def starts(self, name: str) -> None:
        """A robot has been told to start."""
        self._fates[name].started_s = self._now_s - self._zero_s

    def look(self, lockstep: Lockstep) -> None:
        """One look at the truth."""
        self._now_s = lockstep.now_s
        truth = {name: robot.truth for name, robot in lockstep.simulation.robots.items()}
        for name, state in truth.items():
            if abs(state.speed_mps) > MOVING_MPS:
                self._fates[name].moved_s = self._now_s - self._zero_s
        for one, other in combinations(truth.values(), 2):
            distance_m = math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
            self._nearest_m = min(self._nearest_m, distance_m)
        for place in self._places:
            leader, own = truth[place.leader], truth[place.follower]
            if lockstep.stations[place.follower].robot.state == "RUNNING":
                c, s = math.cos(leader.heading_rad), math.sin(leader.heading_rad)
                x_m = leader.x_m + c * place.x_m - s * place.y_m
                y_m = leader.y_m + s * place.x_m + c * place.y_m
                off_m = math.hypot(own.x_m - x_m, own.y_m - y_m)
                self._off_place_m = max(self._off_place_m, off_m)

    def outcome(self, lockstep: Lockstep) -> Outcome:
        """What has been seen since `begin`."""
        for name, fate in self._fates.items():
            fate.state = str(lockstep.stations[name].robot.state)
        ran_s = self._now_s - self._zero_s
        return Outcome(self._nearest_m, self._off_place_m, ran_s, self._fates)
