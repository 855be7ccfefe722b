"""The truth against closed forms of the paper's model (3)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_hw.vehicle import Vehicle

WHEELBASE_M = 0.25
STEP_S = 0.001


def rolling(speed_mps: float, steering_rad: float, heading_rad: float = 0.0) -> Vehicle:
    vehicle = Vehicle(WHEELBASE_M, 0.0, 0.0, heading_rad)
    vehicle.speed_mps = speed_mps
    vehicle.steering_rad = steering_rad
    return vehicle


def test_a_straight_wheel_drives_a_straight_line() -> None:
    vehicle = rolling(2.0, 0.0, heading_rad=0.3)
    for _ in range(5000):
        vehicle.step(2.0, 0.0, STEP_S)
    assert (vehicle.x_m, vehicle.y_m) == pytest.approx((10 * math.cos(0.3), 10 * math.sin(0.3)))
    assert vehicle.heading_rad == 0.3


@given(steering_rad=st.floats(0.05, 1.5), speed_mps=st.floats(0.1, 6.0))
def test_a_held_wheel_drives_a_circle_of_radius_d_over_sine(
    steering_rad: float, speed_mps: float
) -> None:
    vehicle = rolling(speed_mps, steering_rad)
    radius_m = WHEELBASE_M / math.sin(steering_rad)
    centre = (-radius_m * math.sin(steering_rad), radius_m * math.cos(steering_rad))
    for _ in range(1000):
        vehicle.step(speed_mps, steering_rad, STEP_S)
    distance_m = math.dist(centre, (vehicle.x_m, vehicle.y_m))
    assert distance_m == pytest.approx(radius_m, rel=2e-4)
    assert vehicle.heading_rad == pytest.approx(speed_mps * 1.0 / radius_m)


def test_the_wheel_pivots_about_the_rear_axle_at_a_right_angle() -> None:
    vehicle = rolling(1.0, math.pi / 2)
    for _ in range(1000):
        vehicle.step(1.0, math.pi / 2, STEP_S)
    rear_x_m = vehicle.x_m - WHEELBASE_M * math.cos(vehicle.heading_rad)
    rear_y_m = vehicle.y_m - WHEELBASE_M * math.sin(vehicle.heading_rad)
    assert (rear_x_m, rear_y_m) == pytest.approx((-WHEELBASE_M, 0.0), abs=1e-5)


def test_the_fork_keeps_its_direction_when_the_steering_angle_falls_with_the_yaw_rate() -> None:
    """delta' = -v sin(delta) / d has the solution
    tan(delta / 2) = tan(delta0 / 2) exp(-v t / d)."""
    speed_mps, start_rad = 0.5, 1.0
    vehicle = rolling(speed_mps, start_rad)
    for step in range(1, 1001):
        decay = math.exp(-speed_mps * step * STEP_S / WHEELBASE_M)
        vehicle.step(speed_mps, 2 * math.atan(math.tan(start_rad / 2) * decay), STEP_S)
    assert vehicle.heading_rad + vehicle.steering_rad == pytest.approx(start_rad, abs=1e-6)
    assert vehicle.x_m == pytest.approx(0.5 * math.cos(start_rad), abs=1e-6)
    assert vehicle.y_m == pytest.approx(0.5 * math.sin(start_rad), abs=1e-6)


def test_halving_the_step_quarters_the_error() -> None:
    def end(steps: int) -> tuple[float, float]:
        dt_s = 1.0 / steps
        vehicle = rolling(0.0, 0.0)
        for step in range(1, steps + 1):
            t_s = step * dt_s
            vehicle.step(3.0 * t_s, 0.8 * math.sin(3.0 * t_s), dt_s)
        return vehicle.x_m, vehicle.y_m

    exact = end(40_000)
    ratio = math.dist(end(100), exact) / math.dist(end(200), exact)
    assert ratio == pytest.approx(4.0, rel=0.1)
