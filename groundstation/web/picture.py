"""The view model: registry messages in, what the page shows out. Pure: time is passed in."""

import math
from collections import deque
from typing import TypeVar

from config.angles import wrap
from config.fleet import Fleet
from config.messages import (
    Bearings,
    Event,
    Message,
    Motion,
    Particles,
    PoseEstimate,
    RelativeEstimate,
    Status,
    Truth,
)
from groundstation import keys
from groundstation.web.geometry import (
    Matrix3,
    Place,
    behind,
    ellipse_95,
    offset_from,
    spread_behind,
    spread_of,
)
from groundstation.web.history import History
from groundstation.web.rows import ClockOffsets, row
from groundstation.web.wire import LogLine, Numbers, RobotFrame, Row

FRESH_S = 0.5
LOG_LINES = 300
ELLIPSES_EVERY = 3
"""Frames between two looks at the covariances, which change slowly."""
M = TypeVar("M", bound=Message)


class FleetPicture:
    """What is known of a fleet from `(time_s, key, message)`, ready to be shown.

    Keys may begin with `prefix`. Those of other fleets and robots are left out.
    """

    def __init__(self, fleet: Fleet, prefix: str = "") -> None:
        self._fleet, self._prefix = fleet, prefix
        self._addresses: dict[str, keys.Address | None] = {}
        self._latest: dict[tuple[str, type[Message]], Message] = {}
        self._clocks = ClockOffsets()
        self._ellipses: dict[str, Numbers] = {}
        self._calls = 0
        self.history = History(len(fleet.robots))
        self.log: deque[LogLine] = deque(maxlen=LOG_LINES)
        self._unsent: list[LogLine] = []

    def hear(self, time_s: float, key: str, message: Message) -> None:
        """Take a message that arrived at `time_s` [s, wall clock]."""
        address = self._address(key)
        if address is None:
            return
        if isinstance(message, Event):
            self.note(message.wall_ns * 1e-9, message.source, message.severity, message.text)
            return
        known = self._latest.get((address.robot, type(message)))
        if known is None or known.wall_ns <= message.wall_ns:
            self._latest[address.robot, type(message)] = message
        if isinstance(message, Status):
            self._clocks.add(address.robot, time_s - message.wall_ns * 1e-9)

    def note(self, time_s: float, source: str, severity: str, text: str) -> None:
        """Add a line to the event log."""
        line = LogLine(time_s, source, severity, text)
        self.log.append(line)
        self._unsent.append(line)

    def take_log(self) -> list[LogLine]:
        """Lines since the last call."""
        lines, self._unsent = self._unsent, []
        return lines

    def state(self, robot: str) -> str:
        """The robot's state by its newest message, empty while nothing was heard."""
        newest = self._newest_of(robot)
        return "" if newest is None else newest.state

    def robots(self, now_s: float) -> list[RobotFrame]:
        """What moves, at `now_s`; sampled into the history too."""
        places = self._places()
        if self._calls % ELLIPSES_EVERY == 0:
            self._ellipses = self._drawn_ellipses(places)
        self._calls += 1
        frames = [self._robot(name, places, now_s) for name in self._fleet.robots]
        self.history.add(now_s, frames)
        return frames

    def rows(self, now_s: float, alive: set[str] | None) -> list[Row]:
        """The table at `now_s`."""
        return [
            row(
                self._fleet,
                name,
                self._latest,
                self._newest_of(name),
                now_s,
                self._clocks.offset_s(name),
                None if alive is None else name in alive,
            )
            for name in self._fleet.robots
        ]

    def particles(self) -> list[list[tuple[float, float]]]:
        """Places of particles, per robot; empty where no particle filter runs."""
        clouds = [self._get(name, Particles) for name in self._fleet.robots]
        return [[] if c is None else list(zip(c.x_m, c.y_m, strict=True)) for c in clouds]

    def _address(self, key: str) -> keys.Address | None:
        if key not in self._addresses:
            try:
                if not key.startswith(self._prefix):
                    raise ValueError(f"{key!r} does not begin with {self._prefix!r}")
                found = keys.parse(key.removeprefix(self._prefix))
            except ValueError:
                self._addresses[key] = None
            else:
                own = found.fleet == self._fleet.name
                self._addresses[key] = found if own else None
        return self._addresses[key]

    def _get(self, robot: str, kind: type[M]) -> M | None:
        message = self._latest.get((robot, kind))
        return message if isinstance(message, kind) else None

    def _newest_of(self, robot: str) -> Status | Motion | None:
        status, motion = self._get(robot, Status), self._get(robot, Motion)
        if status is None or motion is None:
            return status or motion
        return motion if motion.wall_ns > status.wall_ns else status

    def _places(self) -> dict[str, Place]:
        """Estimated places, down the tree from robots that localise themselves."""
        found: dict[str, Place] = {}
        waiting = list(self._fleet.robots)
        while waiting:
            left = [name for name in waiting if not self._place(name, found)]
            if len(left) == len(waiting):
                break
            waiting = left
        return found

    def _place(self, name: str, found: dict[str, Place]) -> bool:
        pose, seen = self._get(name, PoseEstimate), self._get(name, RelativeEstimate)
        leader = self._fleet.robots[name].leader
        if pose is not None:
            found[name] = Place(pose.x_m, pose.y_m, pose.heading_rad)
        elif seen is not None and leader in found:
            found[name] = behind(found[leader], seen)
        return name in found

    def _drawn_ellipses(self, places: dict[str, Place]) -> dict[str, Numbers]:
        """The 95 % ellipse of every place; leaders come before their followers in `places`."""
        spreads: dict[str, Matrix3] = {}
        for name in places:
            pose, seen = self._get(name, PoseEstimate), self._get(name, RelativeEstimate)
            leader = self._fleet.robots[name].leader
            if pose is not None:
                spreads[name] = spread_of(pose)
            elif seen is not None and leader is not None:
                spreads[name] = spread_behind(places[leader], spreads[leader], seen)
        return {name: _rounded(*ellipse_95(spread)) for name, spread in spreads.items()}

    def _robot(self, name: str, places: dict[str, Place], now_s: float) -> RobotFrame:
        motion, truth = self._get(name, Motion), self._get(name, Truth)
        looks, place = self._get(name, Bearings), places.get(name)
        newest = self._newest_of(name)
        fresh = newest is not None and now_s - newest.wall_ns * 1e-9 <= FRESH_S
        steering = None if motion is None else motion.steering_rad
        return RobotFrame(
            fresh=fresh,
            pose=None if place is None else _rounded(*place, steering),
            ellipse=self._ellipses.get(name),
            place=self._wanted(name, places),
            looks=[]
            if looks is None or now_s - looks.wall_ns * 1e-9 > FRESH_S
            else [(look.marker, round(look.bearing_rad, 4)) for look in looks.looks],
            truth=None
            if truth is None
            else _rounded(truth.x_m, truth.y_m, truth.heading_rad, truth.steering_rad),
            values=self._values(name, motion) if fresh else None,
        )

    def _wanted(self, name: str, places: dict[str, Place]) -> Numbers | None:
        """The wanted place beside the leader, where the leader believes to be."""
        robot, seen = self._fleet.robots[name], self._get(name, RelativeEstimate)
        if robot.leader not in places or robot.offset is None:
            return None
        leader = places[robot.leader]
        forward, left = robot.offset.x_m, robot.offset.y_m
        if seen is not None and seen.place_x_m is not None and seen.place_y_m is not None:
            forward, left = seen.place_x_m, seen.place_y_m
        return _rounded(*offset_from(leader, forward, left), leader.heading_rad)

    def _values(self, name: str, motion: Motion | None) -> Numbers:
        """Range error, bearing error, NIS and speed."""
        seen, pose = self._get(name, RelativeEstimate), self._get(name, PoseEstimate)
        offset = self._fleet.robots[name].offset
        speed = motion.speed_mps if motion is not None and motion.valid else None
        if seen is None or offset is None:
            return _rounded(None, None, None if pose is None else pose.nis_median, speed)
        if seen.place_x_m is not None and seen.place_y_m is not None:
            forward, left = seen.place_x_m, seen.place_y_m
        else:
            forward, left = offset.x_m, offset.y_m
        range_error_m = seen.range_m - math.hypot(forward, left)
        bearing_error = wrap(seen.bearing_rad - math.atan2(-left, -forward))
        return _rounded(range_error_m, bearing_error, seen.nis_mean, speed)


def _rounded(*values: float | None) -> Numbers:
    """To a tenth of a millimetre; what is no number is None."""
    return [
        None if value is None or not math.isfinite(value) else round(value, 4) for value in values
    ]
