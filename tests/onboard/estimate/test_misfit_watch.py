"""A source that contradicts the estimate shows although some of its bearings pass by chance."""

import random

from onboard.estimate.misfit_watch import MisfitWatch


def watch(accepted: list[bool]) -> str | None:
    misfits = MisfitWatch("bearings to r1")
    for each in accepted:
        misfits.add(each)
    return misfits.problem()


def test_random_angles_of_which_one_in_twelve_passes_show_within_a_hundred() -> None:
    draws = random.Random(1)
    problem = watch([draws.random() < 1 / 12 for _ in range(100)])
    assert problem is not None
    assert "of the last 100 bearings to r1 do not fit the estimate, limit 50" in problem


def test_half_of_the_window_refused_is_still_borne_and_one_more_is_not() -> None:
    assert watch([True] * 50 + [False] * 50) is None
    assert watch([True] * 49 + [False] * 51) is not None


def test_it_shows_after_so_many_bearings_even_before_the_window_is_full() -> None:
    assert watch([False] * 50) is None
    assert watch([False] * 51) is not None


def test_old_refusals_are_forgotten() -> None:
    assert watch([False] * 60 + [True] * 50) is None


def test_outliers_of_one_in_ten_are_no_contradiction() -> None:
    draws = random.Random(2)
    assert watch([draws.random() > 0.1 for _ in range(10_000)]) is None
