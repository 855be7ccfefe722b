"""Exact ranks against the tables of docs/mathematics.md, sections 5 and 7, and the lemmas in words.

The tables were computed by another program (symbolic algebra); here they are the expected values.
"""

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest

from onboard.model.jets import Direction, half_tangent
from onboard.model.observability import (
    MOVING,
    STANDING,
    BasePose,
    BodyMotion,
    Excitation,
    KnownRate,
    Mounting,
    Pairing,
    Sensing,
    System,
    base_pose,
    landmark_system,
    lowest_order,
    rank,
    relative_system,
    singular_values,
    steady,
    unobservable,
)
from onboard.model.vehicle import VehicleState

Place = tuple[Fraction, Fraction]
Angle = Direction[Fraction]


def _f(numerator: int, denominator: int = 1) -> Fraction:
    return Fraction(numerator, denominator)


D = _f(1, 4)
AHEAD = Direction(_f(3, 5), _f(4, 5))  # the direction of motion in the degenerate families
STRAIGHT = Direction(_f(1), _f(0))
LEFT, RIGHT = Direction(_f(0), _f(1)), Direction(_f(0), _f(-1))
STEERED = half_tangent(_f(1, 5))

FORK_ETA = (Mounting.FORK, KnownRate.FORK)
BODY_ETA = (Mounting.BODY, KnownRate.FORK)
FORK_DELTA = (Mounting.FORK, KnownRate.STEERING)
BODY_DELTA = (Mounting.BODY, KnownRate.STEERING)
GOOD = (BODY_ETA, FORK_DELTA, BODY_DELTA)
EVERY = (FORK_ETA, *GOOD)

POSE = BasePose(_f(1, 3), _f(-2, 5), half_tangent(_f(3, 7)), half_tangent(_f(1, 5)))
GENERIC: list[Place] = [(_f(4), _f(3)), (_f(-3), _f(5)), (_f(2), _f(-6)), (_f(-5), _f(-2))]


def _pose(steering: Angle) -> BasePose[Fraction]:
    """At the origin, the fork along AHEAD, the body turned back by the steering angle."""
    return BasePose(_f(0), _f(0), AHEAD, AHEAD.plus(Direction(steering.cos, -steering.sin)))


def _on_line(*distances: int) -> list[Place]:
    return [(AHEAD.cos * r, AHEAD.sin * r) for r in distances]


def _rank(
    convention: tuple[Mounting, KnownRate],
    landmarks: Sequence[Place],
    excitation: Excitation,
    *,
    pose: BasePose[Fraction] = POSE,
    encoder: bool = False,
) -> int:
    return rank(_system(convention, landmarks, excitation, pose=pose, encoder=encoder))


def _system(
    convention: tuple[Mounting, KnownRate],
    landmarks: Sequence[Place],
    excitation: Excitation,
    *,
    pose: BasePose[Fraction] = POSE,
    encoder: bool = False,
) -> System[Fraction]:
    return landmark_system(Sensing(*convention, encoder), pose, D, landmarks, excitation)


@pytest.mark.parametrize(
    ("convention", "encoder", "moving", "standing"),
    [
        (FORK_ETA, False, [0, 2, 3, 3, 3], [0, 1, 2, 3, 3]),
        (FORK_ETA, True, [1, 3, 4, 4, 4], [1, 2, 3, 4, 4]),
        (BODY_ETA, False, [0, 3, 4, 4, 4], [0, 1, 2, 3, 3]),
        (BODY_ETA, True, [1, 3, 4, 4, 4], [1, 2, 3, 4, 4]),
        (FORK_DELTA, False, [0, 3, 4, 4, 4], [0, 1, 2, 3, 3]),
        (FORK_DELTA, True, [1, 3, 4, 4, 4], [1, 2, 3, 4, 4]),
        (BODY_DELTA, False, [0, 3, 4, 4, 4], [0, 1, 2, 3, 3]),
        (BODY_DELTA, True, [1, 3, 4, 4, 4], [1, 2, 3, 4, 4]),
    ],
)
def test_ranks_in_generic_position_for_none_to_four_landmarks(
    convention: tuple[Mounting, KnownRate],
    encoder: bool,
    moving: list[int],
    standing: list[int],
) -> None:
    def found(excitation: Excitation) -> list[int]:
        return [_rank(convention, GENERIC[:n], excitation, encoder=encoder) for n in range(5)]

    assert found(MOVING) == moving
    assert found(STANDING) == standing
    assert found(steady(2, 0)) == found(steady(2, 1)) == moving


