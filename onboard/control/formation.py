"""Formation laws: from the belief on the leader to the wanted velocity of the own front point.

They stand in for the paper's (34)-(38). Erratum: the decoupling matrix of (35) has determinant
cos(delta_2) cos(phi_1); it is singular with the leader abeam, and law (36) then commands unbounded
yaw rates. Controlling the front point moves the singularity of the polar law to the follower's
rear-axle line; the leader-frame law has none.
"""

import math

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import RelativeBelief
from onboard.model.relative import BodyVelocity, point_velocity, rotated
from onboard.model.vehicle import WheelMotion

MIN_LEVER_WHEELBASES = 0.3
"""Guard of the polar law: least distance of the leader from the rear-axle line, in wheelbases."""


def desired_velocity(
    formation: fleet.Formation,
    offset: fleet.Point,
    belief: RelativeBelief,
    leader: WheelMotion,
    leader_wheelbase_m: float,
    own_wheelbase_m: float,
) -> BodyVelocity:
    """Wanted velocity of the own front point in own body axes, by the law that `formation` names.

    `offset` is the desired place of the own front point in the leader's body axes, from the
    leader's front point; `leader` is the motion that the leader reports.
    """
    if formation.law == "polar":
        return polar_velocity(
            belief, leader, leader_wheelbase_m, own_wheelbase_m, offset, formation.gain_per_s
        )
    return leader_frame_velocity(belief, leader, leader_wheelbase_m, offset, formation.gain_per_s)


def leader_frame_velocity(
    belief: RelativeBelief,
    leader: WheelMotion,
    leader_wheelbase_m: float,
    offset: fleet.Point,
    gain_per_s: float,
) -> BodyVelocity:
    """Follow the place that `offset` fixes in the leader's axes: error' = -gain error."""
    goal = rotated(
        point_velocity(_scaled(leader, belief), leader_wheelbase_m, offset.x_m, offset.y_m),
        belief.heading_rad,
    )
    place = rotated(BodyVelocity(offset.x_m, offset.y_m), belief.heading_rad)
    ahead_m = belief.range_m * math.cos(belief.bearing_rad) + place.forward_mps
    left_m = belief.range_m * math.sin(belief.bearing_rad) + place.left_mps
    return BodyVelocity(
        goal.forward_mps + gain_per_s * ahead_m, goal.left_mps + gain_per_s * left_m
    )


def polar_velocity(
    belief: RelativeBelief,
    leader: WheelMotion,
    leader_wheelbase_m: float,
    own_wheelbase_m: float,
    offset: fleet.Point,
    gain_per_s: float,
) -> BodyVelocity:
    """Linearise range and bearing exactly: (38) for the front point, with equal gains.

    rho' = k (rho_d - rho) and phi' = k (phi_d - phi), where rho_d and phi_d are range and bearing
    of the leader at `offset` with equal headings. Inside the guard the lever keeps its sign.
    """
    rho, phi = belief.range_m, belief.bearing_rad
    c, s = math.cos(phi), math.sin(phi)
    closing = gain_per_s * (math.hypot(offset.x_m, offset.y_m) - rho)
    swing = gain_per_s * wrap(math.atan2(-offset.y_m, -offset.x_m) - phi)
    point = rotated(point_velocity(_scaled(leader, belief), leader_wheelbase_m), belief.heading_rad)
    lever_m = _guarded(own_wheelbase_m + rho * c, MIN_LEVER_WHEELBASES * own_wheelbase_m)
    turn = (point.left_mps - closing * s - rho * c * swing) / lever_m
    return BodyVelocity(
        point.forward_mps - closing * c + rho * s * (swing + turn), own_wheelbase_m * turn
    )


def _scaled(leader: WheelMotion, belief: RelativeBelief) -> WheelMotion:
    return WheelMotion((1.0 + belief.speed_scale) * leader.speed_mps, leader.steering_rad)


def _guarded(lever_m: float, least_m: float) -> float:
    return math.copysign(max(abs(lever_m), least_m), lever_m)
