"""Whether a robot's recent geometry lets it know where it is, watched while it drives.

A robot among landmarks judges the local Gramian of the bearings that it received in the last
seconds. A robot that stands loses nothing, so the time for which it is weak counts only while it
moves, and a known start pose carries it until then. A follower tells the deviation of its range
and the transverse speed q, without which one bearing tells no range; what to do about a range that
is lost is `onboard.safety.range_watch`'s.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

from config import fleet
from onboard.estimate.weak_direction import in_words
from onboard.model.relative import RelativeState, transverse_speed
from onboard.model.vehicle import WheelMotion
from onboard.model.window_gramian import PATH_START, Look, carried_on, weakness, window_gramian

LOOKS = 20
"""A window is cut into so many stretches; bearings of one count as taken in one place."""

JUDGE_S = 0.2
"""Time between two judgements."""

MOVING_MPS = 0.02
WARN_AFTER_HOLD_FRACTION = 0.2


class Finding(NamedTuple):
    """The last judgement.

    `source` is "landmarks" or the leader's name, `direction` the weakest direction in words,
    `std_m` its deviation (one radian counts as one metre; None is unbounded). `singular_value` is
    the smallest of the window's Gramian [1/m^2]; `landmarks` those seen in the window, and
    `transverse_mps` the follower's q.
    """

    source: str
    weak: bool
    direction: str
    std_m: float | None
    limit_m: float
    singular_value: float | None = None
    landmarks: tuple[int, ...] = ()
    transverse_mps: float | None = None

    def __str__(self) -> str:
        std = "unbounded" if self.std_m is None else f"{self.std_m:.2f} m"
        return f"{self.direction}: standard deviation {std}, limit {self.limit_m:.2f} m"


class ObservabilityMonitor(Protocol):
    """What the robot's supervision and telemetry ask of a monitor."""

    @property
    def finding(self) -> Finding | None:
        """The last judgement, None before the first."""

    @property
    def weak_for_s(self) -> float:
        """How long the robot has been driving on weak geometry."""

    @property
    def degraded(self) -> bool:
        """Weak for long enough to tell people."""

    def problem(self) -> str | None:
        """Why the robot must not drive on, or None."""

    def not_ready(self) -> list[str]:
        """What speaks against arming."""


class _Motion(Protocol):
    """The part of the odometry that the geometry needs."""

    @property
    def speed_mps(self) -> float: ...
    @property
    def steering_rad(self) -> float: ...


class _Seen(Protocol):
    """The part of an observation that the geometry needs."""

    @property
    def marker(self) -> int: ...
    @property
    def std_rad(self) -> float: ...


class _Pose(Protocol):
    """The part of a pose belief that the geometry needs."""

    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...
    @property
    def heading_rad(self) -> float: ...


class _Relative(Protocol):
    """The part of a relative belief that the geometry needs."""

    @property
    def range_m(self) -> float: ...
    @property
    def bearing_rad(self) -> float: ...
    @property
    def heading_rad(self) -> float: ...
    @property
    def range_std_m(self) -> float: ...


class _Hold:
    """Counts the time of weak driving; strong geometry sets it back."""

    def __init__(self, settings: fleet.Observability) -> None:
        self._settings = settings
        self._since_judged_s = 0.0
        self.finding: Finding | None = None
        self.weak_for_s = 0.0

    @property
    def degraded(self) -> bool:
        """Weak for long enough to tell people."""
        return self.weak_for_s > WARN_AFTER_HOLD_FRACTION * self._settings.hold_s

    def _advance(self, dt_s: float, speed_mps: float) -> bool:
        """Count; True where it is time to judge."""
        if self.finding is not None and self.finding.weak and abs(speed_mps) > MOVING_MPS:
            self.weak_for_s += dt_s
        self._since_judged_s += dt_s
        if self._since_judged_s < JUDGE_S - dt_s / 2:
            return False
        self._since_judged_s = 0.0
        return True

    def _judged(self, finding: Finding) -> None:
        self.finding = finding
        if not finding.weak:
            self.weak_for_s = 0.0


