"""The window's Gramian against finite differences of bearings along a driven path."""

import math
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest

from onboard.model.vehicle import WheelMotion
from onboard.model.window_gramian import (
    ENCODER_STD_RAD,
    PATH_START,
    Look,
    carried_on,
    weakness,
    window_gramian,
)

WHEELBASE_M, DT_S, STD_RAD = 0.25, 0.005, 0.05
LANDMARKS = {1: (4.0, 1.0), 2: (-1.0, 3.0)}
END = (0.7, -0.4, 0.9, 0.25)  # x, y, theta, delta at the window's end
RATES = [0.6 * math.sin(0.02 * i) for i in range(200)]
SPEED_MPS = 1.2


def _backwards(end: tuple[float, ...]) -> list[tuple[float, ...]]:
    """States from the end to the beginning under the known inputs, by small midpoint steps."""
    states = [end]
    for rate in reversed(RATES):
        x, y, theta, delta = states[-1]
        delta_m = delta - rate * DT_S / 2
        theta_m = theta - SPEED_MPS * math.sin(delta_m) / WHEELBASE_M * DT_S / 2
        states.append(
            (
                x - SPEED_MPS * math.cos(theta_m + delta_m) * DT_S,
                y - SPEED_MPS * math.sin(theta_m + delta_m) * DT_S,
                theta - SPEED_MPS * math.sin(delta_m) / WHEELBASE_M * DT_S,
                delta - rate * DT_S,
            )
        )
    return states[::-1]


LOOKS_AT = range(0, 201, 20)


def _bearings(end: tuple[float, ...], fork: bool) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    path = _backwards(end)
    return np.array(
        [
            math.atan2(my - path[i][1], mx - path[i][0]) - path[i][2] - fork * path[i][3]
            for i in LOOKS_AT
            for mx, my in LANDMARKS.values()
        ]
    )


@pytest.mark.parametrize("mounting", ["body", "fork"])
def test_gramian_is_that_of_finite_differences(mounting: Literal["body", "fork"]) -> None:
    fork, step = mounting == "fork", 1e-5
    columns = []
    for axis in range(4):
        shift = [step * (i == axis) for i in range(4)]
        more = tuple(value + s for value, s in zip(END, shift, strict=True))
        less = tuple(value - s for value, s in zip(END, shift, strict=True))
        columns.append((_bearings(more, fork) - _bearings(less, fork)) / (2 * step))
    rows = np.column_stack(columns)
    wanted = rows.T @ rows / STD_RAD**2
    wanted[3, 3] += 1 / ENCODER_STD_RAD**2

    path = _backwards(END)
    point, points = PATH_START, [PATH_START]
    for before, after in pairwise(path):
        middle = WheelMotion(SPEED_MPS, (before[3] + after[3]) / 2)
        point = carried_on(point, middle, WHEELBASE_M, DT_S)
        points.append(point)
    looks = [Look(points[i], dict.fromkeys(LANDMARKS, 1 / STD_RAD**2)) for i in LOOKS_AT]
    found = window_gramian(looks, point, (END[0], END[1]), END[2], LANDMARKS, mounting)
    assert found == pytest.approx(wanted, rel=2e-3, abs=1e-2 * float(np.abs(wanted).max()) ** 0.5)


def test_rotation_about_the_only_landmark_stays_exactly_unseen() -> None:
    point, looks = PATH_START, []
    for i in range(400):
        point = carried_on(point, WheelMotion(1.0, 0.2 * math.sin(i / 50)), WHEELBASE_M, 0.01)
        if i % 25 == 0:
            looks.append(Look(point, {1: 1e4}))
    weakest = weakness(window_gramian(looks, point, (0.3, 0.2), -1.0, {1: (6.0, 2.0)}, "body"))
    assert weakest.std_m is None
    assert weakest.blind == 1
    x, y, theta, delta = weakest.direction
    assert (x / theta, y / theta) == pytest.approx((2.0 - 0.2, -(6.0 - 0.3)), abs=1e-4)
    assert delta == pytest.approx(0.0, abs=1e-6)


def test_a_landmark_at_the_robot_and_a_lost_pose_break_nothing() -> None:
    looks = [Look(PATH_START, {1: 1e4})]
    at_it = window_gramian(looks, PATH_START, (6.0, 2.0), 0.0, {1: (6.0, 2.0)}, "body")
    assert np.isfinite(at_it).all()
    lost = window_gramian(looks, PATH_START, (math.nan, 2.0), 0.0, {1: (6.0, 2.0)}, "body")
    assert weakness(lost).std_m is None
