"""The leader's reference drives the paper's mission."""

import math
from collections.abc import Callable

import pytest

from config.fleet import Limits, Mission, Segment
from onboard.control.schedule import LeaderReference, VelocityPlan
from onboard.model.vehicle import VehicleState, WheelMotion, fork_rate, front_drive_rates, step_rk4

WHEELBASE = 0.25
PAPER = Mission(
    segments=[
        Segment(duration_s=4.0, speed_mps=4.0, fork_rate_radps=-math.pi / 3),
        Segment(duration_s=3.0, speed_mps=4.0, fork_rate_radps=math.pi / 3),
        Segment(duration_s=2.0, speed_mps=4.0, fork_rate_radps=0.0),
    ]
)


def limits(acceleration: float = 8.0, steering: float = 0.6) -> Limits:
    return Limits(
        speed_mps=5.0,
        acceleration_mps2=acceleration,
        deceleration_mps2=8.0,
        steering_rad=steering,
        steering_rate_radps=6.0,
    )


def test_the_plan_is_the_papers_schedule() -> None:
    plan = VelocityPlan(PAPER)
    assert plan.duration_s == 9.0
    assert plan.at(0.0) == (4.0, -math.pi / 3)
    assert plan.at(3.999) == (4.0, -math.pi / 3)
    assert plan.at(4.0) == (4.0, math.pi / 3)
    assert plan.at(8.999) == (4.0, 0.0)


def test_outside_the_mission_the_plan_stands_still() -> None:
    plan = VelocityPlan(PAPER)
    assert plan.at(-0.001) == plan.at(9.0) == plan.at(100.0) == (0.0, 0.0)


def test_steering_stays_at_the_angle_that_turns_the_fork_as_planned() -> None:
    reference = LeaderReference(VelocityPlan(PAPER), limits(1e6), WHEELBASE)
    angles = [reference.step(0.01).steering_rad for _ in range(390)]
    needed = math.asin(math.pi / 3 * WHEELBASE / 4.0)
    assert angles[-1] == pytest.approx(-needed, abs=1e-6)
    assert max(abs(a) for a in angles) <= needed + 1e-3


def model(speed: float, rate: float) -> Callable[[VehicleState], VehicleState]:
    return lambda state: front_drive_rates(state, speed, rate, WHEELBASE)


def test_following_the_reference_drives_the_papers_path() -> None:
    """Steering as the reference says it, the fork turns in the world as the plan says it."""
    reference = LeaderReference(VelocityPlan(PAPER), limits(1e6), WHEELBASE)
    reached = ideal = VehicleState(0.0, 0.0, math.pi / 4, math.pi / 4)
    previous = 0.0
    for i in range(900):
        steering = reference.step(0.01).steering_rad
        for part in range(10):
            delta = previous + (steering - previous) * (part + 0.5) / 10
            rate = fork_rate((steering - previous) / 0.01, WheelMotion(4.0, delta), WHEELBASE)
            reached = step_rk4(model(4.0, rate), reached, 0.001)
        planned = -math.pi / 3 if i < 400 else math.pi / 3 if i < 700 else 0.0
        ideal = step_rk4(model(4.0, planned), ideal, 0.01)
        previous = steering
    assert math.dist(reached[:2], ideal[:2]) < 0.01
    assert reached.heading_rad == pytest.approx(ideal.heading_rad, abs=1e-3)


def test_the_speed_ramps_up_and_down_within_the_limits_and_then_the_mission_has_ended() -> None:
    reference = LeaderReference(VelocityPlan(PAPER), limits(), WHEELBASE)
    speeds = []
    while not reference.ended:
        speeds.append(reference.step(0.01).speed_mps)
    assert speeds[0] == pytest.approx(0.08)
    assert max(speeds) == 4.0
    assert speeds[-1] == 0.0
    assert reference.time_s == pytest.approx(9.5, abs=0.02)


def test_a_steering_limit_clips_the_reference() -> None:
    reference = LeaderReference(VelocityPlan(PAPER), limits(steering=0.03), WHEELBASE)
    assert min(reference.step(0.01).steering_rad for _ in range(400)) == -0.03
