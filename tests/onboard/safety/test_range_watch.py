"""A follower that no longer knows its range falls back, and stops before it could touch."""

import math

import pytest

from config.fleet import Failsafe, Point, Robot
from config.loader import load_fleet, shipped_fleet_path
from onboard.estimate.beliefs import RelativeBelief
from onboard.safety.range_watch import RangeState, RangeWatch

DT = 0.01
OFFSET = Point(x_m=-0.3, y_m=-0.3)


def belief(range_m: float, std_m: float) -> RelativeBelief:
    return RelativeBelief(range_m, 0.7, 0.0, 0.0, (std_m**2, *(0.0,) * 15))


@pytest.fixture(name="watch")
def _watch() -> RangeWatch:
    robot: Robot = load_fleet(shipped_fleet_path("paper")).fleet.robots["r2"]
    limits = Failsafe()
    return RangeWatch(robot.model_copy(update={"failsafe": limits}), "r1", OFFSET)


def look(watch: RangeWatch, std_m: float, seconds: float = DT) -> RangeState:
    for _ in range(round(seconds / DT)):
        watch.fall_back = watch.uncertain is not None
        watch.look(DT, belief(0.45, std_m), told=True, speed_mps=1.0)
    return watch.state


def test_a_known_range_keeps_the_place(watch: RangeWatch) -> None:
    look(watch, 0.02, 5.0)
    assert watch.state is RangeState.OK
    assert watch.place == OFFSET
    assert watch.reason == ""


def test_beyond_its_share_the_place_falls_back_at_a_fifth_of_the_speed(watch: RangeWatch) -> None:
    look(watch, 0.069, 1.0)
    assert watch.state is RangeState.DEGRADED
    assert watch.place.x_m == pytest.approx(-0.3 - 0.2, abs=0.0021)
    assert watch.place.y_m == OFFSET.y_m
    look(watch, 0.069, 10.0)
    assert watch.place.x_m == pytest.approx(-0.3 - math.hypot(0.3, 0.3))
    assert watch.reason.startswith(
        "range to r1 uncertain: standard deviation 0.069 m, limit 0.068 m"
    )


def test_the_place_comes_back_only_well_below_the_limit(watch: RangeWatch) -> None:
    look(watch, 0.069, 10.0)
    assert look(watch, 0.050, 10.0) is RangeState.DEGRADED
    assert look(watch, 0.040, 10.0) is RangeState.OK
    assert watch.place == OFFSET


def test_three_deviations_within_the_safe_distance_are_a_reason_to_stop(watch: RangeWatch) -> None:
    look(watch, 0.0833)
    assert watch.problem is None
    look(watch, 0.0834)
    assert watch.state is RangeState.STOP
    assert watch.problem == (
        "range to r1 0.450 m less 3 sigma of 0.083 m is 0.200 m, limit 0.200 m "
        "(failsafe.distance_low)"
    )


def test_the_reason_says_so_when_nothing_tells_the_range(watch: RangeWatch) -> None:
    watch.look(DT, belief(0.45, 0.07), told=False, speed_mps=1.0)
    assert "range is unobservable: no two markers of r1" in watch.reason


def test_a_follower_ahead_of_its_leader_moves_away_forwards() -> None:
    robot = load_fleet(shipped_fleet_path("paper")).fleet.robots["r2"]
    watch = RangeWatch(robot, "r1", Point(x_m=0.4, y_m=0.0))
    look(watch, 0.07, 1.0)
    assert watch.place.x_m == pytest.approx(0.6, abs=0.0021)


def test_reset_forgets_the_last_drive(watch: RangeWatch) -> None:
    look(watch, 0.2)
    watch.reset()
    assert (watch.state, watch.problem, watch.place) == (RangeState.OK, None, OFFSET)