SAME_SIDE = [(_f(2), _f(1)), (_f(6), _f(3))]
OPPOSITE = [(_f(2), _f(1)), (_f(-6), _f(-3))]
# AHEAD x 5 is the foot of the perpendicular from a point 5 ahead and 10 to the left of the line.
FOOT = [*_on_line(5), (_f(3) - 8, _f(4) + 6)]
ACROSS = (_f(-7), _f(2))


@pytest.mark.parametrize(
    ("landmarks", "steering", "fork_eta", "body_eta", "known_delta_rate"),
    [
        pytest.param(SAME_SIDE, STEERED, "33", "44", "44", id="in line with both, same side"),
        pytest.param(OPPOSITE, STEERED, "33", "44", "44", id="in line with both, opposite sides"),
        pytest.param(SAME_SIDE[:1] * 2, STEERED, "22", "33", "33", id="twice the same landmark"),
        pytest.param(_on_line(5), STRAIGHT, "21", "32", "32", id="at the only one, straight"),
        pytest.param(_on_line(5), STEERED, "21", "32", "33", id="at the only one, steered"),
        pytest.param([*_on_line(5), ACROSS], STRAIGHT, "33", "44", "44", id="at one of two"),
        pytest.param(_on_line(5, 9), STRAIGHT, "32", "43", "43", id="two on the motion line"),
        pytest.param(_on_line(5, 9, -4), STRAIGHT, "32", "43", "43", id="three on the motion line"),
        pytest.param(_on_line(5, 9, -4, 12), STRAIGHT, "32", "43", "43", id="four on it"),
        pytest.param(FOOT, STRAIGHT, "32", "43", "43", id="foot of the perpendicular, straight"),
        pytest.param(FOOT, STEERED, "32", "43", "44", id="foot of the perpendicular, steered"),
    ],
)
def test_ranks_in_degenerate_positions(
    landmarks: list[Place], steering: Angle, fork_eta: str, body_eta: str, known_delta_rate: str
) -> None:
    """Each text: rank with any inputs, and on one straight drive with the rate 0."""
    pose = _pose(steering)
    wanted = dict(zip(EVERY, (fork_eta, body_eta, *[known_delta_rate] * 2), strict=True))
    for convention, expected in wanted.items():
        any_inputs, straight = list(expected)
        assert _rank(convention, landmarks, MOVING, pose=pose) == int(any_inputs)
        assert _rank(convention, landmarks, steady(2, 0), pose=pose) == int(straight)
        assert _rank(convention, landmarks, steady(2, 1), pose=pose) == int(any_inputs)


@pytest.mark.parametrize("steering", [LEFT, RIGHT])
def test_two_landmarks_suffice_with_the_fork_at_a_right_angle(steering: Angle) -> None:
    pose = _pose(steering)
    for convention, any_inputs, straight in (
        (FORK_ETA, 3, 3),
        (BODY_ETA, 4, 4),
        (FORK_DELTA, 4, 3),
        (BODY_DELTA, 4, 4),
    ):
        assert _rank(convention, GENERIC[:2], MOVING, pose=pose) == any_inputs
        assert _rank(convention, GENERIC[:2], steady(2, 0), pose=pose) == straight
        assert _rank(convention, GENERIC[:2], MOVING, pose=pose, encoder=True) == 4


def test_danger_circle_and_collinear_three_cost_a_rank_only_while_standing() -> None:
    circle = [(_f(2), _f(0)), (_f(0), _f(4)), (_f(2), _f(4))]  # with the origin: x^2+y^2 = 2x+4y
    line = [(_f(2), _f(1)), (_f(6), _f(3)), (_f(-4), _f(-2))]
    for landmarks in (circle, line):
        for convention in EVERY:
            moving = 3 if convention == FORK_ETA else 4
            assert _rank(convention, landmarks, MOVING, pose=_pose(STEERED)) == moving
            assert _rank(convention, landmarks, STANDING, pose=_pose(STEERED)) == 2
            assert _rank(convention, landmarks, STANDING, pose=_pose(STEERED), encoder=True) == 3


def test_lowest_order_is_one_but_two_for_one_landmark_without_encoder() -> None:
    for convention in EVERY:
        for n, order in ((1, 1), (2, 1), (3, 0)):
            assert lowest_order(_system(convention, GENERIC[:n], MOVING, encoder=True)) == order
    for convention in GOOD:
        assert lowest_order(_system(convention, GENERIC[:1], MOVING)) == 2
        assert lowest_order(_system(convention, GENERIC[:2], MOVING)) == 1


