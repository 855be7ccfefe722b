"""Within 250 ms a setpoint stays within reach of every other one."""

import pytest

from onboard.safety.window_limit import WindowLimit

REACH = 1.05 * 0.3


@pytest.mark.parametrize(("sign", "rate"), [(1.0, 2.0), (-1.0, 4.0)])
def test_the_reach_is_the_boundary_both_ways(sign: float, rate: float) -> None:
    window = WindowLimit(rise_per_s=2.0, fall_per_s=4.0)
    window.add(0.0, 0.0)
    assert window.covers(sign * rate * REACH * 0.999, 0.25)
    assert not window.covers(sign * rate * REACH * 1.001, 0.25)


def test_what_is_older_than_the_window_is_forgotten() -> None:
    window = WindowLimit(1.0, 1.0)
    window.add(0.0, 0.0)
    window.add(0.2, 0.1)
    assert not window.covers(0.4, 0.25)
    assert window.covers(0.4, 0.26)


def test_the_first_value_is_free() -> None:
    assert WindowLimit(1.0, 1.0).covers(99.0, 0.0)
