"""A follower that no longer knows how far its leader is: fall back, then stop, before they meet.

Where the range's standard deviation exceeds its share of the range, the failsafe table has the
commanded place moved away along the leader's axis (`hold_distance`) until the deviation is well
below. Falling back is also what turns the line of sight, so it makes the range observable where a
straight formation does not. Where even three deviations could bring the leader within the safe
distance, the table stops the robot.
"""

import math
from enum import StrEnum

from config.fleet import Point, Robot
from onboard.estimate.beliefs import RelativeBelief

STOP_SIGMAS = 3.0
CLEAR_SHARE = 2 / 3
"""Of the limit: below this the place goes back to where it belongs."""
FALL_BACK_SPEED_FRACTION = 0.2
LEAST_FALL_BACK_MPS = 0.1


class RangeState(StrEnum):
    """What to do about the range's uncertainty, by rising severity."""

    OK = "ok"
    DEGRADED = "degraded"
    STOP = "stop"


class RangeWatch:
    """Judges beliefs while the robot drives, and says where the commanded place is by now.

    The limits are rows of the robot's failsafe table, `range_deviation` and `distance_low`; what
    they lead to is the table's. `fall_back` is set by whoever wants more distance.
    """

    def __init__(self, robot: Robot, leader: str, offset: Point) -> None:
        self.state = RangeState.OK
        self.reason = ""
        self.fall_back = False
        self._leader, self._offset = leader, offset
        self._target, self._slide_mps = offset, 0.0
        self._std_limit = robot.failsafe.range_deviation.limit_fraction
        self._safe_m = robot.failsafe.distance_low.limit_m
        self._spacing_factor = robot.failsafe.spacing_factor
        self._extra_m = 0.0

    @property
    def place(self) -> Point:
        """The commanded place in the leader's body axes, moved away as far as it is by now."""
        x_m = self._offset.x_m
        return Point(x_m=x_m + math.copysign(self._extra_m, x_m or -1.0), y_m=self._offset.y_m)

    @property
    def problem(self) -> str | None:
        """Why the robot is too near."""
        return self.reason if self.state is RangeState.STOP else None

    @property
    def uncertain(self) -> str | None:
        """Why the range is too uncertain, be the robot far enough away or not."""
        return None if self.state is RangeState.OK else self.reason

    def reset(self) -> None:
        """Forget the last drive."""
        self.state, self.reason, self._extra_m = RangeState.OK, "", 0.0
        self.fall_back = False

    def go_to(self, target: Point, speed_mps: float) -> None:
        """Let the place slide to another one, straight there."""
        self._target, self._slide_mps = target, speed_mps

    def slide(self, dt_s: float) -> None:
        """Move the place on by `dt_s` where it is not yet where it shall be."""
        if self._offset == self._target:
            return
        dx_m, dy_m = self._target.x_m - self._offset.x_m, self._target.y_m - self._offset.y_m
        left_m, step_m = math.hypot(dx_m, dy_m), self._slide_mps * dt_s
        if left_m <= step_m:
            self._offset = self._target
            return
        share = step_m / left_m
        self._offset = Point(
            x_m=self._offset.x_m + share * dx_m, y_m=self._offset.y_m + share * dy_m
        )

    def look(self, dt_s: float, belief: RelativeBelief, told: bool, speed_mps: float) -> None:
        """Judge the belief; `told` says whether anything makes the range observable.

        `speed_mps` is the own speed: falling back takes a share of it.
        """
        self.state = self._judged(belief)
        self.reason = self._explained(belief, told)
        step_m = dt_s * max(LEAST_FALL_BACK_MPS, FALL_BACK_SPEED_FRACTION * abs(speed_mps))
        spacing_m = math.hypot(self._offset.x_m, self._offset.y_m)
        wanted_m = (self._spacing_factor - 1.0) * spacing_m if self.fall_back else 0.0
        self._extra_m += min(max(wanted_m - self._extra_m, -step_m), step_m)

    def too_near(self, belief: RelativeBelief) -> str | None:
        """The reason to stop, or not to start, or None."""
        nearest_m = belief.range_m - STOP_SIGMAS * belief.range_std_m
        if nearest_m >= self._safe_m:
            return None
        return (
            f"range to {self._leader} {belief.range_m:.3f} m less {STOP_SIGMAS:.0f} sigma of "
            f"{belief.range_std_m:.3f} m is {nearest_m:.3f} m, "
            f"limit {self._safe_m:.3f} m (failsafe.distance_low)"
        )

    def _judged(self, belief: RelativeBelief) -> RangeState:
        if self.too_near(belief) is not None:
            return RangeState.STOP
        share = self._std_limit
        if self.state is not RangeState.OK:
            share *= CLEAR_SHARE
        return RangeState.DEGRADED if belief.range_std_m > share * belief.range_m else RangeState.OK

    def _explained(self, belief: RelativeBelief, told: bool) -> str:
        cause = "" if told else f"; {unobservable(self._leader)}"
        if self.state is RangeState.STOP:
            return f"{self.too_near(belief)}{cause}"
        if self.state is RangeState.DEGRADED:
            limit_m = self._std_limit * belief.range_m
            return (
                f"range to {self._leader} uncertain: standard deviation "
                f"{belief.range_std_m:.3f} m, limit {limit_m:.3f} m{cause}"
            )
        return ""


def unobservable(leader: str) -> str:
    """What keeps the range from being observed, in words."""
    return (
        f"range is unobservable: no two markers of {leader} or of this robot are seen apart, "
        "and the line of sight does not turn"
    )
