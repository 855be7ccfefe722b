"""The watch on the NIS: silent while the noise is right, and an alarm where it is not."""

import random

import pytest

from onboard.estimate.beliefs import Innovation
from onboard.estimate.nis_watch import WINDOW, NisState, NisWatch, mean_nis_limits


def feed(watch: NisWatch, noise: random.Random, count: int, std: float = 1.0) -> set[NisState]:
    """Innovations whose true deviation is `std` times the claimed one; the states passed."""
    states = set()
    for _ in range(count):
        nis = noise.gauss(0.0, std) ** 2
        watch.add(Innovation(0.0, nis, nis <= 16.0))
        states.add(watch.state)
    return states


@pytest.mark.parametrize(
    ("count", "probability", "low", "high"),
    [
        (30, 1e-9, 0.114283, 3.452846),
        (30, 1e-3, 0.360158, 2.072062),
        (400, 1e-9, 0.626579, 1.494231),
        (400, 1e-3, 0.783567, 1.249166),
    ],
)
def test_limits_are_the_chi_square_quantiles(
    count: int, probability: float, low: float, high: float
) -> None:
    """Exact quantiles divided by the count."""
    found = mean_nis_limits(count, probability)
    assert 1 - found.low == pytest.approx(1 - low, rel=0.02)
    assert found.high - 1 == pytest.approx(high - 1, rel=0.02)


def test_right_noise_raises_no_alarm_in_minutes() -> None:
    watch = NisWatch()
    assert feed(watch, random.Random(1), 100_000) == {NisState.FILLING, NisState.OK}
    assert watch.mean == pytest.approx(1.0, abs=0.3)
    assert watch.problem() is None


def test_more_noise_than_claimed_is_an_alarm_with_figures() -> None:
    watch = NisWatch()
    feed(watch, random.Random(2), 2 * WINDOW, std=1.5)
    assert watch.state is NisState.HIGH
    problem = watch.problem()
    assert problem is not None
    assert "mean NIS 2." in problem
    assert f"limit {watch.limits.high:.2f}" in problem


def test_less_noise_than_claimed_is_told_but_stops_nobody() -> None:
    watch = NisWatch()
    feed(watch, random.Random(3), 2 * WINDOW, std=0.5)
    assert watch.state is NisState.LOW
    assert watch.problem() is None


def test_an_alarm_ends_only_well_inside_the_limits() -> None:
    watch, passed = NisWatch(), []
    for nis in (1.6, 1.35, 1.0):
        for _ in range(WINDOW):
            watch.add(Innovation(0.0, nis, True))
        passed.append(watch.state)
    assert passed == [NisState.HIGH, NisState.HIGH, NisState.OK]


def test_refused_bearings_are_the_gates_business() -> None:
    watch = NisWatch()
    for _ in range(WINDOW):
        watch.add(Innovation(0.0, 1.0, True))
        watch.add(Innovation(0.0, 40.0, False))
    assert watch.state is NisState.OK
    assert watch.mean == pytest.approx(1.0)
