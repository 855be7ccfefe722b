"""From nothing: where the robot is, found from bearings, and not believed before they tell."""

import math
from typing import Literal

import numpy as np
import pytest

from onboard.estimate.localiser_gaussian import GaussianLocaliser
from tests.onboard.estimate.localised import (
    DT,
    SQUARE,
    Landmarks,
    Robot,
    drive,
    localiser_of,
    lost_robot,
)
from tests.onboard.estimate.pair import Body

TRIANGLE = {1: (4.0, 0.0), 2: (-2.0, 4.0), 3: (-2.0, -4.0)}
SIDE = {1: (6.0, 2.0), 2: (7.0, -1.0), 3: (5.0, -4.0)}
IN_LINE = {1: (-4.0, 4.0), 2: (0.5, 4.0), 3: (5.0, 4.0)}
PARALLEL = {1: (6.0, -2.0), 2: (6.0, 2.0), 3: (-6.0, -2.0), 4: (-6.0, 2.0)}


def search(
    robot: Robot, seconds: float, speed: float, localiser: GaussianLocaliser | None = None
) -> float | None:
    """When the robot trusted its pose; asserts that no trusted pose is wrong."""
    localiser = localiser or localiser_of(robot, start="unknown")
    since_s = None
    for belief in drive(robot, localiser, seconds, speed):
        if not localiser.trust().trusted:
            continue
        assert belief is not None
        since_s = robot.time_s if since_s is None else since_s
        off, sigmas = robot.error_m(belief), robot.sigmas(belief)
        assert off <= 0.3 or sigmas <= 4.0, f"{off:.2f} m off, {sigmas:.1f} sigma"
    return since_s


@pytest.mark.parametrize("landmarks", [TRIANGLE, SIDE, IN_LINE, PARALLEL])
@pytest.mark.parametrize("mounting", ["body", "fork"])
def test_driving_finds_the_pose_within_ten_seconds(
    landmarks: Landmarks, mounting: Literal["body", "fork"]
) -> None:
    robot = lost_robot(5, landmarks)
    robot.mounting = mounting
    assert search(robot, 10.0, 0.5) is not None


@pytest.mark.parametrize("seed", range(3))
def test_standing_with_the_encoder_finds_the_pose_within_ten_seconds(seed: int) -> None:
    robot = lost_robot(seed, SQUARE)
    robot.steering = 0.3
    localiser = localiser_of(robot, start="unknown")
    assert search(robot, 6.0, 0.0, localiser) is not None
    belief = localiser.estimate()
    assert belief is not None
    assert robot.error_m(belief) < 0.2
    assert belief.fork_rad - belief.heading_rad == pytest.approx(0.3, abs=0.02)
    assert math.remainder(belief.heading_rad - robot.body.heading, math.tau) == pytest.approx(
        0.0, abs=0.05
    )


def test_two_landmarks_are_enough_for_a_robot_that_drives_but_not_for_one_that_stands() -> None:
    pair = {number: SQUARE[number] for number in (1, 2)}
    robot = lost_robot(2, pair)
    localiser = localiser_of(robot, start="unknown")
    assert search(robot, 3.0, 0.0, localiser) is None
    assert "drive on" in localiser.trust().reason
    assert search(robot, 15.0, 1.0, localiser) is not None


def test_one_landmark_is_never_enough_and_that_is_said() -> None:
    robot = lost_robot(3, {1: (4.0, 3.0)})
    localiser = localiser_of(robot, start="unknown")
    assert search(robot, 6.0, 0.5, localiser) is None
    assert localiser.trust().reason == (
        "no pose: 1 landmark seen, 2 needed, 3 for a robot that stands"
    )
    assert localiser.estimate() is None


def test_a_robot_that_stands_in_line_with_its_landmarks_waits_until_it_has_driven() -> None:
    row = {1: (4.0, 0.0), 2: (8.0, 0.0), 3: (-6.0, 0.0)}
    robot = lost_robot(1, row)
    robot.body = Body(0.0, 0.0, 0.7)
    localiser = localiser_of(robot, start="unknown")
    assert search(robot, 3.0, 0.0, localiser) is None
    assert search(robot, 10.0, 0.5, localiser) is not None


def test_a_robot_on_the_circle_through_its_landmarks_believes_no_place_on_it() -> None:
    """Every place on that circle sees the same angles between the three."""
    angles = (0.3, 2.0, 4.4)
    circle = {i: (5 * math.cos(a), 5 * math.sin(a)) for i, a in enumerate(angles, start=1)}
    for off_m in (0.0, 0.1, -0.3):
        robot = lost_robot(7, circle)
        robot.body = Body((5 + off_m) * math.cos(5.5), (5 + off_m) * math.sin(5.5), 1.0)
        search(robot, 4.0, 0.0)


def test_a_trusted_pose_is_right_wherever_three_landmarks_are() -> None:
    """A sample of random geometries; 64 is the geometry that once fooled it."""
    for seed in (64, 138, 188, *range(12)):
        rng = np.random.default_rng(seed)
        landmarks: dict[int, tuple[float, float]] = {
            number: (rng.uniform(-6, 6), rng.uniform(-6, 6)) for number in (1, 2, 3)
        }
        x, y = rng.uniform(-5, 5, 2).tolist()
        body = Body(x, y, rng.uniform(-math.pi, math.pi))
        robot = Robot(landmarks, rng, body, steering=rng.uniform(-0.5, 0.5))
        search(robot, 3.5, 0.0)


def test_the_time_of_trust_is_the_localisers_own() -> None:
    robot = lost_robot(4, SQUARE)
    localiser = localiser_of(robot, start="unknown")
    found_s = search(robot, 4.0, 0.5, localiser)
    assert found_s is not None
    assert localiser.trust().since_s == pytest.approx(found_s, abs=DT)
