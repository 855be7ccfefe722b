"""Whether anything tells the range: two markers seen apart, or a line of sight that turns.

With all bearings along one line of sight the range is unobservable while the transverse speed q is
zero: exactly when a formation drives straight and well. An estimate that jitters still makes a
Kalman filter believe that it learns the range, its deviation shrinks while the true error grows.
So the filters ask here, and where nothing tells the range they treat it as a Schmidt (consider)
state: bearings neither correct it nor make it look better known.
"""

from math import atan2, cos, hypot, sin
from typing import NamedTuple

from config.fleet import Point
from onboard.estimate.relative_model import Point as State
from onboard.model.relative import RelativeState, transverse_speed
from onboard.model.vehicle import WheelMotion

MEMORY_S = 0.5
"""A sight of two markers counts for so long."""
SPREAD_RAD = 0.05
"""Markers that appear closer together than this count as one."""
LEAST_SHARE = 0.5
"""A range that may be too long by its deviation counts as that much shorter, down to this share."""
PARALLAX_FRACTION = 0.05
"""A transverse speed below this fraction of the faster robot's speed counts as none."""
PARALLAX_SIGMAS = 2.0
"""Nor does one within so many deviations of what the heading error alone makes of the speed."""


class _Sight(NamedTuple):
    offset_rad: float
    time_s: float


class RangeInformation:
    """Watches where the markers appear and how fast the line of sight turns."""

    def __init__(self, leader_wheelbase_m: float) -> None:
        self._leader_wheelbase_m = leader_wheelbase_m
        self._time_s = 0.0
        self._share = 1.0
        self._leader_marks: dict[Point, _Sight] = {}
        self._own_marks: dict[Point, _Sight] = {}
        self.transverse_mps = 0.0
        self.available = False

    def advance(
        self,
        dt_s: float,
        mean: State,
        range_std_m: float,
        heading_std_rad: float,
        own: WheelMotion,
        leader: WheelMotion,
    ) -> None:
        """Judge the situation that a prediction led to."""
        self._time_s += dt_s
        range_m, bearing, heading, scale = mean
        self._share = max(LEAST_SHARE, 1.0 - range_std_m / range_m)
        true_leader = leader._replace(speed_mps=(1.0 + scale) * leader.speed_mps)
        self.transverse_mps = transverse_speed(
            RelativeState(range_m, bearing, heading), true_leader, own, self._leader_wheelbase_m
        )
        speed_mps = max(abs(own.speed_mps), abs(true_leader.speed_mps))
        limit_mps = (PARALLAX_FRACTION + PARALLAX_SIGMAS * heading_std_rad) * speed_mps
        self.available = (
            speed_mps > 0.0 and abs(self.transverse_mps) > limit_mps
        ) or self._markers_apart()

    def saw_leader_marker(self, marker: Point, mean: State) -> None:
        """The follower saw this marker of its leader."""
        range_m, bearing, heading, _ = mean
        self._leader_marks[marker] = _Sight(
            _beside(self._share * range_m, marker, heading - bearing), self._time_s
        )

    def saw_own_marker(self, marker: Point, mean: State) -> None:
        """The leader saw this marker of the follower."""
        range_m, bearing, _, _ = mean
        self._own_marks[marker] = _Sight(
            _beside(-self._share * range_m, marker, -bearing), self._time_s
        )

    def _markers_apart(self) -> bool:
        return any(self._apart(marks) for marks in (self._leader_marks, self._own_marks))

    def _apart(self, marks: dict[Point, _Sight]) -> bool:
        if len(marks) < 2:
            return False
        fresh_s = self._time_s - MEMORY_S
        offsets = [sight.offset_rad for sight in marks.values() if sight.time_s >= fresh_s]
        return len(offsets) > 1 and max(offsets) - min(offsets) > SPREAD_RAD


def _beside(range_m: float, marker: Point, turn_rad: float) -> float:
    """Angle between the body's front point, `range_m` ahead on the line of sight, and a marker.

    `turn_rad` turns the marker's body axes into those of the line of sight.
    """
    c, s = cos(turn_rad), sin(turn_rad)
    along = c * marker.x_m - s * marker.y_m
    across = s * marker.x_m + c * marker.y_m
    if hypot(along, across) == 0.0:
        return 0.0
    return atan2(across, range_m + along) if range_m > 0 else atan2(-across, -range_m - along)