class LandmarkMonitor(_Hold):
    """Of a robot that localises itself: see the module. `landmarks` maps ids to (x, y) [m]."""

    def __init__(self, robot: fleet.Robot, landmarks: Mapping[int, tuple[float, float]]) -> None:
        super().__init__(robot.observability)
        self._wheelbase_m = robot.vehicle.wheelbase_m
        self._mounting = robot.bearing_sensor.mounting
        self._landmarks = landmarks
        self._path = PATH_START
        self._looks: deque[Look] = deque(maxlen=LOOKS)
        self._look_s = robot.observability.window_s / LOOKS
        self._look_age_s = 0.0
        self._information: dict[int, float] = {}

    def observe(
        self,
        dt_s: float,
        motion: _Motion,
        bearings: Sequence[_Seen],
        pose: Callable[[], _Pose | None],
    ) -> None:
        """One cycle: the motion of the last `dt_s` and the bearings that came in.

        `pose` is asked for the present pose when it is time to judge; None postpones that.
        """
        wheel = WheelMotion(motion.speed_mps, motion.steering_rad)
        self._path = carried_on(self._path, wheel, self._wheelbase_m, dt_s)
        information = self._information
        for seen in bearings:
            if seen.marker in self._landmarks:
                weight = 1.0 / (seen.std_rad * seen.std_rad)
                information[seen.marker] = information.get(seen.marker, 0.0) + weight
        self._look_age_s += dt_s
        if self._look_age_s >= self._look_s - dt_s / 2:
            self._looks.append(Look(self._path, information))
            self._information, self._look_age_s = {}, 0.0
        if not self._landmarks:
            return
        if self._advance(dt_s, motion.speed_mps) and self._looks and (at := pose()) is not None:
            self._judge(at)

    def problem(self) -> str | None:
        """Why the robot must not drive on, or None."""
        limit_s = self._settings.hold_s
        if self.finding is None or self.weak_for_s <= limit_s:
            return None
        return (
            f"unobservable for {self.weak_for_s:.1f} s of driving, limit {limit_s:.1f} s "
            f"(observability.hold_s): {self.finding}"
        )

    def not_ready(self) -> list[str]:
        """Driven blind, or too few landmarks to change that by driving."""
        problem, found, needed = self.problem(), self.finding, self._settings.min_landmarks
        reasons = [] if problem is None else [problem]
        if found is not None and len(found.landmarks) < needed:
            ids = ", ".join(str(mark) for mark in found.landmarks) or "none"
            reasons.append(
                f"landmarks in view: {ids}; {needed} needed (observability.min_landmarks), or "
                f"driving leaves unobservable: {found.direction}"
            )
        return reasons

    def _judge(self, at: _Pose) -> None:
        place = (at.x_m, at.y_m)
        weakest = weakness(
            window_gramian(
                self._looks, self._path, place, at.heading_rad, self._landmarks, self._mounting
            )
        )
        ids = sorted({mark for look in self._looks for mark in look.information})
        limit_m = self._settings.weakest_std_limit_m
        self._judged(
            Finding(
                source="landmarks",
                weak=weakest.std_m is None or weakest.std_m > limit_m,
                direction=in_words(weakest, place, {mark: self._landmarks[mark] for mark in ids}),
                std_m=weakest.std_m,
                limit_m=limit_m,
                singular_value=weakest.singular_value,
                landmarks=tuple(ids),
            )
        )


class RangeMonitor(_Hold):
    """Of a follower: see the module."""

    def __init__(self, robot: fleet.Robot, leader: fleet.Robot, leader_name: str) -> None:
        super().__init__(robot.observability)
        self._leader_name = leader_name
        self._leader_wheelbase_m = leader.vehicle.wheelbase_m
        self._limit = robot.failsafe.range_deviation.limit_fraction

    def observe(
        self, dt_s: float, own: _Motion, leader: WheelMotion, belief: Callable[[], _Relative]
    ) -> None:
        """One cycle: both robots' motions; `belief` is asked for when it is time to judge."""
        if not self._advance(dt_s, own.speed_mps):
            return
        seen = belief()
        state = RelativeState(seen.range_m, seen.bearing_rad, seen.heading_rad)
        wheel = WheelMotion(own.speed_mps, own.steering_rad)
        limit_m = self._limit * seen.range_m
        self._judged(
            Finding(
                source=self._leader_name,
                weak=seen.range_std_m > limit_m,
                direction=f"range to {self._leader_name}",
                std_m=seen.range_std_m,
                limit_m=limit_m,
                transverse_mps=transverse_speed(state, leader, wheel, self._leader_wheelbase_m),
            )
        )

    def problem(self) -> str | None:
        """None: falling back and stopping is the range watch's."""
        return None

    def not_ready(self) -> list[str]:
        """Nothing: the follower itself waits for its range to settle."""
        return []
