"""The paper's scenario on the core alone: true motion and measurements, without buses or devices.

Truth is of the model class of (3) plus the stated noise. A leader runs the schedule open loop; a
`Car` is a robot with a steering lag that follows setpoints. Same seed, same truth.
"""

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config import fleet
from config.loader import load_fleet, shipped_fleet_path
from onboard.control.schedule import VelocityPlan
from onboard.control.steering import WheelSetpoint
from onboard.model.relative import RelativeState
from onboard.model.vehicle import (
    VehicleState,
    WheelMotion,
    front_drive_rates,
    steering_rate,
    step_midpoint,
)

Floats = NDArray[np.float64]
Mounting = Literal["body", "fork"]

DT_S = 0.01
"""Sampling time T_c of section 4.1."""


class Inputs(NamedTuple):
    """What a robot does over one step: front-wheel speed and d delta/dt."""

    speed_mps: float
    steering_rate_radps: float


class Planned(NamedTuple):
    """The inputs of (3) over one step: front-wheel speed and omega = d eta/dt."""

    speed_mps: float
    fork_rate_radps: float


class Truth(NamedTuple):
    """A leader's true states (steps + 1, 4): x, y, eta, theta; inputs[i] lead from i to i + 1."""

    states: Floats
    inputs: list[Planned]

    @property
    def time_s(self) -> Floats:
        """Time of every state [s], (steps + 1,)."""
        return np.linspace(0.0, DT_S * len(self.inputs), len(self.states))


@cache
def paper_fleet() -> fleet.Fleet:
    """The shipped fleet `paper`: section 4.1 as mathematics.md section 12 reads it.

    Read once per process, so that a long study does not change when the file does.
    """
    return load_fleet(shipped_fleet_path("paper")).fleet


def landmark_positions(source: fleet.Fleet, count: int) -> dict[int, tuple[float, float]]:
    """The first `count` landmarks by id: (x, y) [m]."""
    return {mark.id: (mark.x_m, mark.y_m) for mark in source.landmarks[:count]}


def schedule(mission: fleet.Mission) -> list[Planned]:
    """The mission as inputs of (3), per step."""
    plan = VelocityPlan(mission)
    steps = round(mission.duration_s / DT_S)
    return [Planned(*plan.at((step + 0.5) * DT_S)) for step in range(steps)]


def planned_inputs(mission: fleet.Mission, wheelbase_m: float) -> list[Inputs]:
    """The schedule as speed and steering rate per step, from a straight fork.

    omega of the schedule is d eta/dt, so the fork's angle follows delta' = omega - v sin(delta)/d.
    """
    delta, inputs = 0.0, []
    for speed, omega in schedule(mission):
        half = delta + DT_S / 2 * steering_rate(omega, WheelMotion(speed, delta), wheelbase_m)
        rate = steering_rate(omega, WheelMotion(speed, half), wheelbase_m)
        inputs.append(Inputs(speed, rate))
        delta += DT_S * rate
    return inputs


def leader_truth(
    source: fleet.Fleet, seed: int, noise_per_sqrt_s: float = 0.05, start_std: float = 0.05
) -> Truth:
    """Drive the mission once by (3): noise on all four states, start pose off by `start_std`.

    omega is the paper's, so the fork's direction follows the schedule but for its noise. The
    start's fork is straight, as the encoder says. Units: [m], [rad], per square root of 1 s.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    robot = next(robot for robot in source.robots.values() if robot.leader is None)
    wheelbase, inputs = robot.vehicle.wheelbase_m, schedule(source.mission)
    x, y, turn = (start_std * rng.standard_normal(3)).tolist()
    heading = robot.start.heading_rad + turn
    state = VehicleState(robot.start.x_m + x, robot.start.y_m + y, heading, heading)
    noise = noise_per_sqrt_s * math.sqrt(DT_S) * rng.standard_normal((len(inputs), 4))
    states = [state]
    for planned, shake in zip(inputs, noise.tolist(), strict=True):
        moved = step_midpoint(partial(_rates, *planned, wheelbase), state, DT_S)
        state = VehicleState._make([m + n for m, n in zip(moved, shake, strict=True)])
        states.append(state)
    return Truth(np.array(states), inputs)


def _rates(
    speed_mps: float, fork_rate_radps: float, wheelbase_m: float, state: VehicleState
) -> VehicleState:
    return front_drive_rates(state, speed_mps, fork_rate_radps, wheelbase_m)


def moved_by(state: VehicleState, inputs: Inputs, wheelbase_m: float, dt_s: float) -> VehicleState:
    """The hardware's form of (3) over one step by the midpoint rule: eta' = d delta/dt + theta'."""

    def rates(s: VehicleState) -> VehicleState:
        turning = inputs.speed_mps * math.sin(s.fork_rad - s.heading_rad) / wheelbase_m
        return VehicleState(
            inputs.speed_mps * math.cos(s.fork_rad),
            inputs.speed_mps * math.sin(s.fork_rad),
            inputs.steering_rate_radps + turning,
            turning,
        )

    return step_midpoint(rates, state, dt_s)


