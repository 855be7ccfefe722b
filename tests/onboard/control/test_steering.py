"""Setpoints stay inside the limits and do what the law asked for."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.fleet import Limits
from onboard.control.steering import WheelController
from onboard.model.relative import BodyVelocity

LIMITS = Limits(
    speed_mps=5.0,
    acceleration_mps2=4.0,
    deceleration_mps2=8.0,
    steering_rad=0.6,
    steering_rate_radps=3.0,
)
DT = 0.01
velocities = st.builds(BodyVelocity, st.floats(-9, 9), st.floats(-9, 9))


@given(commands=st.lists(velocities, min_size=1, max_size=30), measured=st.floats(-0.6, 0.6))
def test_no_command_leaves_the_limits(commands: list[BodyVelocity], measured: float) -> None:
    controller = WheelController(LIMITS)
    last = controller.last
    for wanted in commands:
        now = controller.follow(DT, wanted, measured)
        assert abs(now.steering_rad) <= LIMITS.steering_rad
        assert abs(now.steering_rad - last.steering_rad) <= 0.03 + 1e-12
        assert 0.0 <= now.speed_mps <= LIMITS.speed_mps
        assert -0.08 - 1e-12 <= now.speed_mps - last.speed_mps <= 0.04 + 1e-12
        last = now


def test_a_steady_command_is_reached() -> None:
    controller = WheelController(LIMITS)
    for _ in range(200):
        setpoint = controller.follow(DT, BodyVelocity(3.0, 0.9), controller.last.steering_rad)
    assert setpoint.steering_rad == pytest.approx(math.atan2(0.9, 3.0))
    assert setpoint.speed_mps == pytest.approx(math.hypot(3.0, 0.9))


def test_speed_is_projected_on_the_wheel_as_it_stands() -> None:
    controller = WheelController(LIMITS)
    controller.reset(0.0, 2.0)
    assert controller.follow(DT, BodyVelocity(2.0, 1.0), 0.0).speed_mps == pytest.approx(2.0)


def test_without_a_direction_the_fork_holds_its_angle() -> None:
    controller = WheelController(LIMITS)
    controller.reset(0.3)
    assert controller.follow(DT, BodyVelocity(-0.01, 0.01), 0.3).steering_rad == 0.3
    assert controller.follow(DT, BodyVelocity(0.0, 0.03), 0.3).steering_rad == pytest.approx(0.33)


def test_a_goal_behind_brings_a_stop_and_never_a_reverse() -> None:
    controller = WheelController(LIMITS)
    controller.reset(0.0, 1.0)
    speeds = [controller.follow(DT, BodyVelocity(-2.0, 0.0), 0.0).speed_mps for _ in range(20)]
    assert speeds[0] == pytest.approx(0.92)
    assert speeds[-1] == 0.0


def test_stop_ramp_holds_the_fork_and_takes_speed_over_deceleration() -> None:
    controller = WheelController(LIMITS)
    controller.reset(0.2, 4.0)
    steps = 0
    while controller.stop(DT).speed_mps > 0.0:
        steps += 1
        assert controller.last.steering_rad == 0.2
    assert steps * DT == pytest.approx(4.0 / 8.0, abs=2 * DT)
