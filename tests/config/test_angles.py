"""The angle convention: (-pi, pi], anticlockwise positive."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.angles import wrap

angles = st.floats(-1e6, 1e6)


@given(angles)
def test_wrapped_angles_lie_in_the_half_open_turn(angle: float) -> None:
    assert -math.pi < wrap(angle) <= math.pi


@given(angles)
def test_wrapping_keeps_the_direction(angle: float) -> None:
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrap(angle)) == pytest.approx(math.sin(angle), abs=1e-9)


@given(angles)
def test_wrapping_twice_changes_nothing(angle: float) -> None:
    assert wrap(wrap(angle)) == wrap(angle)


@given(angles, st.integers(-1000, 1000))
def test_full_turns_make_no_difference(angle: float, turns: int) -> None:
    difference = wrap(angle + turns * math.tau) - wrap(angle)
    assert abs(math.remainder(difference, math.tau)) < 1e-8


@pytest.mark.parametrize("angle", [math.pi, -math.pi, 3 * math.pi, -3 * math.pi])
def test_backwards_is_plus_pi(angle: float) -> None:
    assert wrap(angle) == math.pi