def test_lemma_2_one_landmark_leaves_exactly_the_rotation_about_it() -> None:
    """At every pose tried, the right angle of the fork included, which the paper excepts."""
    for steering in (STRAIGHT, STEERED, LEFT, RIGHT):
        pose = _pose(steering)
        for place in (_on_line(5)[0], GENERIC[0], ACROSS):
            rotation = [place[1], -place[0], _f(1), _f(1)]  # (-Dy, Dx, 1, 1) with D = robot - mark
            for convention, encoder in [(c, e) for c in GOOD for e in (False, True)]:
                left = unobservable(
                    _system(convention, [place], MOVING, pose=pose, encoder=encoder)
                )
                assert left == [rotation]


def test_lemma_3_two_landmarks_and_motion_see_everything_but_for_the_fork_alone() -> None:
    """Also in line with both and driving at one: the paper's conditions are not needed."""
    families = [GENERIC[:2], SAME_SIDE, OPPOSITE, FOOT, _on_line(5, 9), [*_on_line(5), ACROSS]]
    for landmarks in families:
        for steering in (STRAIGHT, STEERED, LEFT):
            pose = _pose(steering)
            for convention in GOOD:
                assert _rank(convention, landmarks, MOVING, pose=pose) == 4
            assert _rank(FORK_ETA, landmarks, MOVING, pose=pose, encoder=True) == 4
            alone = _system(FORK_ETA, landmarks, MOVING, pose=pose)
            assert unobservable(alone) == [[_f(0), _f(0), _f(0), _f(1)]]


def test_lemma_4_a_standing_robot_needs_three_landmarks_and_the_encoder() -> None:
    for convention in EVERY:
        assert _rank(convention, GENERIC[:3], STANDING, encoder=True) == 4
        assert _rank(convention, GENERIC[:2], STANDING, encoder=True) == 3
        assert _rank(convention, GENERIC, STANDING) == 3


def test_landmarks_on_the_rear_axle_line_cost_nothing() -> None:
    """Order 2 gives back what order 1 loses there."""
    heading = AHEAD.plus(Direction(STEERED.cos, -STEERED.sin))
    rear = (-D * heading.cos, -D * heading.sin)
    abeam = (rear[0] - 3 * heading.sin, rear[1] + 3 * heading.cos)
    for convention in GOOD:
        pose = _pose(STEERED)
        assert _rank(convention, [rear], MOVING, pose=pose) == 3
        assert _rank(convention, [abeam], MOVING, pose=pose) == 3
        assert _rank(convention, [abeam, GENERIC[1]], MOVING, pose=pose) == 4


@pytest.mark.parametrize("convention", EVERY)
@pytest.mark.parametrize("count", [1, 2, 3])
def test_floats_agree_with_fractions(convention: tuple[Mounting, KnownRate], count: int) -> None:
    state = VehicleState(
        float(POSE.x),
        float(POSE.y),
        math.atan2(POSE.fork.sin, POSE.fork.cos),
        math.atan2(POSE.heading.sin, POSE.heading.cos),
    )
    marks = [(float(x), float(y)) for x, y in GENERIC[:count]]
    system = landmark_system(Sensing(*convention, False), base_pose(state), 0.25, marks, MOVING)
    values = singular_values(system, (5.0, 5.0, 1.0, 1.0))
    assert int(np.sum(values > 1e-9)) == _rank(convention, GENERIC[:count], MOVING)
    assert np.all(np.diff(values) <= 0)


def test_a_bearing_s_derivatives_are_those_of_the_corrected_formulas() -> None:
    """L_v h and its gradient as section 3 of docs/mathematics.md gives them, at one pose."""
    x, y, eta, theta, d = 0.3, -0.4, 0.8, 0.5, 0.25
    mark = (4.0, 3.0)
    dx, dy = x - mark[0], y - mark[1]
    sigma, r2 = math.atan2(-dy, -dx), dx * dx + dy * dy
    r, beta = math.sqrt(r2), math.atan2(-dy, -dx) - eta
    system = landmark_system(
        Sensing(*BODY_ETA, False), base_pose(VehicleState(x, y, eta, theta)), d, [mark], MOVING
    )
    (gradient,), (along, turn) = system.rows(1)
    assert gradient == pytest.approx([-dy / r2, dx / r2, 0.0, -1.0])
    delta = eta - theta
    assert along == pytest.approx(
        [
            math.sin(sigma + beta) / r2,
            -math.cos(sigma + beta) / r2,
            -math.cos(beta) / r - math.cos(delta) / d,
            math.cos(delta) / d,
        ]
    )
    assert turn == pytest.approx([0.0, 0.0, 0.0, 0.0])


def test_a_landmark_at_the_sensor_is_refused() -> None:
    with pytest.raises(ZeroDivisionError):
        _system(BODY_ETA, [(POSE.x, POSE.y)], MOVING)


# --- leader and follower -------------------------------------------------------------------

