"""The view model: registry messages in, what the page shows out. Pure: time is passed in."""

import math
from collections import deque
from typing import TypeVar

from config.angles import wrap
from config.fleet import Fleet
from config.messages import Event, Message, Status
from groundstation import keys
from groundstation.known import Known
from groundstation.web.geometry import (
    Matrix3,
    Place,
    behind,
    ellipse_95,
    spread_behind,
    spread_of,
    wanted_offset,
)
from groundstation.web.history import History
from groundstation.web.rows import ClockOffsets, row
from groundstation.web.wire import LogLine, Numbers, RobotDetail, RobotFrame, Row

FRESH_S = 0.5
LOG_LINES = 300
M = TypeVar("M", bound=Message)


class FleetPicture:
    """What is known of a fleet from `(time_s, key, message)`, ready to be shown.

    Keys may begin with `prefix`. Those of other fleets and robots are left out.
    """

    def __init__(self, fleet: Fleet, prefix: str = "") -> None:
        self._fleet, self._prefix = fleet, prefix
        self._robots: dict[str, str | None] = {}
        self._known = {name: Known() for name in fleet.robots}
        self._clocks = ClockOffsets()
        self.history = History(len(fleet.robots))
        self.log: deque[LogLine] = deque(maxlen=LOG_LINES)
        self._unsent: list[LogLine] = []

    def hear(self, time_s: float, key: str, message: Message) -> None:
        """Take a message that arrived at `time_s` [s, wall clock]."""
        if key not in self._robots:
            self._robots[key] = self._robot(key)
        robot = self._robots[key]
        if robot is None:
            return
        if isinstance(message, Event):
            self.note(message.wall_ns * 1e-9, message.source, message.severity, message.text)
            return
        self._known[robot].hear(message)
        if isinstance(message, Status):
            self._clocks.add(robot, time_s - message.wall_ns * 1e-9)

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
        newest = self._known[robot].newest
        return "" if newest is None else newest.state

    def robots(self, now_s: float) -> list[RobotFrame]:
        """What moves, at `now_s`."""
        places = self._places()
        return [self._frame(name, places, now_s) for name in self._fleet.robots]

    def details(self, now_s: float, frames: list[RobotFrame]) -> list[RobotDetail]:
        """What changes slowly, at `now_s`; with the frames, this goes into the history too."""
        ellipses = self._ellipses()
        details = [self._detail(name, ellipses, now_s) for name in self._fleet.robots]
        self.history.add(now_s, frames, details)
        return details

    def rows(self, now_s: float, alive: set[str] | None) -> list[Row]:
        """The table at `now_s`."""
        return [
            row(
                self._fleet,
                name,
                self._known,
                now_s,
                self._clocks.offset_s(name),
                None if alive is None else name in alive,
            )
            for name in self._fleet.robots
        ]

    def particles(self) -> list[list[tuple[float, float]]]:
        """Places of particles, per robot; empty where no particle filter runs."""
        clouds = [known.particles for known in self._known.values()]
        return [[] if c is None else list(zip(c.x_m, c.y_m, strict=True)) for c in clouds]

    def _robot(self, key: str) -> str | None:
        """Which robot of this fleet a key belongs to, if any."""
        if not key.startswith(self._prefix):
            return None
        try:
            found = keys.parse(key.removeprefix(self._prefix))
        except ValueError:
            return None
        known = found.fleet == self._fleet.name and found.robot in self._known
        return found.robot if known else None

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
        pose, seen = self._known[name].pose, self._known[name].relative
        leader = self._fleet.robots[name].leader
        if pose is not None:
            found[name] = Place(pose.x_m, pose.y_m, pose.heading_rad)
        elif seen is not None and leader in found:
            found[name] = behind(found[leader], seen)
        return name in found

    def _ellipses(self) -> dict[str, Numbers]:
        """The 95 % ellipse of every place; leaders come before their followers in `places`."""
        places, spreads = self._places(), dict[str, Matrix3]()
        for name in places:
            pose, seen = self._known[name].pose, self._known[name].relative
            leader = self._fleet.robots[name].leader
            if pose is not None:
                spreads[name] = spread_of(pose)
            elif seen is not None and leader is not None:
                spreads[name] = spread_behind(places[leader], spreads[leader], seen)
        return {name: _rounded(*ellipse_95(spread)) for name, spread in spreads.items()}

    def _frame(self, name: str, places: dict[str, Place], now_s: float) -> RobotFrame:
        known, place = self._known[name], places.get(name)
        motion, truth = known.motion, _if_fresh(known.truth, now_s)
        steering = None if motion is None else motion.steering_rad
        return RobotFrame(
            fresh=_if_fresh(known.newest, now_s) is not None,
            pose=None if place is None else _rounded(*place, steering),
            truth=None
            if truth is None
            else _rounded(truth.x_m, truth.y_m, truth.heading_rad, truth.steering_rad),
        )

    def _detail(self, name: str, ellipses: dict[str, Numbers], now_s: float) -> RobotDetail:
        known = self._known[name]
        looks = _if_fresh(known.bearings, now_s)
        offset = wanted_offset(self._fleet.robots[name], known.relative)
        return RobotDetail(
            ellipse=ellipses.get(name),
            offset=None if offset is None else _rounded(*offset),
            looks=[]
            if looks is None
            else [(look.marker, round(look.bearing_rad, 4)) for look in looks.looks],
            values=self._values(name) if _if_fresh(known.newest, now_s) else None,
        )

    def _values(self, name: str) -> Numbers:
        """Range error, bearing error, NIS and speed."""
        known = self._known[name]
        seen, pose, motion = known.relative, known.pose, known.motion
        speed = motion.speed_mps if motion is not None and motion.valid else None
        wanted = wanted_offset(self._fleet.robots[name], seen)
        if seen is None or wanted is None:
            return _rounded(None, None, None if pose is None else pose.nis_median, speed)
        forward, left = wanted
        range_error_m = seen.range_m - math.hypot(forward, left)
        bearing_error = wrap(seen.bearing_rad - math.atan2(-left, -forward))
        return _rounded(range_error_m, bearing_error, seen.nis_mean, speed)


def _if_fresh(message: M | None, now_s: float) -> M | None:
    """The message unless it is older than FRESH_S."""
    fresh = message is not None and now_s - message.wall_ns * 1e-9 <= FRESH_S
    return message if fresh else None


def _rounded(*values: float | None) -> Numbers:
    """To a tenth of a millimetre; what is no finite number becomes null on the wire."""
    return [None if value is None else round(value, 4) for value in values]
