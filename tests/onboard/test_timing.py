"""The loop's schedule skips what it missed, and its statistics say so."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.timing import LoopStatistics, Schedule


def test_a_cycle_in_time_moves_one_period_on() -> None:
    schedule = Schedule(next_s=1.0, period_s=0.01)
    assert schedule.advance(now_s=1.004) == 0
    assert schedule.next_s == pytest.approx(1.01)


def test_missed_periods_are_skipped_and_counted_never_caught_up() -> None:
    schedule = Schedule(next_s=1.0, period_s=0.01)
    assert schedule.advance(now_s=1.037) == 3
    assert schedule.next_s == pytest.approx(1.04)


@given(late_s=st.floats(0.0, 10.0))
def test_the_next_deadline_is_always_ahead_and_on_the_grid(late_s: float) -> None:
    schedule = Schedule(next_s=5.0, period_s=0.01)
    skipped = schedule.advance(5.0 + late_s)
    assert 5.0 + late_s - 1e-9 <= schedule.next_s <= 5.0 + late_s + 0.01 + 1e-9
    assert schedule.next_s == pytest.approx(5.0 + (skipped + 1) * 0.01)


def test_statistics_give_percentiles_of_durations_and_count_overruns() -> None:
    statistics = LoopStatistics(realtime=True)
    for cycle in range(100):
        statistics.record(duration_s=0.001 * (cycle + 1), late_s=0.0001, skipped=int(cycle == 99))
    health = statistics.health
    assert health.cycles == 100
    assert health.overruns == 1
    assert health.p50_ms == pytest.approx(51.0)
    assert health.p99_ms == pytest.approx(100.0)
    assert health.max_ms == pytest.approx(100.0)
    assert health.late_p99_ms == pytest.approx(0.1)
    assert health.realtime