FRONT, REAR = (_f(0), _f(0)), (-D, _f(0))
SIDE, OFF_LINE = (-D / 2, _f(1, 5)), (-D / 2, _f(-1, 5))
ONE, AXIS, WITH_SIDE, THREE = [FRONT], [FRONT, REAR], [FRONT, SIDE], [FRONT, REAR, OFF_LINE]
AT_45 = (_f(1, 3), _f(1, 3))
BEHIND = (_f(1, 2), _f(0))
STILL = BodyMotion(_f(0), _f(0))
FORWARD = BodyMotion(_f(4), _f(0))


def _relative(
    place: Place,
    markers: Sequence[Place],
    *,
    mutual: bool = False,
    heading_known: bool = False,
    leader: BodyMotion[Fraction] = FORWARD,
    own: BodyMotion[Fraction] = FORWARD,
    heading: Angle = STRAIGHT,
    with_scale: bool = False,
) -> int:
    pairing = Pairing(*place, heading, markers, mutual, heading_known)
    return rank(relative_system(pairing, leader, own, D, with_scale))


@pytest.mark.parametrize(
    ("markers", "mutual", "at_45", "behind", "standing"),
    [
        pytest.param(ONE, False, (2, 2), (2, 2), (1, 1), id="one"),
        pytest.param(ONE, True, (2, 3), (2, 2), (2, 2), id="one and mutual"),
        pytest.param(AXIS, False, (3, 4), (2, 2), (2, 2), id="two on the axis"),
        pytest.param(AXIS, True, (3, 4), (2, 2), (3, 3), id="two on the axis and mutual"),
        pytest.param(WITH_SIDE, True, (3, 4), (3, 4), (3, 3), id="one aside, and mutual"),
        pytest.param(THREE, False, (3, 4), (3, 4), (3, 3), id="three not in line"),
    ],
)
def test_ranks_of_a_follower_without_and_with_the_speed_scale(
    markers: list[Place],
    mutual: bool,
    at_45: tuple[int, int],
    behind: tuple[int, int],
    standing: tuple[int, int],
) -> None:
    for scaled in (False, True):
        assert _relative(AT_45, markers, mutual=mutual, with_scale=scaled) == at_45[scaled]
        assert _relative(BEHIND, markers, mutual=mutual, with_scale=scaled) == behind[scaled]
        found = _relative(AT_45, markers, mutual=mutual, with_scale=scaled, leader=STILL, own=STILL)
        assert found == standing[scaled]


def test_a_follower_directly_behind_is_blind_for_range_with_markers_on_the_leader_s_axis() -> None:
    for markers in (AXIS, [*AXIS, (-D / 2, _f(0))]):
        for mutual in (False, True):
            pairing = Pairing(*BEHIND, STRAIGHT, markers, mutual)
            left = unobservable(relative_system(pairing, FORWARD, FORWARD, D))
            assert left == [[_f(1), _f(0), _f(0)]], "what is lost is the distance along the line"
    assert _relative(BEHIND, WITH_SIDE) == 3


def test_measured_heading_changes_nothing_for_the_range() -> None:
    assert _relative(AT_45, ONE, heading_known=True) == 2
    assert _relative(AT_45, ONE, heading_known=True, leader=STILL, own=STILL) == 2


def test_closing_in_along_the_line_of_sight_hides_the_range() -> None:
    slow = BodyMotion(_f(3), _f(0))
    assert _relative(BEHIND, AXIS, leader=slow) == 2
    assert _relative(BEHIND, THREE, leader=slow) == 3


def test_on_a_circle_every_set_of_bearings_sees_the_range() -> None:
    """Both rear axles circle the origin at yaw rate 1: (a, b) = (radius, wheelbase)."""
    lead, follow, apart = _f(3), _f(14, 5), half_tangent(_f(1, 10))
    # Leader at angle 0, follower `apart` behind it; both heading along their circles.
    leader_front = (lead, D)
    sin, cos = apart.sin, apart.cos
    heading: Angle = Direction(sin, cos)
    front = (follow * cos + D * heading.cos, -follow * sin + D * heading.sin)
    dx, dy = leader_front[0] - front[0], leader_front[1] - front[1]
    place = (heading.cos * dx + heading.sin * dy, -heading.sin * dx + heading.cos * dy)
    alpha = LEFT.plus(Direction(heading.cos, -heading.sin))
    moving = {"leader": BodyMotion(lead, D), "own": BodyMotion(follow, D)}
    for markers, mutual in ((ONE, False), (ONE, True), (AXIS, False), (AXIS, True), (THREE, False)):
        pairing = Pairing(*place, alpha, markers, mutual)
        assert rank(relative_system(pairing, moving["leader"], moving["own"], D)) == 3
