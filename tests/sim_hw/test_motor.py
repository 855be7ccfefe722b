"""The motor against the step response of a first-order lag."""

import math

import pytest

from sim_hw.motor import Motor

DT_S = 0.001


def test_velocity_rises_exponentially_towards_its_target() -> None:
    motor = Motor(lag_s=0.03)
    for _ in range(30):
        motor.track_velocity(10.0, 20.0, DT_S)
    assert motor.velocity_rps == pytest.approx(10.0 * (1 - math.exp(-1)))
    assert motor.position_rev == pytest.approx(10.0 * 0.03 * math.exp(-1), rel=1e-3)


def test_velocity_stays_within_the_limit_of_the_drive() -> None:
    motor = Motor(lag_s=0.03)
    for _ in range(1000):
        motor.track_velocity(-50.0, 5.0, DT_S)
    assert motor.velocity_rps == pytest.approx(-5.0)


def test_position_approaches_its_target_exponentially_when_the_way_is_short() -> None:
    motor = Motor(lag_s=0.05)
    for _ in range(50):
        motor.track_position(0.1, 100.0, DT_S)
    assert motor.position_rev == pytest.approx(0.1 * (1 - math.exp(-1)))


def test_position_moves_at_the_limit_when_the_way_is_long() -> None:
    motor = Motor(lag_s=0.05)
    for _ in range(100):
        motor.track_position(-10.0, 2.0, DT_S)
    assert motor.position_rev == pytest.approx(-0.2)
    assert motor.velocity_rps == -2.0


def test_friction_stops_a_coasting_wheel_after_v_squared_over_two_a() -> None:
    motor = Motor(lag_s=0.03, friction_rps2=4.0)
    motor.velocity_rps = -2.0
    for _ in range(1000):
        motor.coast(DT_S)
    assert motor.velocity_rps == 0.0
    assert motor.position_rev == pytest.approx(-(2.0**2) / (2 * 4.0), abs=1e-6)


def test_a_gear_that_holds_stands_still_without_power() -> None:
    motor = Motor(lag_s=0.03)
    motor.track_position(1.0, 100.0, DT_S)
    for _ in range(2):
        motor.coast(DT_S)
    resting_rev = motor.position_rev
    motor.coast(DT_S)
    assert motor.position_rev == resting_rev
    assert motor.velocity_rps == 0.0


def test_a_mechanical_stop_ends_the_movement() -> None:
    motor = Motor(lag_s=0.01, stop_rev=0.5)
    for _ in range(500):
        motor.track_position(-2.0, 10.0, DT_S)
    assert motor.position_rev == -0.5
    assert motor.velocity_rps == 0.0
