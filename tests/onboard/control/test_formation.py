"""The formation laws linearise what they promise to linearise."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from config.angles import wrap
from config.fleet import Formation, Point
from onboard.control.formation import (
    MIN_LEVER_WHEELBASES,
    desired_velocity,
    leader_frame_velocity,
    polar_velocity,
)
from onboard.estimate.beliefs import RelativeBelief
from onboard.model.relative import RelativeState, cartesian_rates, point_velocity, polar_rates
from onboard.model.vehicle import WheelMotion, yaw_rate

LEADER_WHEELBASE, OWN_WHEELBASE = 0.3, 0.25
OFFSET = Point(x_m=-0.318, y_m=-0.318)
K = 2.0

angles = st.floats(-3.0, 3.0)
motions = st.builds(WheelMotion, st.floats(0.0, 4.0), st.floats(-0.6, 0.6))
beliefs = st.builds(
    RelativeBelief,
    st.floats(0.15, 2.0),
    angles,
    angles,
    st.floats(-0.05, 0.05),
    st.just((0.0,) * 16),
)


def own_motion(forward: float, left: float) -> WheelMotion:
    """The wheel motion that has this front-point velocity."""
    return WheelMotion(math.hypot(forward, left), math.atan2(left, forward))


def true_leader(belief: RelativeBelief, reported: WheelMotion) -> WheelMotion:
    return WheelMotion((1 + belief.speed_scale) * reported.speed_mps, reported.steering_rad)


@given(belief=beliefs, leader=motions)
def test_polar_law_makes_range_and_bearing_first_order(
    belief: RelativeBelief, leader: WheelMotion
) -> None:
    lever = OWN_WHEELBASE + belief.range_m * math.cos(belief.bearing_rad)
    assume(abs(lever) > MIN_LEVER_WHEELBASES * OWN_WHEELBASE)
    wanted = polar_velocity(belief, leader, LEADER_WHEELBASE, OWN_WHEELBASE, OFFSET, K)
    truth = true_leader(belief, leader)
    rates = polar_rates(
        RelativeState(*belief[:3]),
        point_velocity(truth, LEADER_WHEELBASE),
        yaw_rate(truth, LEADER_WHEELBASE),
        own_motion(*wanted),
        OWN_WHEELBASE,
    )
    desired_range = math.hypot(0.318, 0.318)
    assert rates.range_mps == pytest.approx(K * (desired_range - belief.range_m), abs=1e-8)
    bearing_error = wrap(math.pi / 4 - belief.bearing_rad)
    assert rates.bearing_radps == pytest.approx(K * bearing_error, abs=1e-7)


@given(belief=beliefs, leader=motions)
def test_leader_frame_law_lets_the_error_in_the_world_decay(
    belief: RelativeBelief, leader: WheelMotion
) -> None:
    """The error, written in the leader's axes (which turn), must obey e' = -k e - r x e."""
    wanted = leader_frame_velocity(belief, leader, LEADER_WHEELBASE, OFFSET, K)
    truth = true_leader(belief, leader)
    turn = yaw_rate(truth, LEADER_WHEELBASE)
    x = belief.range_m * math.cos(belief.bearing_rad)
    y = belief.range_m * math.sin(belief.bearing_rad)
    rates = cartesian_rates(
        x,
        y,
        belief.heading_rad,
        point_velocity(truth, LEADER_WHEELBASE),
        turn,
        own_motion(*wanted),
        OWN_WHEELBASE,
    )
    unturn = complex(math.cos(belief.heading_rad), -math.sin(belief.heading_rad))
    error = complex(x, y) * unturn + complex(OFFSET.x_m, OFFSET.y_m)
    error_rate = (
        complex(rates.x_mps, rates.y_mps) - 1j * rates.heading_radps * complex(x, y)
    ) * unturn
    assert error_rate == pytest.approx(-K * error - 1j * turn * error, abs=1e-7)


@pytest.mark.parametrize("law", ["polar", "leader_frame"])
def test_in_perfect_formation_on_a_straight_the_follower_copies_its_leader(law: str) -> None:
    belief = RelativeBelief(math.hypot(0.318, 0.318), math.pi / 4, 0.0, 0.0, (0.0,) * 16)
    formation = Formation.model_validate({"law": law})
    wanted = desired_velocity(
        formation, OFFSET, belief, WheelMotion(4.0, 0.0), LEADER_WHEELBASE, OWN_WHEELBASE
    )
    assert wanted == pytest.approx((4.0, 0.0), abs=1e-12)


@given(phi=angles, range_m=st.floats(0.05, 1.0))
def test_the_guard_bounds_the_polar_law_at_the_rear_axle_line(phi: float, range_m: float) -> None:
    belief = RelativeBelief(range_m, phi, 0.0, 0.0, (0.0,) * 16)
    wanted = polar_velocity(
        belief, WheelMotion(4.0, 0.0), LEADER_WHEELBASE, OWN_WHEELBASE, OFFSET, K
    )
    sideways_demand = 4.0 + K * 1.5 + range_m * K * math.pi
    assert abs(wanted.left_mps) <= sideways_demand / MIN_LEVER_WHEELBASES


def test_the_guarded_lever_keeps_its_sign() -> None:
    leader = WheelMotion(1.0, 0.5)

    def sideways(phi: float) -> float:
        belief = RelativeBelief(0.5, phi, 0.0, 0.0, (0.0,) * 16)
        at_bearing = Point(x_m=-0.5 * math.cos(phi), y_m=-0.5 * math.sin(phi))
        return polar_velocity(
            belief, leader, LEADER_WHEELBASE, OWN_WHEELBASE, at_bearing, K
        ).left_mps

    on_the_line = math.acos(-OWN_WHEELBASE / 0.5)
    assert sideways(on_the_line - 0.01) > 0 > sideways(on_the_line + 0.01)
