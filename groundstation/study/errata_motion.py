"""Errata of the vehicle's model, its input and its estimate, (3)-(9), (33) and section 4.1."""

import math
from collections.abc import Callable

import numpy as np

from config import fleet
from groundstation.study.effect import Effect
from groundstation.study.scenario import (
    DT_S,
    landmark_positions,
    leader_truth,
    measured_bearings,
    paper_fleet,
    planned_inputs,
    schedule,
    true_bearings,
    wrapped,
)
from onboard.estimate.localiser import LandmarkBearing
from onboard.estimate.localiser_particle import ParticleLocaliser
from onboard.model.vehicle import VehicleState, front_drive_rates, step_midpoint, step_rk4

Rates = Callable[[VehicleState], VehicleState]
Rule = Callable[[Rates, VehicleState, float], VehicleState]
WHEELBASE_M = 0.25
FINE = 10
JUDGED_FROM_S = 0.5


def euler() -> Effect:
    """Path of the leader by Euler's rule, against a tenth of the step by Runge-Kutta."""
    source = paper_fleet()
    return Effect(
        "euler",
        "(33) and section 4.1",
        "forward Euler at 10 ms",
        "midpoint rule",
        "largest error of the leader's path",
        "m",
        *(_path_error(source, rule) for rule in (_euler_step, step_midpoint)),
    )


def steering_rate_schedule() -> Effect:
    """The schedule's omega read as a steering motor's rate."""
    source = paper_fleet()
    rates = [planned.fork_rate_radps for planned in schedule(source.mission)]
    planned = [inputs.steering_rate_radps for inputs in planned_inputs(source.mission, WHEELBASE_M)]
    return Effect(
        "steering-rate-schedule",
        "section 4.1",
        "omega of the schedule as d delta/dt",
        "as d eta/dt",
        "largest steering angle",
        "rad",
        *(float(np.max(np.abs(np.cumsum(each)))) * DT_S for each in (rates, planned)),
    )


def arctan() -> Effect:
    """Bearings to the four landmarks along the path, by arctan of the quotient and by atan2."""
    source = paper_fleet()
    states = leader_truth(source, 1, 0.0, 0.0).states
    marks = list(landmark_positions(source, 4).values())
    dx, dy = (np.array(marks)[:, axis] - states[:, axis : axis + 1] for axis in (0, 1))
    direction = np.angle(dx + 1j * dy)
    readings = (np.arctan(dy / dx) - states[:, 2:3], true_bearings(states, marks, "fork"))
    errors = [np.abs(wrapped(each + states[:, 2:3] - direction)) for each in readings]
    return Effect(
        "arctan",
        "(5)",
        "arctan of the quotient",
        "atan2",
        "share of the bearings along the path that are off by pi",
        "%",
        *(100 * float(np.mean(error > 1.0)) for error in errors),
    )


def noise_per_step(seeds: int = 2) -> Effect:
    """The state noise of 0.05 taken per step by the filter; the plant has 0.05 per sqrt(s)."""
    return Effect(
        "noise-per-step",
        "section 4.1",
        "state noise 0.05 per step",
        "per square root of a second",
        f"leader's position RMSE, 4 landmarks, 500 particles, {seeds} seeds",
        "m",
        *(_localiser_rmse(noise, seeds) for noise in (0.05 / math.sqrt(DT_S), 0.05)),
    )


def _localiser_rmse(noise: float, seeds: int) -> float:
    """The particle filter with a process noise, over plants with that same noise."""
    source = paper_fleet()
    landmarks = landmark_positions(source, 4)
    robot = next(robot for robot in source.robots.values() if robot.leader is None)
    settings = fleet.Localiser(position_noise_m=noise, heading_noise_rad=noise)
    squares = []
    for seed in range(1, seeds + 1):
        truth = leader_truth(source, seed, noise)
        true = true_bearings(truth.states[1:], list(landmarks.values()), "fork")
        measured = measured_bearings(true, seed, 0.05)
        localiser = ParticleLocaliser(
            settings, WHEELBASE_M, "fork", landmarks, robot.start, seed, known_rate="fork"
        )
        for step, (inputs, row) in enumerate(zip(truth.inputs, measured.tolist(), strict=True)):
            localiser.predict(DT_S, inputs.speed_mps, inputs.fork_rate_radps)
            localiser.update(
                [LandmarkBearing(m, b, 0.05, 0.0) for m, b in zip(landmarks, row, strict=True)]
            )
            if (step + 1) * DT_S >= JUDGED_FROM_S:
                belief, (x, y, *_) = localiser.estimate(), truth.states[step + 1]
                squares.append((belief.x_m - x) ** 2 + (belief.y_m - y) ** 2)
    return math.sqrt(float(np.mean(squares)))


def _path_error(source: fleet.Fleet, rule: Rule) -> float:
    """Largest distance of the leader's path from that by Runge-Kutta in finer steps."""
    pose = source.robots["r1"].start
    start = VehicleState(pose.x_m, pose.y_m, pose.heading_rad, pose.heading_rad)
    coarse = fine = start
    worst = 0.0
    for speed, omega in schedule(source.mission):

        def rates(state: VehicleState, v: float = speed, w: float = omega) -> VehicleState:
            return front_drive_rates(state, v, w, WHEELBASE_M)

        coarse = rule(rates, coarse, DT_S)
        for _ in range(FINE):
            fine = step_rk4(rates, fine, DT_S / FINE)
        worst = max(worst, math.hypot(coarse.x_m - fine.x_m, coarse.y_m - fine.y_m))
    return worst


def _euler_step(rates: Rates, state: VehicleState, dt_s: float) -> VehicleState:
    """Forward Euler, as the paper integrates."""
    return VehicleState(*(x + dt_s * dx for x, dx in zip(state, rates(state), strict=True)))
