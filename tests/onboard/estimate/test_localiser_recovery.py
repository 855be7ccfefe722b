"""The default localiser carried elsewhere, with outliers, a biased sensor, gaps, late bearings."""

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np
import pytest

from onboard.estimate.beliefs import PoseBelief
from onboard.estimate.localiser_gaussian import GaussianLocaliser
from tests.onboard.estimate.localised import (
    SQUARE,
    Robot,
    drive,
    localiser_of,
    lost_robot,
    wander,
)
from tests.onboard.estimate.pair import Body


def rms(robot: Robot, beliefs: Iterator[PoseBelief | None]) -> float:
    """Of the position error, while the beliefs come."""
    errors = [robot.error_m(belief) for belief in beliefs if belief is not None]
    return math.sqrt(float(np.mean(np.square(errors))))


def last(beliefs: Iterator[PoseBelief | None]) -> PoseBelief:
    """Drive to the end; the belief there."""
    belief = list(beliefs)[-1]
    assert belief is not None
    return belief


def test_a_robot_carried_elsewhere_says_that_it_is_lost_and_finds_itself_again() -> None:
    robot = lost_robot(1, SQUARE)
    localiser = localiser_of(robot)
    assert rms(robot, drive(robot, localiser, 4.0)) < 0.1
    robot.body, robot.past = Body(-1.5, 2.0, robot.body.heading + 2.0), type(robot.past)()
    lost_s = found_s = math.inf
    for _ in drive(robot, localiser, 10.0):
        trust = localiser.trust()
        if not trust.trusted and lost_s == math.inf:
            lost_s = robot.time_s
            assert trust.lost
            assert "do not fit; was the robot carried away" in trust.reason
            assert localiser.estimate() is None
        if trust.trusted and lost_s < math.inf:
            assert _error(robot, localiser) < 0.3
            assert not trust.lost
            found_s = min(found_s, robot.time_s)
    assert lost_s < 6.0
    assert found_s < 12.0


def test_every_fifth_bearing_wrong_does_little_harm() -> None:
    clean, wild = (lost_robot(2, SQUARE) for _ in range(2))
    wild.outliers = 0.2
    best = rms(clean, drive(clean, localiser_of(clean), 8.0))
    localiser = localiser_of(wild)
    assert rms(wild, drive(wild, localiser, 8.0)) < 1.5 * best
    assert localiser.trust().trusted
    assert localiser.trust().rejected > 200


def test_outliers_at_the_start_do_not_make_up_a_pose() -> None:
    robot = lost_robot(6, SQUARE)
    robot.outliers = 0.1
    localiser = localiser_of(robot, start="unknown")
    for _ in drive(robot, localiser, 10.0):
        if localiser.trust().trusted:
            assert _error(robot, localiser) < 0.3
    assert localiser.trust().trusted


def test_a_landmark_that_was_moved_is_refused_while_the_others_agree() -> None:
    robot = lost_robot(8, SQUARE)
    localiser = localiser_of(robot)
    robot.landmarks = {**SQUARE, 3: (-6.0, 1.0)}
    assert rms(robot, drive(robot, localiser, 8.0)) < 0.1
    assert localiser.trust().trusted
    assert localiser.trust().rejected > 300


@pytest.mark.parametrize("bias", [0.014, -0.014])
@pytest.mark.parametrize("mounting", ["body", "fork"])
def test_a_bias_is_found_where_the_fleet_file_allows_for_one(
    bias: float, mounting: Literal["body", "fork"]
) -> None:
    """The course tells it from a turned robot; the better sensor and odometry are, the sooner."""
    robot = lost_robot(3, SQUARE)
    robot.bias, robot.mounting, robot.std = bias, mounting, 0.01
    localiser = localiser_of(
        robot, bias_std_rad=0.01, position_noise_m=0.005, heading_noise_rad=0.01
    )
    belief = last(drive(robot, localiser, 10.0, 1.0))
    assert localiser.trust().bias_rad == pytest.approx(bias, abs=0.005)
    assert robot.sigmas(belief) < 4.0
    assert robot.error_m(belief) < 0.05


def test_a_bias_that_nothing_allows_for_costs_accuracy_but_not_the_pose() -> None:
    for bias in (0.014, -0.014):
        robot = lost_robot(3, SQUARE)
        robot.bias = bias
        localiser = localiser_of(robot)
        assert rms(robot, drive(robot, localiser, 6.0)) < 0.15
        assert localiser.trust().trusted
        assert localiser.trust().bias_rad == 0.0


def test_in_a_gap_the_deviation_grows_and_bearings_after_it_end_that() -> None:
    robot = lost_robot(4, SQUARE)
    localiser = localiser_of(robot)
    before_m = _std(last(drive(robot, localiser, 3.0)))
    blind = last(drive(robot, localiser, 8.0, only=()))
    assert _std(blind) > 3.0 * before_m
    assert robot.sigmas(blind) < 3.0
    assert localiser.trust().trusted, "no bearing speaks against the pose"
    after = last(drive(robot, localiser, 1.0))
    assert _std(after) < _std(blind) / 3.0
    assert robot.sigmas(after) < 4.0
    assert localiser.trust().rejected == 0


@pytest.mark.parametrize("late_steps", [2, 5, 10])
def test_late_bearings_cost_little(late_steps: int) -> None:
    """0.2 s at 1.5 m/s with a swinging fork is 0.3 m and 0.3 rad."""
    prompt, late = (lost_robot(5, SQUARE) for _ in range(2))
    best = rms(prompt, drive(prompt, localiser_of(prompt), 6.0, 1.5))
    localiser = localiser_of(late)
    got = rms(late, drive(late, localiser, 6.0, 1.5, late_steps=late_steps))
    assert got < best + 0.02
    assert localiser.trust().rejected == 0


@pytest.mark.parametrize("mounting", ["body", "fork"])
def test_bearings_out_of_order_are_each_met_at_their_capture(
    mounting: Literal["body", "fork"],
) -> None:
    robot = lost_robot(5, SQUARE)
    robot.mounting = mounting
    localiser = localiser_of(robot)
    errors = []
    for step in range(300):
        robot.move(localiser, 1.5, wander(robot, 1.5))
        for late_steps in (0, 7) if step % 3 else (4, 1):
            localiser.update(robot.look(late_steps, only=(1 + step % 4,)))
        errors.append(_error(robot, localiser))
    assert math.sqrt(float(np.mean(np.square(errors)))) < 0.12
    assert localiser.trust().rejected == 0


def test_a_search_takes_late_bearings_too() -> None:
    robot = lost_robot(9, SQUARE)
    localiser = localiser_of(robot, start="unknown")
    assert last(drive(robot, localiser, 4.0, 1.5, late_steps=5)) is not None
    assert localiser.trust().trusted
    assert _error(robot, localiser) < 0.2


def _error(robot: Robot, localiser: GaussianLocaliser) -> float:
    belief = localiser.estimate()
    assert belief is not None
    return robot.error_m(belief)


def _std(belief: PoseBelief | None) -> float:
    assert belief is not None
    return math.sqrt(belief.covariance[0] + belief.covariance[5])
