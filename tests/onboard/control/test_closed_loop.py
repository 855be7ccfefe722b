"""A leader and two followers on the paper's mission: filters, laws and servos together.

The plant has first-order drives, odometry scale errors, bearings 10 ms late and messages 20 ms old;
it shares no code with the emulated hardware.
"""

import math
import random
from collections import deque
from typing import Literal, NamedTuple

import pytest

from config.fleet import Formation, Limits, Mission, Point, RelativeFilter, Segment
from onboard.control.formation import desired_velocity
from onboard.control.schedule import LeaderReference, VelocityPlan
from onboard.control.steering import WheelController, WheelSetpoint
from onboard.estimate.beliefs import RelativePrior
from onboard.estimate.relative_ukf import RelativeUkf
from onboard.model.vehicle import WheelMotion
from tests.onboard.estimate.pair import DT, FRONT, REAR, STD, WHEELBASE, Body

OFFSET = Point(x_m=-0.318, y_m=-0.318)
RANGE, BEARING = math.hypot(0.318, 0.318), math.pi / 4
LAG_S = 0.03
MESSAGE_STEPS = 2


class Record(NamedTuple):
    """What one robot was and reported at one instant."""

    body: Body
    report: WheelMotion


class Plant:
    """One robot: its drives regulate what its own odometer shows."""

    def __init__(self, body: Body, scale_error: float, noise: random.Random) -> None:
        self.body = body
        self.past: deque[Record] = deque(maxlen=8)
        self._scale, self._noise = 1.0 + scale_error, noise
        self._speed = self._steering = 0.0

    def report(self) -> WheelMotion:
        """Odometer and encoder; remembered with the true pose."""
        encoder = self._steering + self._noise.gauss(0.0, 0.001)
        motion = WheelMotion(self._speed * self._scale, encoder)
        self.past.append(Record(Body(**vars(self.body)), motion))
        return motion

    def ago(self, steps: int) -> Record:
        return self.past[-1 - min(steps, len(self.past) - 1)]

    def drive(self, setpoint: WheelSetpoint) -> None:
        for _ in range(5):
            share = 1.0 - math.exp(-DT / 5 / LAG_S)
            self._steering += share * (setpoint.steering_rad - self._steering)
            self._speed += share * (setpoint.speed_mps / self._scale - self._speed)
            self.body.move(WheelMotion(self._speed, self._steering), DT / 5)


class Follower:
    """Filter, law and servo of one follower."""

    def __init__(self, formation: Formation, limits: Limits, noise: random.Random) -> None:
        prior = RelativePrior(RANGE, 0.1, BEARING, 0.2, 0.0, 0.2)
        self._filter = RelativeUkf.from_prior(RelativeFilter(), WHEELBASE, WHEELBASE, prior)
        self._controller = WheelController(limits)
        self._formation, self._noise = formation, noise

    def step(self, own: Plant, leader: Plant) -> WheelSetpoint:
        report, heard = own.past[-1].report, leader.ago(MESSAGE_STEPS).report
        self._filter.predict(DT, report, heard)
        here, there = own.ago(1).body, leader.ago(1).body
        was_here, was_there = own.ago(1 + MESSAGE_STEPS).body, leader.ago(1 + MESSAGE_STEPS).body
        for marker in (FRONT, REAR):
            seen = here.bearing(there.place(marker)) + self._noise.gauss(0.0, STD)
            self._filter.update_leader_marker(seen, STD, marker, DT)
            back = was_there.bearing(was_here.place(marker)) + self._noise.gauss(0.0, STD)
            self._filter.update_mutual(back, STD, marker, DT * (1 + MESSAGE_STEPS))
        wanted = desired_velocity(
            self._formation, OFFSET, self._filter.estimate(), heard, WHEELBASE, WHEELBASE
        )
        return self._controller.follow(DT, wanted, report.steering_rad)


class Errors(NamedTuple):
    """RMS of one follower."""

    position_m: float
    range_m: float
    bearing_rad: float


def errors_of(own: Body, leader: Body) -> Errors:
    x, y = leader.place(OFFSET)
    rho = math.hypot(leader.x - own.x, leader.y - own.y)
    phi = own.bearing((leader.x, leader.y))
    return Errors(
        math.hypot(x - own.x, y - own.y),
        rho - RANGE,
        math.remainder(phi - BEARING, math.tau),
    )


def mission(speed: float) -> Mission:
    pace = speed / 4.0
    rates = ((4.0, -math.pi / 3), (3.0, math.pi / 3), (2.0, 0.0))
    return Mission(
        segments=[
            Segment(duration_s=t / pace, speed_mps=speed, fork_rate_radps=w * pace)
            for t, w in rates
        ]
    )


def fly(
    law: Literal["leader_frame", "polar"], speed: float, gain: float, seed: int
) -> list[Errors]:
    """RMS errors of both followers over the last two thirds of the mission."""
    noise = random.Random(seed)
    limits = Limits(
        speed_mps=1.4 * speed,
        acceleration_mps2=max(2.0, 2 * speed),
        deceleration_mps2=max(2.0, 3 * speed),
        steering_rad=0.6,
        steering_rate_radps=4.0,
    )
    plan = VelocityPlan(mission(speed))
    reference = LeaderReference(plan, limits, WHEELBASE)
    bodies = [Body(0.0, 0.0, math.pi / 4)]
    for _ in range(2):
        x, y = bodies[-1].place(OFFSET)
        bodies.append(Body(x + noise.gauss(0, 0.03), y + noise.gauss(0, 0.03), math.pi / 4))
    plants = [Plant(b, e, noise) for b, e in zip(bodies, (0.01, -0.01, 0.01), strict=True)]
    formation = Formation(law=law, gain_per_s=gain)
    followers = [Follower(formation, limits, noise) for _ in range(2)]
    squares: list[list[Errors]] = [[], []]
    while reference.time_s < plan.duration_s:
        for plant in plants:
            plant.report()
        setpoints = [reference.step(DT)]
        for i, follower in enumerate(followers):
            setpoints.append(follower.step(plants[i + 1], plants[i]))
            if reference.time_s > plan.duration_s / 3:
                squares[i].append(errors_of(plants[i + 1].body, plants[i].body))
        for plant, setpoint in zip(plants, setpoints, strict=True):
            plant.drive(setpoint)
    return [Errors._make(map(rms, zip(*each, strict=True))) for each in squares]


def rms(values: tuple[float, ...]) -> float:
    return math.sqrt(sum(value * value for value in values) / len(values))


@pytest.mark.parametrize(("speed", "gain"), [(4.0, 4.0), (1.0, 1.5)])
def test_leader_frame_law_keeps_every_place_within_three_centimetres(
    speed: float, gain: float
) -> None:
    assert all(e.position_m < 0.03 for e in fly("leader_frame", speed, gain, seed=1))


@pytest.mark.parametrize(("speed", "gain"), [(4.0, 4.0), (1.0, 1.5)])
def test_polar_law_keeps_range_and_bearing(speed: float, gain: float) -> None:
    for e in fly("polar", speed, gain, seed=2):
        assert e.range_m < 0.03
        assert e.bearing_rad < 0.06
