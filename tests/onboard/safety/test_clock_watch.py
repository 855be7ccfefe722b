"""A wall clock that jumps is seen; one that drifts, or a single late reading, is not kept."""

from onboard.safety.clock_watch import ADOPT_S, ClockWatch


def test_a_drifting_clock_is_followed() -> None:
    watch = ClockWatch(0.05)
    for tick in range(100_000):
        now_s = tick * 0.01
        assert abs(watch.step_s(now_s, 500.0 + now_s * 1.0005)) < 1e-4


def test_a_jump_is_told_for_a_second_and_then_the_new_time_counts() -> None:
    watch = ClockWatch(0.05)
    watch.step_s(0.0, 100.0)
    told = [watch.step_s(0.01 * n, 100.0 + 0.01 * n - 2.0) for n in range(1, 151)]
    assert min(told[:100]) < -1.99
    assert told.index(max(told)) * 0.01 >= ADOPT_S - 0.011
    assert abs(told[-1]) < 1e-9


def test_one_late_reading_is_over_with_the_next() -> None:
    watch = ClockWatch(0.05)
    watch.step_s(0.0, 100.0)
    assert watch.step_s(0.01, 100.21) > 0.19
    assert abs(watch.step_s(0.02, 100.02)) < 1e-9
