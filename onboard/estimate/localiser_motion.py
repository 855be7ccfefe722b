"""Motion and measurement of the Gaussian localiser: mean, Jacobians and process noise.

States: x, y, eta, theta of (3), then what is constant but for a slow drift: the bearings' bias
[rad], the scale errors of speed and turn (a robot goes (1 + scale) times what its odometry says),
and the share of speed lost per rad/s that the fork turns, as wheels do that slip or saturate in
turns. The turn's scale error acts on eta' and turns fork and body alike.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config import fleet
from onboard.estimate.localiser import (
    STANDING_MPS,
    STANDING_NOISE,
    KnownRate,
    LandmarkBearing,
    Mounting,
)

Array = NDArray[np.float64]
Mean = tuple[float, float, float, float, float, float, float, float]

X, Y, FORK, HEADING, BIAS, SPEED, TURN, LOSS = range(8)
STATES = 8
NOISES = 10

SCALE_DRIFT = 0.01
"""Drift of bias and scale errors per square root of a second, as a share of their deviation."""

STANDING_RADPS = 0.01
"""A robot without speed stands while its fork turns no faster."""

_IDENTITY = np.eye(STATES)


class Rates(NamedTuple):
    """What the last step did per second; `*_gain` are derivatives by the steering angle [1/s]."""

    x_mps: float = 0.0
    y_mps: float = 0.0
    fork_radps: float = 0.0
    heading_radps: float = 0.0
    fork_gain: float = 0.0
    heading_gain: float = 0.0


class Input(NamedTuple):
    """What a robot knows of its motion over one step."""

    dt_s: float
    speed_mps: float
    rate_radps: float


def advance(
    mean: Mean, given: Input, wheelbase_m: float, kind: KnownRate
) -> tuple[Mean, Array, Rates]:
    """Midpoint step of (3): the mean after it, its Jacobian (8, 8), and the rates."""
    x, y, eta, theta, bias, speed_scale, turn_scale, turn_loss = mean
    dt, told, rate = given
    turns_with_body = kind == "steering"
    told_turn = abs(rate + (told * math.sin(eta - theta) / wheelbase_m if turns_with_body else 0.0))
    slip = 1.0 + speed_scale - turn_loss * told_turn
    speed = told * slip
    delta, shrink = eta - theta + rate * dt / 2, 1.0
    if not turns_with_body:
        half = speed * dt / (2 * wheelbase_m)
        shrink = 1.0 - half * math.cos(eta - theta)
        delta -= half * math.sin(eta - theta)
    by_scale = told * math.sin(delta) * dt / wheelbase_m
    yaw, gain = by_scale * slip, speed * math.cos(delta) * shrink * dt / wheelbase_m
    coupled = 1.0 if turns_with_body else 0.0
    turn = rate * dt + coupled * yaw
    fork_turn, body_turn = turn * (1.0 + turn_scale), yaw + turn * turn_scale
    fork_factor, body_factor = coupled * (1.0 + turn_scale), 1.0 + coupled * turn_scale
    middle = eta + fork_turn / 2
    east, north = speed * math.cos(middle), speed * math.sin(middle)
    f = _IDENTITY.copy()
    fork_gain = fork_factor * gain
    for row, forward, across in ((X, math.cos(middle), -north), (Y, math.sin(middle), east)):
        across *= dt
        f[row, FORK] = across * (1.0 + fork_gain / 2)
        f[row, HEADING] = -across * fork_gain / 2
        f[row, SPEED] = told * dt * forward + across * fork_factor * by_scale / 2
        f[row, TURN] = across * turn / 2
    for row, factor in ((FORK, fork_factor), (HEADING, body_factor)):
        f[row, FORK] += factor * gain
        f[row, HEADING] -= factor * gain
        f[row, SPEED] = factor * by_scale
        f[row, TURN] = turn
    f[:BIAS, LOSS] = -told_turn * f[:BIAS, SPEED]
    moved = (
        x + east * dt,
        y + north * dt,
        eta + fork_turn,
        theta + body_turn,
        bias,
        speed_scale,
        turn_scale,
        turn_loss,
    )
    if dt == 0.0:
        return moved, f, Rates(east, north)
    rates = Rates(
        east, north, fork_turn / dt, body_turn / dt, fork_gain / dt, body_factor * gain / dt
    )
    return moved, f, rates


def stands(given: Input) -> bool:
    """Neither moves nor turns its fork."""
    return abs(given.speed_mps) < STANDING_MPS and abs(given.rate_radps) < STANDING_RADPS


def noise_rows(settings: fleet.Localiser, given: Input, rates: Rates, rows: Array) -> None:
    """Write the process noise of one step into `rows` (10, 8): Q is rows^T rows."""
    share = math.sqrt(given.dt_s) * (STANDING_NOISE if stands(given) else 1.0)
    rows[0, X] = rows[1, Y] = settings.position_noise_m * share
    rows[2, FORK] = rows[3, HEADING] = settings.heading_noise_rad * share
    path_m = math.hypot(rates.x_mps, rates.y_mps) * given.dt_s
    if path_m > 0.0:
        along = settings.travel_noise_m * given.dt_s / math.sqrt(path_m)
        rows[4, X], rows[4, Y] = along * rates.x_mps, along * rates.y_mps
    else:
        rows[4] = 0.0
    turn = settings.turn_noise_rad * math.sqrt(abs(rates.fork_radps) * given.dt_s)
    rows[5, FORK] = rows[5, HEADING] = turn
    drift = SCALE_DRIFT * math.sqrt(given.dt_s)
    rows[6, BIAS] = settings.bias_std_rad * drift
    rows[7, SPEED] = settings.speed_scale_std * drift
    rows[8, TURN] = settings.turn_scale_std * drift
    rows[9, LOSS] = settings.turn_loss_std * drift


def predicted_bearing(
    mean: Mean,
    rates: Rates,
    seen: LandmarkBearing,
    landmark: tuple[float, float],
    mounting: Mounting,
) -> tuple[float, Array]:
    """Bearing (5) at its capture, not wrapped, and its gradient (8,) by the present state."""
    age = seen.age_s
    east = landmark[0] - mean[X] + age * rates.x_mps
    north = landmark[1] - mean[Y] + age * rates.y_mps
    # A landmark at the robot's own place has no bearing: a centimetre keeps the gradient finite.
    square = max(east * east + north * north, 1e-4)
    by_east, by_north = north / square, -east / square
    by_fork = age * (by_east * rates.y_mps - by_north * rates.x_mps)
    if mounting == "fork":
        axis = mean[FORK] - age * rates.fork_radps
        gain, own_fork, own_heading = rates.fork_gain, -1.0, 0.0
    else:
        axis = mean[HEADING] - age * rates.heading_radps
        gain, own_fork, own_heading = rates.heading_gain, 0.0, -1.0
    gradient = np.array(
        (
            by_east,
            by_north,
            by_fork + own_fork + age * gain,
            own_heading - age * gain,
            1.0,
            0.0,
            0.0,
            0.0,
        )
    )
    return math.atan2(north, east) - axis + mean[BIAS], gradient
