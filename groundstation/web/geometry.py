"""Where a follower is, from where its leader is and how it sees it; covariance ellipses."""

import math
from typing import NamedTuple

from config.angles import wrap
from config.fleet import Robot
from config.messages import PoseEstimate, RelativeEstimate

CHI_SQUARE_95 = 5.991464547107979
"""95 % of a normal distribution in the plane lie within this squared deviation."""

Matrix3 = tuple[float, float, float, float, float, float, float, float, float]


class Place(NamedTuple):
    """Front-wheel midpoint [m] and body heading [rad]."""

    x_m: float
    y_m: float
    heading_rad: float


class Ellipse(NamedTuple):
    """Half axes [m] and the direction of the longer one [rad]."""

    major_m: float
    minor_m: float
    direction_rad: float


def spread_of(pose: PoseEstimate) -> Matrix3:
    """Covariance of (x, y, heading) of a robot that localises itself, row by row."""
    c = pose.covariance
    return c[0], c[1], c[3], c[4], c[5], c[7], c[12], c[13], c[15]


def behind(leader: Place, seen: RelativeEstimate) -> Place:
    """The follower that sees its leader so."""
    heading = leader.heading_rad - seen.heading_rad
    away, rho = heading + seen.bearing_rad, seen.range_m
    return Place(
        leader.x_m - rho * math.cos(away), leader.y_m - rho * math.sin(away), wrap(heading)
    )


def spread_behind(leader: Place, spread: Matrix3, seen: RelativeEstimate) -> Matrix3:
    """The follower's covariance, linearised; both estimates count as independent."""
    away = leader.heading_rad - seen.heading_rad + seen.bearing_rad
    ux, uy, rho = math.cos(away), math.sin(away), seen.range_m
    # d(x, y, heading) by the leader's (x, y, heading) and by (range, bearing, alpha):
    by_leader = (1.0, 0.0, rho * uy, 0.0, 1.0, -rho * ux, 0.0, 0.0, 1.0)
    by_seen = (-ux, rho * uy, -rho * uy, -uy, -rho * ux, rho * ux, 0.0, 0.0, -1.0)
    c = seen.covariance
    relative = (c[0], c[1], c[2], c[4], c[5], c[6], c[8], c[9], c[10])
    return _sum(_carried(by_leader, spread), _carried(by_seen, relative))


def wanted_offset(robot: Robot, seen: RelativeEstimate | None) -> tuple[float, float] | None:
    """The robot's place in its leader's body axes [m], as it has it now or as the file says."""
    if seen is not None and seen.place_x_m is not None and seen.place_y_m is not None:
        return seen.place_x_m, seen.place_y_m
    return None if robot.offset is None else (robot.offset.x_m, robot.offset.y_m)


def seen_in_leader_axes(seen: RelativeEstimate) -> tuple[float, float]:
    """The follower's front point in its leader's body axes [m], as it believes."""
    direction = seen.bearing_rad - seen.heading_rad
    return -seen.range_m * math.cos(direction), -seen.range_m * math.sin(direction)


def ellipse_95(covariance: Matrix3) -> Ellipse:
    """The ellipse that holds a place with 95 %, from the covariance's (x, y) part."""
    xx, xy, yy = covariance[0], (covariance[1] + covariance[3]) / 2, covariance[4]
    middle, half = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    major, minor = (max(0.0, value) for value in (middle + half, middle - half))
    direction = 0.5 * math.atan2(2 * xy, xx - yy)
    scale = math.sqrt(CHI_SQUARE_95)
    return Ellipse(scale * math.sqrt(major), scale * math.sqrt(minor), direction)


def _carried(j: Matrix3, c: Matrix3) -> Matrix3:
    """J C J^T."""
    return _product(_product(j, c), (j[0], j[3], j[6], j[1], j[4], j[7], j[2], j[5], j[8]))


def _product(a: Matrix3, b: Matrix3) -> Matrix3:
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


def _sum(a: Matrix3, b: Matrix3) -> Matrix3:
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )
