"""A leader seen from its follower: the paper's (29)/(30), corrected, and the bearings between them.

Bearings are anticlockwise from the follower's forward axis; heading alpha = theta_l - theta_f.
With these the paper's gamma is phi - alpha (it prints phi + alpha). Range and bearing lead from the
follower's FRONT point to the leader's front point unless a function says otherwise.
"""

import math
from typing import NamedTuple

from config.angles import wrap
from onboard.model.vehicle import AxleMotion, WheelMotion, yaw_rate


class RelativeState(NamedTuple):
    """Range rho [m], bearing phi [rad] and relative heading alpha [rad] of the leader."""

    range_m: float
    bearing_rad: float
    heading_rad: float


class RelativeRates(NamedTuple):
    """Time derivatives of the relative state, polar."""

    range_mps: float
    bearing_radps: float
    heading_radps: float


class CartesianRates(NamedTuple):
    """Time derivatives of the leader point in the follower's body axes, and of alpha."""

    x_mps: float
    y_mps: float
    heading_radps: float


class BodyVelocity(NamedTuple):
    """Velocity of a point in body axes [m/s]."""

    forward_mps: float
    left_mps: float


def front_velocity(motion: WheelMotion) -> BodyVelocity:
    """Velocity (a, b) = v (cos delta, sin delta) of the front point in its own body axes."""
    return BodyVelocity(
        motion.speed_mps * math.cos(motion.steering_rad),
        motion.speed_mps * math.sin(motion.steering_rad),
    )


def point_velocity(
    motion: WheelMotion, wheelbase_m: float, x_m: float = 0.0, y_m: float = 0.0
) -> BodyVelocity:
    """Velocity, in a robot's body axes, of the body point at (x, y) from its front point."""
    front = front_velocity(motion)
    turn = yaw_rate(motion, wheelbase_m)
    return BodyVelocity(front.forward_mps - turn * y_m, front.left_mps + turn * x_m)


def rotated(velocity: BodyVelocity, angle_rad: float) -> BodyVelocity:
    """The velocity R(angle) V: from the leader's axes into the follower's when angle is alpha."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    forward, left = velocity
    return BodyVelocity(c * forward - s * left, s * forward + c * left)


def polar_rates(
    state: RelativeState,
    leader_velocity: BodyVelocity,
    leader_yaw_rate_radps: float,
    own: WheelMotion,
    own_wheelbase_m: float,
) -> RelativeRates:
    """Kinematics of a leader point seen from the follower's front point, in place of (29).

    `state` describes that leader point and `leader_velocity` is its velocity in the leader's body
    axes (see `point_velocity`). Singular at range 0.
    """
    phi = state.bearing_rad
    point = rotated(leader_velocity, state.heading_rad)
    front = front_velocity(own)
    turn = yaw_rate(own, own_wheelbase_m)
    closing_x, closing_y = point.forward_mps - front.forward_mps, point.left_mps - front.left_mps
    c, s = math.cos(phi), math.sin(phi)
    return RelativeRates(
        closing_x * c + closing_y * s,
        (closing_y * c - closing_x * s) / state.range_m - turn,
        leader_yaw_rate_radps - turn,
    )


def cartesian_rates(
    x_m: float,
    y_m: float,
    heading_rad: float,
    leader_velocity: BodyVelocity,
    leader_yaw_rate_radps: float,
    own: WheelMotion,
    own_wheelbase_m: float,
) -> CartesianRates:
    """The kinematics of `polar_rates` for (x, y) = rho (cos phi, sin phi); nowhere singular."""
    point = rotated(leader_velocity, heading_rad)
    front = front_velocity(own)
    turn = yaw_rate(own, own_wheelbase_m)
    return CartesianRates(
        point.forward_mps - front.forward_mps + y_m * turn,
        point.left_mps - front.left_mps - x_m * turn,
        leader_yaw_rate_radps - turn,
    )


def rear_axle_rates(state: RelativeState, leader: AxleMotion, own: AxleMotion) -> RelativeRates:
    """Paper (29)/(30), corrected: range and bearing between the two REAR-axle midpoints.

    Errata: gamma is phi - alpha, and omega is the yaw rate d theta/dt, not the fork rate of (3).
    """
    phi = state.bearing_rad
    gamma = phi - state.heading_rad
    transverse = leader.speed_mps * math.sin(gamma) - own.speed_mps * math.sin(phi)
    return RelativeRates(
        leader.speed_mps * math.cos(gamma) - own.speed_mps * math.cos(phi),
        -transverse / state.range_m - own.yaw_rate_radps,
        leader.yaw_rate_radps - own.yaw_rate_radps,
    )


def marker_bearing(state: RelativeState, x_m: float, y_m: float) -> float:
    """Bearing [rad], from the follower's front point in its body frame, of a leader's marker.

    The marker is at (x, y) in the leader's body axes, from the leader's front point.
    """
    phi, alpha = state.bearing_rad, state.heading_rad
    c, s = math.cos(alpha), math.sin(alpha)
    return math.atan2(
        state.range_m * math.sin(phi) + s * x_m + c * y_m,
        state.range_m * math.cos(phi) + c * x_m - s * y_m,
    )


def mutual_bearing(state: RelativeState, x_m: float = 0.0, y_m: float = 0.0) -> float:
    """Bearing [rad] that the leader takes, in ITS body frame, to a marker of the follower.

    The marker is at (x, y) in the follower's body axes, from the follower's front point. For the
    front point itself this is zeta = phi - alpha + pi.
    """
    phi = state.bearing_rad
    direction = math.atan2(y_m - state.range_m * math.sin(phi), x_m - state.range_m * math.cos(phi))
    return wrap(direction - state.heading_rad)


def heading_from_mutual(bearing_rad: float, mutual_bearing_rad: float) -> float:
    """Relative heading alpha [rad] from the two bearings between the same two front points."""
    return wrap(bearing_rad - mutual_bearing_rad + math.pi)


def range_from_axis_marker(
    front_bearing_rad: float, axis_bearing_rad: float, heading_rad: float, baseline_m: float
) -> float:
    """Range [m] from the bearings to the leader's front and to a marker `baseline_m` behind it.

    Raises:
        ZeroDivisionError: both bearings are equal: the markers lie on the line of sight.
    """
    return (
        baseline_m
        * math.sin(heading_rad - axis_bearing_rad)
        / math.sin(front_bearing_rad - axis_bearing_rad)
    )


def transverse_speed(
    state: RelativeState, leader: WheelMotion, own: WheelMotion, leader_wheelbase_m: float
) -> float:
    """Relative speed q [m/s] across the line of sight, between the two front points.

    The line of sight turns at -q/rho in the world; with one bearing per step the range is
    unobservable exactly while q is 0.
    """
    point = rotated(point_velocity(leader, leader_wheelbase_m), state.heading_rad)
    front = front_velocity(own)
    c, s = math.cos(state.bearing_rad), math.sin(state.bearing_rad)
    return (point.forward_mps - front.forward_mps) * s - (point.left_mps - front.left_mps) * c