def true_bearings(
    states: Floats, landmarks: Sequence[tuple[float, float]], mounting: Mounting
) -> Floats:
    """Noise-free bearings (5) [rad], wrapped, (states, landmarks); states are (n, 4)."""
    marks = np.reshape(np.asarray(landmarks, dtype=np.float64), (-1, 2))
    axis = states[:, 2 if mounting == "fork" else 3]
    direction = np.arctan2(marks[:, 1] - states[:, 1:2], marks[:, 0] - states[:, 0:1])
    return wrapped(direction - axis[:, None])


def measured_bearings(true: Floats, seed: int, std_rad: float) -> Floats:
    """Bearings with white noise. A landmark's noise does not depend on how many others are seen."""
    columns = [
        np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, mark))).standard_normal(
            len(true)
        )
        for mark in range(true.shape[1])
    ]
    noise = np.column_stack(columns) if columns else np.zeros_like(true)
    return wrapped(true + std_rad * noise)


def wrapped(angles_rad: Floats) -> Floats:
    """Wrap angles [rad] into [-pi, pi)."""
    result: Floats = np.mod(angles_rad + math.pi, math.tau) - math.pi
    return result


class Car:
    """A robot's true motion: the fork follows its setpoint with a lag, the speed at once."""

    def __init__(self, start: fleet.Pose, wheelbase_m: float, steering_lag_s: float) -> None:
        self.state = VehicleState(start.x_m, start.y_m, start.heading_rad, start.heading_rad)
        self.speed_mps = 0.0
        self._wheelbase_m = wheelbase_m
        self._share = 1.0 - math.exp(-DT_S / steering_lag_s) if steering_lag_s > 0 else 1.0

    @property
    def motion(self) -> WheelMotion:
        """Speed now, and the fork's angle delta = eta - theta."""
        return WheelMotion(self.speed_mps, self.state.fork_rad - self.state.heading_rad)

    def drive(self, setpoint: WheelSetpoint) -> None:
        """One step of `DT_S` towards the setpoint."""
        rate = (setpoint.steering_rad - self.motion.steering_rad) * self._share / DT_S
        self.speed_mps = setpoint.speed_mps
        self.apply(Inputs(setpoint.speed_mps, rate))

    def apply(self, inputs: Inputs) -> None:
        """One step of `DT_S` with the inputs as they are."""
        self.speed_mps = inputs.speed_mps
        self.state = moved_by(self.state, inputs, self._wheelbase_m, DT_S)

    def place(self, point: fleet.Point) -> tuple[float, float]:
        """Where a point of the body is in the world [m]."""
        c, s = math.cos(self.state.heading_rad), math.sin(self.state.heading_rad)
        return (
            self.state.x_m + c * point.x_m - s * point.y_m,
            self.state.y_m + s * point.x_m + c * point.y_m,
        )

    def bearing_to(self, place: tuple[float, float]) -> float:
        """Bearing [rad] from the front point in the body frame, in (-pi, pi]."""
        direction = math.atan2(place[1] - self.state.y_m, place[0] - self.state.x_m)
        return math.remainder(direction - self.state.heading_rad, math.tau)


def relative_truth(follower: Car, leader: Car) -> RelativeState:
    """The leader's front point seen from the follower's, and the relative heading."""
    x, y = leader.state.x_m, leader.state.y_m
    return RelativeState(
        math.hypot(x - follower.state.x_m, y - follower.state.y_m),
        follower.bearing_to((x, y)),
        math.remainder(leader.state.heading_rad - follower.state.heading_rad, math.tau),
    )
