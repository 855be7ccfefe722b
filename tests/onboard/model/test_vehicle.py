"""The vehicle models against closed forms and independent integration."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.model.vehicle import (
    AxleMotion,
    RearAxleState,
    VehicleState,
    WheelMotion,
    axle_motion,
    displacement,
    fork_rate,
    front_drive_rates,
    rear_drive_rates,
    steering_rate,
    step_midpoint,
    step_rk4,
    wheel_motion,
)

WHEELBASE = 0.25

speeds = st.floats(0.05, 6.0)
steerings = st.floats(-1.5, 1.5)


def front_model(speed: float, rate: float) -> Callable[[VehicleState], VehicleState]:
    return lambda state: front_drive_rates(state, speed, rate, WHEELBASE)


def rear_model(speed: float, rate: float) -> Callable[[RearAxleState], RearAxleState]:
    return lambda state: rear_drive_rates(state, speed, rate, WHEELBASE)


def drive(state: VehicleState, speed: float, rate: float, time: float, steps: int) -> VehicleState:
    dt = time / steps
    for _ in range(steps):
        state = step_rk4(front_model(speed, rate), state, dt)
    return state


def test_both_wheels_roll_without_slipping() -> None:
    state = VehicleState(1.0, 2.0, 0.9, 0.4)
    rate = front_drive_rates(state, 2.0, 0.3, WHEELBASE)
    rear_x = rate.x_m + WHEELBASE * math.sin(0.4) * rate.heading_rad
    rear_y = rate.y_m - WHEELBASE * math.cos(0.4) * rate.heading_rad
    assert rate.x_m * math.sin(0.9) - rate.y_m * math.cos(0.9) == pytest.approx(0.0)  # paper (1)
    assert rear_x * math.sin(0.4) - rear_y * math.cos(0.4) == pytest.approx(0.0)  # paper (2)


def test_constant_steering_drives_the_front_point_on_its_circle() -> None:
    steering, speed = 0.4, 2.0
    radius = WHEELBASE / math.sin(steering)
    period = math.tau * radius / speed
    turning = speed * math.sin(steering) / WHEELBASE
    start = VehicleState(0.0, 0.0, steering, 0.0)
    half = drive(start, speed, turning, period / 2, 400)
    assert math.hypot(half.x_m, half.y_m) == pytest.approx(2 * radius, rel=1e-6)
    whole = drive(start, speed, turning, period, 800)
    assert (whole.x_m, whole.y_m) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_front_and_rear_models_describe_the_same_car() -> None:
    speed, motor_rate, dt = 1.5, 0.7, 1e-3
    rear = RearAxleState(0.0, 0.0, 0.2, 0.3)
    front = VehicleState(WHEELBASE * math.cos(0.2), WHEELBASE * math.sin(0.2), 0.5, 0.2)
    for _ in range(500):
        motion = WheelMotion(speed, rear.steering_rad + motor_rate * dt / 2)
        axle_speed = axle_motion(motion, WHEELBASE).speed_mps
        omega = fork_rate(motor_rate, motion, WHEELBASE)
        rear = step_rk4(rear_model(axle_speed, motor_rate), rear, dt)
        front = step_rk4(front_model(speed, omega), front, dt)
    assert front.x_m == pytest.approx(rear.x_m + WHEELBASE * math.cos(rear.heading_rad), abs=1e-6)
    assert front.y_m == pytest.approx(rear.y_m + WHEELBASE * math.sin(rear.heading_rad), abs=1e-6)
    assert front.heading_rad == pytest.approx(rear.heading_rad, abs=1e-6)


def test_with_fork_rate_zero_the_fork_keeps_its_direction_and_the_steering_decays() -> None:
    end = drive(VehicleState(0.0, 0.0, 0.5, 0.0), 1.0, 0.0, 2.5, 500)
    assert end.fork_rad == 0.5
    assert abs(end.fork_rad - end.heading_rad) < 1e-4


def test_midpoint_is_second_order_and_far_better_than_euler() -> None:
    def path_error(dt: float) -> float:
        state = VehicleState(0.0, 0.0, 0.0, 0.0)
        for _ in range(round(7.0 / dt)):
            state = step_midpoint(front_model(4.0, math.pi / 3), state, dt)
        radius, turned = 4.0 / (math.pi / 3), math.pi / 3 * 7.0
        exact = (radius * math.sin(turned), radius * (1.0 - math.cos(turned)))
        return math.dist((state.x_m, state.y_m), exact)

    assert path_error(0.01) < 1e-4
    assert path_error(0.01) / path_error(0.005) == pytest.approx(4.0, rel=0.1)


def test_at_a_right_angle_the_robot_pivots_about_its_rear_wheel() -> None:
    motion = axle_motion(WheelMotion(1.0, math.pi / 2), WHEELBASE)
    assert motion == pytest.approx((0.0, 4.0), abs=1e-12)


@given(speed=speeds, steering=steerings)
def test_wheel_and_axle_motion_are_inverse(speed: float, steering: float) -> None:
    back = wheel_motion(axle_motion(WheelMotion(speed, steering), WHEELBASE), WHEELBASE)
    assert back == pytest.approx((speed, steering), abs=1e-9)


@given(u=st.floats(-5, 5), r=st.floats(-9, 9))
def test_axle_and_wheel_motion_are_inverse(u: float, r: float) -> None:
    back = axle_motion(wheel_motion(AxleMotion(u, r), WHEELBASE), WHEELBASE)
    assert back == pytest.approx((u, r), abs=1e-9)


@given(rate=st.floats(-5, 5), speed=speeds, steering=steerings)
def test_fork_rate_and_steering_rate_are_inverse(
    rate: float, speed: float, steering: float
) -> None:
    motion = WheelMotion(speed, steering)
    assert steering_rate(fork_rate(rate, motion, WHEELBASE), motion, WHEELBASE) == pytest.approx(
        rate, abs=1e-9
    )


@given(speed=st.floats(-4, 4), steering=steerings, dt=st.floats(-0.03, 0.03))
def test_displacement_agrees_with_fine_integration(
    speed: float, steering: float, dt: float
) -> None:
    turning = speed * math.sin(steering) / WHEELBASE
    end = drive(VehicleState(0.0, 0.0, steering, 0.0), speed, turning, dt, 20)
    step = displacement(WheelMotion(speed, steering), WHEELBASE, dt)
    chord_error = abs(speed * dt) * (turning * dt) ** 2 / 24
    assert math.hypot(step.forward_m - end.x_m, step.left_m - end.y_m) <= chord_error + 1e-9
    assert step.turn_rad == pytest.approx(end.heading_rad, abs=1e-9)
