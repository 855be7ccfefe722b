"""Whether a robot's recent geometry lets it know where it is, watched while it drives.

A robot among landmarks judges the local Gramian of the bearings that it received in the last
seconds; a follower judges the range deviation of its filter and the transverse speed q, without
which one bearing tells no range. A robot that stands loses nothing, so the time for which it is
weak counts only while it moves, and a known start pose carries it until then.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Literal, NamedTuple, Protocol

from config import fleet
from onboard.estimate.weak_direction import in_words
from onboard.model.relative import RelativeState, transverse_speed
from onboard.model.vehicle import WheelMotion
from onboard.model.window_gramian import (
    PATH_START,
    Look,
    carried_on,
    weakness,
    window_gramian,
)

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
        return self.weak_for_s > WARN_AFTER_HOLD_FRACTION * self._settings.hold_s

    def problem(self) -> str | None:
        limit_s = self._settings.hold_s
        if self.finding is None or self.weak_for_s <= limit_s:
            return None
        return (
            f"unobservable for {self.weak_for_s:.1f} s of driving, limit {limit_s:.1f} s: "
            f"{self.finding}"
        )

    def not_ready(self) -> list[str]:
        problem = self.problem()
        return [] if problem is None else [problem]

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

    def __init__(
        self,
        settings: fleet.Observability,
        wheelbase_m: float,
        mounting: Literal["body", "fork"],
        landmarks: Mapping[int, tuple[float, float]],
    ) -> None:
        super().__init__(settings)
        self._wheelbase_m = wheelbase_m
        self._mounting: Literal["body", "fork"] = mounting
        self._landmarks = landmarks
        self._path = PATH_START
        self._looks: deque[Look] = deque(maxlen=LOOKS)
        self._look_s = settings.window_s / LOOKS
        self._look_age_s = 0.0
        self._information: dict[int, float] = {}

    def observe(
        self,
        dt_s: float,
        motion: WheelMotion,
        bearings: Iterable[tuple[int, float]],
        pose: Callable[[], _Pose | None],
    ) -> None:
        """One cycle: the motion of the last `dt_s` and the bearings used, as (landmark, std).

        `pose` is asked for the present pose when it is time to judge; None postpones that.
        """
        self._path = carried_on(self._path, motion, self._wheelbase_m, dt_s)
        information = self._information
        for mark, std_rad in bearings:
            if mark in self._landmarks:
                information[mark] = information.get(mark, 0.0) + 1.0 / (std_rad * std_rad)
        self._look_age_s += dt_s
        if self._look_age_s >= self._look_s - dt_s / 2:
            self._end_look()
        if self._advance(dt_s, motion.speed_mps) and (at := pose()) is not None:
            self._judge(at)

    def not_ready(self) -> list[str]:
        """Too few landmarks: driving would not make the weak direction observable either."""
        found, needed = self.finding, self._settings.min_landmarks
        if found is None or len(found.landmarks) >= needed:
            return super().not_ready()
        ids = ", ".join(str(mark) for mark in found.landmarks) or "none"
        few = f"landmarks in view: {ids}; {needed} needed, or driving leaves unobservable: "
        return [f"{few}{found.direction}", *super().not_ready()]

    def _end_look(self) -> None:
        self._looks.append(Look(self._path, self._information))
        self._information, self._look_age_s = {}, 0.0

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

    def __init__(
        self, settings: fleet.Observability, leader: str, leader_wheelbase_m: float
    ) -> None:
        super().__init__(settings)
        self._leader, self._leader_wheelbase_m = leader, leader_wheelbase_m

    def observe(
        self,
        dt_s: float,
        own: WheelMotion,
        leader: WheelMotion,
        belief: Callable[[], _Relative],
    ) -> None:
        """One cycle: both robots' motions; `belief` is asked for when it is time to judge."""
        if not self._advance(dt_s, own.speed_mps):
            return
        seen = belief()
        state = RelativeState(seen.range_m, seen.bearing_rad, seen.heading_rad)
        limit_m = self._settings.range_std_limit * seen.range_m
        self._judged(
            Finding(
                source=self._leader,
                weak=seen.range_std_m > limit_m,
                direction=f"range to {self._leader}",
                std_m=seen.range_std_m,
                limit_m=limit_m,
                transverse_mps=transverse_speed(state, leader, own, self._leader_wheelbase_m),
            )
        )
