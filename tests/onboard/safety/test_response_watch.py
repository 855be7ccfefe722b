"""Feedback that leaves what the setpoints have asked for lately shows, a servo's lag does not."""

import math

import pytest

from onboard.canbus.drive.driver import MotorFeedback, MotorState
from onboard.control.steering import WheelSetpoint
from onboard.safety.observations import Response
from onboard.safety.response_watch import ResponseWatch

PERIOD_S = 0.01


def feedback(t_s: float, position: float | None, velocity: float | None) -> MotorFeedback:
    return MotorFeedback(
        MotorState.ACTIVE, "", (), position, velocity, t_s, t_s, current_a=None, bus_voltage_v=None
    )


def beyond(response: Response | None) -> float:
    assert response is not None
    return response.beyond


class Bench:
    """A wheel and a fork that answer their setpoints with a lag, unless told otherwise."""

    def __init__(self, lag_s: float) -> None:
        self.watch = ResponseWatch()
        self._share = 1.0 - math.exp(-PERIOD_S / lag_s)
        self.now_s, self.way_m, self.speed_mps, self.angle_rad = 0.0, 0.0, 0.0, 0.0

    def cycle(self, speed_mps: float, angle_rad: float) -> None:
        self.watch.ask(self.now_s, WheelSetpoint(angle_rad, speed_mps), powered=True)
        self.now_s += PERIOD_S
        self.speed_mps += self._share * (speed_mps - self.speed_mps)
        self.angle_rad += self._share * (angle_rad - self.angle_rad)
        self.way_m += PERIOD_S * self.speed_mps

    def wheel(self, scale: float = 1.0) -> Response | None:
        told = feedback(self.now_s, scale * self.way_m, scale * self.speed_mps)
        return self.watch.speed(told)


def test_a_lag_of_six_hundredths_is_no_error_in_ramps_and_swings() -> None:
    bench = Bench(lag_s=0.06)
    for tick in range(600):
        t_s = tick * PERIOD_S
        bench.cycle(min(2.0 * t_s, 1.0) if t_s < 3.0 else max(0.0, 1.0 - 4.0 * (t_s - 3.0)), 0.0)
        assert beyond(bench.wheel()) < 0.05
    for tick in range(300):
        bench.cycle(0.0, 0.3 * math.sin(tick * PERIOD_S * 4.0))
        angle = bench.watch.angle(feedback(bench.now_s, bench.angle_rad, 0.0), bench.angle_rad)
        assert beyond(angle) < 0.05


def test_a_wheel_that_does_not_turn_shows_once_the_setpoints_have_risen() -> None:
    bench = Bench(lag_s=0.03)
    found_s = None
    for tick in range(100):
        bench.cycle(min(2.0 * tick * PERIOD_S, 1.0), 0.0)
        if found_s is None and beyond(bench.wheel(scale=0.0)) > 0.2:
            found_s = tick * PERIOD_S
    assert found_s == pytest.approx(0.1 + 0.2, abs=0.02)


def test_a_speed_reported_too_high_shows_by_its_error() -> None:
    bench = Bench(lag_s=0.03)
    for _ in range(100):
        bench.cycle(1.0, 0.0)
        bench.wheel(scale=1.3)
    assert beyond(bench.wheel(scale=1.3)) == pytest.approx(0.3, abs=0.01)


def test_a_frozen_estimate_shows_although_its_speed_still_fits() -> None:
    bench = Bench(lag_s=0.03)
    for _ in range(100):
        bench.cycle(1.0, 0.0)
        bench.wheel()
    frozen = feedback(bench.now_s, bench.way_m, 1.0)
    for _ in range(11):
        bench.cycle(1.0, 0.0)
        frozen = feedback(bench.now_s, frozen.position, 1.0)
        response = bench.watch.speed(frozen)
    assert beyond(response) == pytest.approx(1.0, abs=0.01)


def test_either_measurement_of_the_fork_may_show_it() -> None:
    bench = Bench(lag_s=0.03)
    for _ in range(50):
        bench.cycle(0.0, 0.3)
    by_drive = bench.watch.angle(feedback(bench.now_s, 0.1, 0.0), 0.3)
    by_encoder = bench.watch.angle(feedback(bench.now_s, 0.3, 0.0), 0.1)
    assert beyond(by_drive) == beyond(by_encoder) == pytest.approx(0.2)


def test_powered_drives_without_setpoints_hold_still_and_unpowered_ones_owe_nothing() -> None:
    watch = ResponseWatch()
    watch.ask(0.0, None, powered=True)
    assert watch.speed(feedback(0.0, 0.0, -0.5)) == Response(-0.5, 0.0, 0.0)
    assert watch.angle(feedback(0.0, 1.0, 0.0), 1.0) is None
    watch.ask(0.01, None, powered=False)
    assert watch.speed(feedback(0.01, 0.0, -0.5)) is None


def test_what_is_no_number_is_left_to_the_drives_own_check() -> None:
    watch = ResponseWatch()
    watch.ask(0.0, WheelSetpoint(0.1, 1.0), powered=True)
    assert watch.speed(feedback(0.0, math.nan, math.nan)) is None
    assert beyond(watch.angle(feedback(0.0, math.nan, 0.0), 0.1)) == 0.0
