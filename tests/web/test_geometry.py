"""A follower's place on the map and its ellipse, judged by drawing many and by plain geometry."""

import math

import numpy as np
import pytest

from config.messages import RelativeEstimate
from groundstation.web.geometry import (
    Place,
    behind,
    ellipse_95,
    seen_in_leader_axes,
    spread_behind,
)
from tests.groundstation.synthetic import times

LEADER = Place(3.0, -1.0, 0.7)
LEADER_SPREAD = (4e-4, 1e-4, 2e-5, 1e-4, 9e-4, -1e-5, 2e-5, -1e-5, 1e-4)
RANGE_M, BEARING_RAD, ALPHA_RAD = 0.8, 0.6, -0.3
SPREAD = np.array([[1e-4, 2e-5, 0], [2e-5, 4e-4, 1e-5], [0, 1e-5, 2e-4]])


def seen() -> RelativeEstimate:
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = SPREAD
    return RelativeEstimate(
        **times(0),
        robot="r2",
        leader="r1",
        range_m=RANGE_M,
        bearing_rad=BEARING_RAD,
        heading_rad=ALPHA_RAD,
        speed_scale=0.0,
        covariance=covariance.ravel().tolist(),
        nis=1.0,
    )


def test_a_follower_is_placed_where_it_sees_its_leader_from() -> None:
    follower = behind(LEADER, seen())
    heading = follower.heading_rad
    assert heading == pytest.approx(LEADER.heading_rad - ALPHA_RAD)
    towards = heading + BEARING_RAD
    assert follower.x_m + RANGE_M * math.cos(towards) == pytest.approx(LEADER.x_m)
    assert follower.y_m + RANGE_M * math.sin(towards) == pytest.approx(LEADER.y_m)


def test_its_spread_is_that_of_many_drawn_at_random() -> None:
    rng = np.random.default_rng(1)
    leaders = rng.multivariate_normal(LEADER, np.reshape(LEADER_SPREAD, (3, 3)), 200_000)
    views = rng.multivariate_normal((RANGE_M, BEARING_RAD, ALPHA_RAD), SPREAD, 200_000)
    heading = leaders[:, 2] - views[:, 2]
    towards = heading + views[:, 1]
    x = leaders[:, 0] - views[:, 0] * np.cos(towards)
    y = leaders[:, 1] - views[:, 0] * np.sin(towards)
    drawn = np.cov(np.stack([x, y, heading]))
    told = np.reshape(spread_behind(LEADER, LEADER_SPREAD, seen()), (3, 3))
    assert np.abs(told - drawn).max() < 0.03 * np.abs(drawn).max()


def test_the_ellipse_holds_95_percent() -> None:
    covariance = spread_behind(LEADER, LEADER_SPREAD, seen())
    ellipse = ellipse_95(covariance)
    rng = np.random.default_rng(2)
    plane = np.reshape(covariance, (3, 3))[:2, :2]
    points = rng.multivariate_normal((0, 0), plane, 100_000)
    cos, sin = math.cos(ellipse.direction_rad), math.sin(ellipse.direction_rad)
    along, across = points @ [cos, sin], points @ [-sin, cos]
    inside = (along / ellipse.major_m) ** 2 + (across / ellipse.minor_m) ** 2 <= 1
    assert inside.mean() == pytest.approx(0.95, abs=0.003)


def test_a_place_in_the_leaders_axes_is_the_inverse_of_what_the_follower_sees() -> None:
    follower = behind(LEADER, seen())
    forward_m, left_m = seen_in_leader_axes(seen())
    cos, sin = math.cos(LEADER.heading_rad), math.sin(LEADER.heading_rad)
    x_m = LEADER.x_m + cos * forward_m - sin * left_m
    y_m = LEADER.y_m + sin * forward_m + cos * left_m
    assert (x_m, y_m) == pytest.approx((follower.x_m, follower.y_m))
