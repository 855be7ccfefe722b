"""The bound that a localiser is judged by: the Riccati recursion along the true path, section 10.

A Kalman filter linearised at the truth has this covariance whatever it measures, so no
first-order filter does better on average. Nothing of `onboard.estimate` is used: the Jacobians are
written down here a second time, so that a mistake in the filter cannot hide in its own bound.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rate = Literal["fork", "steering"]
Mounting = Literal["body", "fork"]


def motion_jacobian(
    state: Floats, speed_mps: float, wheelbase_m: float, dt_s: float, known_rate: Rate
) -> Floats:
    """d state(i + 1) / d state(i) of (3), (4, 4) in the order (x, y, eta, theta).

    `known_rate` is the input that the robot knows: d eta/dt (the paper) or d delta/dt (a motor).
    Second-order Taylor of the matrix exponential of the continuous Jacobian.
    """
    _, _, eta, theta = state.tolist()
    turn = speed_mps * math.cos(eta - theta) / wheelbase_m
    a = np.zeros((4, 4))
    a[0, 2], a[1, 2] = -speed_mps * math.sin(eta), speed_mps * math.cos(eta)
    a[3, 2], a[3, 3] = turn, -turn
    if known_rate == "steering":
        a[2, 2], a[2, 3] = turn, -turn
    step = a * dt_s
    return np.asarray(np.eye(4) + step + step @ step / 2)


def bearing_rows(
    state: Floats, landmarks: Sequence[tuple[float, float]], mounting: Mounting
) -> Floats:
    """Gradients of the bearings (5) by the state, (landmarks, 4); (19) divided by the range^2."""
    rows = np.zeros((len(landmarks), 4))
    for row, (x, y) in zip(rows, landmarks, strict=True):
        east, north = x - state[0], y - state[1]
        square = east * east + north * north
        row[0], row[1] = north / square, -east / square
        row[2 if mounting == "fork" else 3] = -1.0
    return rows


def riccati(
    states: Floats,
    speeds_mps: Sequence[float],
    landmarks: Sequence[tuple[float, float]],
    *,
    wheelbase_m: float,
    dt_s: float,
    process_std: float,
    bearing_std_rad: float,
    start_std: float,
    known_rate: Rate = "fork",
    mounting: Mounting = "fork",
) -> Floats:
    """Covariances (steps, 4, 4) of the best linearised filter after the bearings of each step.

    `states` is (steps + 1, 4), the true path; `process_std` is added to every state per step.
    The steering angle is known at the start, so the fork is as wrong as the heading there.
    """
    covariance: Floats = np.zeros((4, 4))
    covariance[0, 0] = covariance[1, 1] = start_std**2
    covariance[2:, 2:] = start_std**2
    noise = process_std**2 * np.eye(4)
    result = np.empty((len(speeds_mps), 4, 4))
    for i, speed in enumerate(speeds_mps):
        f = motion_jacobian(states[i], speed, wheelbase_m, dt_s, known_rate)
        covariance = f @ covariance @ f.T + noise
        rows = bearing_rows(states[i + 1], landmarks, mounting)
        if len(rows):
            information = np.linalg.inv(covariance) + rows.T @ rows / bearing_std_rad**2
            covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        result[i] = covariance
    return result


def position_variance(covariances: Floats) -> Floats:
    """Mean square position error [m^2] that each covariance of (..., 4, 4) stands for."""
    return np.asarray(covariances[..., 0, 0] + covariances[..., 1, 1])
