"""Local observability Gramian of a robot's last seconds among landmarks.

Where the Lie-derivative rank says what could be told apart, the Gramian of a window says how well
the bearings that came in did it. Errors of the present state (x, y, theta, delta) are carried back
along the driven path with the inputs of the hardware, speed and d delta/dt, taken as exact; every
bearing of (5) then adds its row. Since the path is the odometry's own, hung on the present pose,
what the geometry cannot see (rotation about a single landmark) stays exactly unseen.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.model.vehicle import WheelMotion, displacement

Array = NDArray[np.float64]

ENCODER_STD_RAD = 0.01
"""Error of the steering encoder; it does not average out within a window."""

UNBOUNDED_M = 1e3
"""A deviation beyond this counts as: the window says nothing."""

NEAREST_M = 0.05
"""A landmark believed nearer than this counts as this far away."""


class PathPoint(NamedTuple):
    """A place on the dead-reckoned path, and what an error of the steering angle does up to it.

    A constant error of the steering angle turns the heading by `lever` times itself and moves the
    place by (`bend_x`, `bend_y`) times itself, counted from the path's beginning.
    """

    x_m: float
    y_m: float
    heading_rad: float
    lever: float
    bend_x_m: float
    bend_y_m: float


PATH_START = PathPoint(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def carried_on(point: PathPoint, motion: WheelMotion, wheelbase_m: float, dt_s: float) -> PathPoint:
    """The path after `dt_s` more, by the midpoint rule on (3)."""
    x_m, y_m, heading_rad, lever, bend_x_m, bend_y_m = point
    forward_m, left_m, turn_rad = displacement(motion, wheelbase_m, dt_s)
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    dx_m, dy_m = c * forward_m - s * left_m, s * forward_m + c * left_m
    gain = motion.speed_mps * math.cos(motion.steering_rad) / wheelbase_m * dt_s
    middle = 1.0 + lever + gain / 2
    return PathPoint(
        x_m + dx_m,
        y_m + dy_m,
        heading_rad + turn_rad,
        lever + gain,
        bend_x_m - middle * dy_m,
        bend_y_m + middle * dx_m,
    )


class Look(NamedTuple):
    """Bearings taken around one place of the path: information [1/rad^2] by landmark."""

    at: PathPoint
    information: Mapping[int, float]


class Weakness(NamedTuple):
    """The direction of the present state that a window tells least about.

    `std_m` is its standard deviation from the window alone, one radian counting as one metre; None
    where the window says nothing. `singular_value` [1/m^2] is the Gramian's smallest, `blind` the
    number of directions about which it says nothing, and `direction` the unit vector (x, y, theta,
    delta) in world axes.
    """

    std_m: float | None
    singular_value: float
    blind: int
    direction: tuple[float, float, float, float]


def window_gramian(
    looks: Sequence[Look],
    here: PathPoint,
    place_m: tuple[float, float],
    heading_rad: float,
    landmarks: Mapping[int, tuple[float, float]],
    mounting: Literal["body", "fork"],
) -> Array:
    """Information on (x, y, theta, delta) at the path's end `here`, 4 x 4, world axes.

    The path's end is hung on the robot's present place and heading.
    """
    gramian: Array = np.zeros((4, 4))
    gramian[3, 3] = 1.0 / ENCODER_STD_RAD**2
    sights = [
        (row, *landmarks[mark], weight)
        for row, look in enumerate(looks)
        for mark, weight in look.information.items()
    ]
    if sights:
        index, mark_x, mark_y, weight = np.array(sights).T
        px, py, bx, by, back = _back_to(looks, here, heading_rad)[:, index.astype(np.intp)]
        dx, dy = px + (place_m[0] - mark_x), py + (place_m[1] - mark_y)
        square = np.maximum(dx * dx + dy * dy, NEAREST_M**2)
        nx, ny = -dy / square, dx / square
        fork = 1.0 if mounting == "fork" else 0.0
        rows = np.stack((nx, ny, ny * px - nx * py - 1.0, nx * bx + ny * by - back - fork))
        gramian += (rows * weight) @ rows.T
    return gramian


def _back_to(looks: Sequence[Look], here: PathPoint, heading_rad: float) -> Array:
    """From the path's end back to every look, columns, in world axes.

    Rows: the place (x, y); what a unit error of the steering angle at the end makes of the place
    (x, y) and of the heading.
    """
    x, y, _, lever, bend_x, bend_y = np.array([look.at for look in looks]).T
    px, py, back = x - here.x_m, y - here.y_m, lever - here.lever
    bx = bend_x - here.bend_x_m + here.lever * py
    by = bend_y - here.bend_y_m - here.lever * px
    turn = heading_rad - here.heading_rad
    c, s = math.cos(turn), math.sin(turn)
    return np.stack((c * px - s * py, s * px + c * py, c * bx - s * by, s * bx + c * by, back))


def weakness(gramian: Array) -> Weakness:
    """The weakest direction of a Gramian; one that is not finite says nothing of anything."""
    if not np.isfinite(gramian).all():
        return Weakness(None, 0.0, 4, (1.0, 0.0, 0.0, 0.0))
    values, vectors = np.linalg.eigh(gramian)
    least = max(float(values[0]), 0.0)
    x, y, theta, delta = vectors[:, 0].tolist()
    blind = int(np.sum(values * UNBOUNDED_M**2 < 1.0))
    return Weakness(None if blind else 1.0 / math.sqrt(least), least, blind, (x, y, theta, delta))
