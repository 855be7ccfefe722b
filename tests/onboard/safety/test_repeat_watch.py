"""The very same bearings again and again are told from bearings that only change little."""

import pytest

from onboard.role import Observation
from onboard.safety.repeat_watch import RepeatWatch

PERIOD_S = 0.01
LOOK = [Observation(11, 0.5, 0.5, 0.05, 0.01), Observation(12, 0.7, 0.7, 0.05, 0.01)]


def repeated_s(looks: list[list[Observation]], speed_mps: float = 1.0) -> float:
    """What the watch says after the looks, one per cycle."""
    watch = RepeatWatch()
    lasts_s = 0.0
    for tick, look in enumerate(looks):
        lasts_s = watch.look(tick * PERIOD_S, look, speed_mps)
    return lasts_s


def test_the_same_look_is_counted_from_its_first_time_on() -> None:
    assert repeated_s([LOOK] * 31) == pytest.approx(0.3)


def test_cycles_without_a_look_neither_repeat_nor_change_it() -> None:
    assert repeated_s([LOOK, [], []] * 10 + [LOOK]) == pytest.approx(0.3)


def test_one_bearing_that_changes_by_a_digit_ends_it() -> None:
    other = [LOOK[0]._replace(sensor_rad=0.5001), LOOK[1]]
    assert repeated_s([*[LOOK] * 30, other]) == 0.0
    assert repeated_s([*[LOOK] * 30, LOOK[:1]]) == 0.0


def test_a_robot_that_stands_may_see_the_same_again() -> None:
    assert repeated_s([LOOK] * 100, speed_mps=0.05) == 0.0


def test_a_single_target_may_stay_where_it_is_seen() -> None:
    assert repeated_s([LOOK[:1]] * 100) == 0.0
