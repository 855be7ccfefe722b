"""Process and measurement functions of the relative filters, on sigma points.

A point is (range, bearing, heading alpha, speed scale epsilon). A sigma point may have a negative
range: it stands for the place at |range| in the opposite direction, so no function here is
singular and the mean stays the only value that has to be kept positive.

Both robots' motions over a step are the chords of `onboard.model.vehicle.displacement`; composing
them is the midpoint integration of the corrected (29) without its division by the range. The
leader's chord and turn are those of its reported speed, multiplied by 1 + epsilon.
"""

from collections.abc import Iterable
from math import atan2, cos, hypot, sin
from typing import NamedTuple

from config import fleet
from onboard.estimate.beliefs import RelativePrior
from onboard.model.vehicle import Displacement, WheelMotion, displacement

MIN_RANGE_M = 0.02
"""The mean range is never below this."""

_NOISE_MIN_RANGE_M = 0.1


class Carry(NamedTuple):
    """The motions of both robots over one step, each in its own body axes at the start."""

    own: Displacement
    leader: Displacement


Point = tuple[float, float, float, float]
"""A sigma point, or a mean: range, bearing, heading, speed scale."""

Lever = tuple[float, float]
"""A marker, in the axes that its robot has at the start of the motion (see `turned`)."""

Lower = tuple[float, float, float, float, float, float, float, float, float, float]
"""Lower triangle of a 4 x 4 matrix, row by row."""


def carry(
    own: WheelMotion,
    leader: WheelMotion,
    own_wheelbase_m: float,
    leader_wheelbase_m: float,
    dt_s: float,
) -> Carry:
    """Both displacements over `dt_s`; negative times carry back to when a bearing was captured."""
    return Carry(
        displacement(own, own_wheelbase_m, dt_s), displacement(leader, leader_wheelbase_m, dt_s)
    )


def advance(points: Iterable[Point], motion: Carry) -> list[Point]:
    """The points after both robots moved; bearings are not wrapped."""
    (own_x, own_y, own_turn), (leader_x, leader_y, leader_turn) = motion
    moved = []
    for rho, phi, alpha, scale in points:
        factor = 1.0 + scale
        ca, sa, cb, sb = factor * cos(alpha), factor * sin(alpha), cos(phi), sin(phi)
        x = rho * cb + ca * leader_x - sa * leader_y - own_x
        y = rho * sb + sa * leader_x + ca * leader_y - own_y
        sign = -1.0 if x * cb + y * sb < 0.0 else 1.0
        bearing = atan2(sign * y, sign * x) - own_turn
        moved.append((sign * hypot(x, y), bearing, alpha + factor * leader_turn - own_turn, scale))
    return moved


def leader_marker_bearings(points: Iterable[Point], motion: Carry, marker: Lever) -> list[float]:
    """Own bearings (not wrapped) to a marker of the leader after `motion`."""
    (own_x, own_y, own_turn), (leader_x, leader_y, _) = motion
    marker_x, marker_y = marker
    bearings = []
    for rho, phi, alpha, scale in points:
        ca, sa = cos(alpha), sin(alpha)
        lever_x = marker_x + leader_x + scale * leader_x
        lever_y = marker_y + leader_y + scale * leader_y
        x = rho * cos(phi) + ca * lever_x - sa * lever_y - own_x
        y = rho * sin(phi) + sa * lever_x + ca * lever_y - own_y
        bearings.append(atan2(y, x) - own_turn)
    return bearings


def own_marker_bearings(points: Iterable[Point], motion: Carry, marker: Lever) -> list[float]:
    """The leader's bearings (not wrapped), in its body frame, to an own marker after `motion`."""
    (own_x, own_y, _), (leader_x, leader_y, leader_turn) = motion
    target_x, target_y = own_x + marker[0], own_y + marker[1]
    bearings = []
    for rho, phi, alpha, scale in points:
        factor = 1.0 + scale
        ca, sa = factor * cos(alpha), factor * sin(alpha)
        x = target_x - rho * cos(phi) - ca * leader_x + sa * leader_y
        y = target_y - rho * sin(phi) - sa * leader_x - ca * leader_y
        bearings.append(atan2(y, x) - alpha - factor * leader_turn)
    return bearings


def turned(point: fleet.Point, angle_rad: float) -> Lever:
    """A body point in axes that are `angle_rad` clockwise of the body's."""
    c, s = cos(angle_rad), sin(angle_rad)
    return c * point.x_m - s * point.y_m, s * point.x_m + c * point.y_m


def process_noise(settings: fleet.RelativeFilter, range_m: float, dt_s: float) -> Lower:
    """Covariance that one prediction adds, in place of T_c O in (33).

    Position noise acts across the line of sight divided by the range (not below 0.1 m); half of
    the heading noise is the follower's own, and turns bearing and heading together.
    """
    position = settings.position_noise_m**2 * dt_s
    heading = settings.heading_noise_rad**2 * dt_s
    across = position / max(range_m, _NOISE_MIN_RANGE_M) ** 2
    scale = settings.speed_scale_noise**2 * dt_s
    return (position, 0.0, across + heading / 2, 0.0, heading / 2, heading, 0.0, 0.0, 0.0, scale)


def prior_variances(settings: fleet.RelativeFilter, prior: RelativePrior) -> Lower:
    """Diagonal covariance of a filter that starts from `prior`."""
    return (
        prior.range_std_m**2,
        0.0,
        prior.bearing_std_rad**2,
        0.0,
        0.0,
        prior.heading_std_rad**2,
        0.0,
        0.0,
        0.0,
        settings.speed_scale_start_std**2,
    )


def full_matrix(lower: Lower) -> tuple[float, ...]:
    """All 16 elements, row by row."""
    p00, p10, p11, p20, p21, p22, p30, p31, p32, p33 = lower
    return (p00, p10, p20, p30, p10, p11, p21, p31, p20, p21, p22, p32, p30, p31, p32, p33)
