"""Where nothing tells the range, the filter does not pretend to know it better."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.fleet import Point
from config.fleet import RelativeFilter as Settings
from onboard.control.formation import leader_frame_velocity
from onboard.estimate.beliefs import RelativeBelief, RelativeFilter, RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.model.vehicle import WheelMotion
from tests.onboard.estimate.pair import DT, FRONT, REAR, WHEELBASE, Pair, make_pair

PRIOR = RelativePrior(0.45, 0.03, math.pi / 4, 0.05, 0.0, 0.05)
STRAIGHT = WheelMotion(4.0, 0.0)


def make(kind: str = "ukf") -> RelativeFilter:
    chosen = Settings().model_copy(update={"kind": kind})
    return make_relative_filter(chosen, WHEELBASE, WHEELBASE, PRIOR)


def drive(
    f: RelativeFilter,
    leader: WheelMotion,
    following: WheelMotion | Callable[[Pair], WheelMotion],
    markers: tuple[Point, ...],
    seconds: float,
) -> list[float]:
    """Standard deviations of the range [m] over time; own markers are those of the leader."""
    pair, stds = make_pair(seed=1), []
    for _ in range(round(seconds / DT)):
        own = following if isinstance(following, WheelMotion) else following(pair)
        pair.move(own, leader)
        f.predict(DT, own, leader)
        for marker in markers:
            seen = pair.own.bearing(pair.leader.place(marker)) + pair.random.gauss(0.0, 0.05)
            f.update_leader_marker(seen, 0.05, marker, 0.0)
            back = pair.leader.bearing(pair.own.place(marker)) + pair.random.gauss(0.0, 0.05)
            f.update_mutual(back, 0.05, marker, 0.0)
        stds.append(f.estimate().range_std_m)
    return stds


def test_one_marker_on_a_straight_never_makes_the_range_look_better_known() -> None:
    f = make()
    stds = drive(f, STRAIGHT, STRAIGHT, (FRONT,), 20.0)
    assert not f.range_told
    assert all(later >= earlier for earlier, later in pairwise(stds))
    assert stds[-1] > 0.1


def test_one_rear_marker_alone_is_no_better() -> None:
    f = make()
    drive(f, STRAIGHT, STRAIGHT, (REAR,), 2.0)
    assert not f.range_told


def test_two_markers_seen_apart_tell_the_range() -> None:
    f = make()
    stds = drive(f, STRAIGHT, STRAIGHT, (FRONT, REAR), 5.0)
    assert f.range_told
    assert stds[-1] < 0.015


def test_a_turning_line_of_sight_tells_the_range_to_one_marker() -> None:
    """The formation turns as one body, at the paper's 60 deg/s: q is 12 % of the speed."""
    f = make()
    turning = WheelMotion(4.0, math.asin(math.pi / 3 * WHEELBASE / 4.0))
    place = Point(x_m=-0.45 / math.sqrt(2), y_m=-0.45 / math.sqrt(2))

    def keep_place(pair: Pair) -> WheelMotion:
        belief = RelativeBelief(*pair.truth(), 0.0, (0.0,) * 16)
        forward, left = leader_frame_velocity(belief, turning, WHEELBASE, place, 4.0)
        return WheelMotion(math.hypot(forward, left), math.atan2(left, forward))

    stds = drive(f, turning, keep_place, (FRONT,), 5.0)
    assert f.range_told
    assert stds[-1] < 0.06


def test_a_standing_robot_learns_no_range_from_one_marker() -> None:
    f = make()
    still = WheelMotion(0.0, 0.0)
    stds = drive(f, still, still, (FRONT,), 2.0)
    assert not f.range_told
    assert stds[-1] > stds[0]


def test_without_information_on_the_range_the_numbers_are_still_filterpys() -> None:
    own, reference = make(), make("reference")
    weave = WheelMotion(3.9, 0.02)
    drive(own, STRAIGHT, weave, (FRONT,), 1.0)
    drive(reference, STRAIGHT, weave, (FRONT,), 1.0)
    (*a, p), (*b, q) = own.estimate(), reference.estimate()
    assert np.max(np.abs(np.array([*a, *p]) - np.array([*b, *q]))) < 1e-9


@settings(max_examples=25, deadline=None)
@given(
    moves=st.lists(
        st.tuples(
            st.floats(0.0, 8.0),
            st.floats(-1.2, 1.2),
            st.floats(0.0, 8.0),
            st.floats(-1.2, 1.2),
            st.floats(-math.pi, math.pi),
            st.floats(1e-3, 1.0),
            st.floats(0.0, 0.3),
            st.sampled_from((FRONT, REAR)),
            st.booleans(),
        ),
        min_size=5,
        max_size=60,
    )
)
def test_the_covariance_is_symmetric_and_positive_definite_whatever_comes(
    moves: list[tuple[float, float, float, float, float, float, float, Point, bool]],
) -> None:
    f = make()
    for speed, steering, leader_speed, leader_steering, bearing, std, age, marker, mutual in moves:
        f.predict(DT, WheelMotion(speed, steering), WheelMotion(leader_speed, leader_steering))
        update = f.update_mutual if mutual else f.update_leader_marker
        update(bearing, std, marker, age)
        matrix = np.reshape(f.estimate().covariance, (4, 4))
        scaled = matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        assert np.all(matrix == matrix.T)
        assert np.linalg.eigvalsh(scaled)[0] > 0.0
        assert f.estimate().range_m > 0.0


@pytest.mark.parametrize("phi", [0.02, math.pi / 4])
def test_markers_on_the_line_of_sight_count_as_one(phi: float) -> None:
    prior = PRIOR._replace(bearing_rad=phi)
    f = make_relative_filter(Settings(), WHEELBASE, WHEELBASE, prior)
    pair = make_pair(seed=2, phi=phi)
    for _ in range(50):
        pair.move(STRAIGHT, STRAIGHT)
        f.predict(DT, STRAIGHT, STRAIGHT)
        pair.observe(f)
    assert f.range_told == (phi > 0.5)
