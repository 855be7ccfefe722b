"""The default localiser's covariance: as large as the error is, symmetric positive definite."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.fleet import Localiser, Pose
from onboard.estimate.localiser import LandmarkBearing
from onboard.estimate.localiser_gaussian import GaussianLocaliser
from tests.onboard.estimate.localised import (
    SQUARE,
    Robot,
    covariance_of,
    drive,
    localiser_of,
)
from tests.onboard.estimate.pair import Body

NOISE = 0.05
START_STD = 0.05


def run(seed: int, count: int, seconds: float) -> list[tuple[float, float, float]]:
    """Per second: squared position error, variance claimed for it, and NEES (4)."""
    rng = np.random.default_rng(seed)
    landmarks = {number: SQUARE[number] for number in range(1, count + 1)}
    robot = Robot(landmarks, rng, Body(0.0, 0.0, 0.5), noise=(NOISE, NOISE), std=0.05)
    localiser = localiser_of(robot)
    body = robot.body
    body.x, body.y, body.heading = rng.normal((0.0, 0.0, 0.5), START_STD).tolist()
    rows = []
    for step, belief in enumerate(drive(robot, localiser, seconds), start=1):
        if step % 50 == 0:
            assert belief is not None
            claimed = belief.covariance[0] + belief.covariance[5]
            rows.append((robot.error_m(belief) ** 2, claimed, robot.nees(belief)))
    return rows


@pytest.mark.parametrize("count", [0, 1])
def test_with_too_few_landmarks_the_claimed_deviation_grows_as_the_error_does(count: int) -> None:
    runs = np.array([run(seed, count, 10.0) for seed in range(10)])
    error, claimed = np.sqrt(runs.mean(axis=0)[:, :2]).T
    assert claimed[-1] > 2.0 * claimed[0]
    assert error[-1] > 2.0 * error[0]
    late = slice(4, None)
    assert 0.6 < float(np.mean(error[late] / claimed[late])) < 1.4
    assert 2.5 < float(runs[:, :, 2].mean()) < 6.0


def test_with_three_landmarks_the_error_is_what_is_claimed_and_stays_small() -> None:
    runs = np.array([run(seed, 3, 4.0) for seed in range(12)])
    error, claimed = np.sqrt(runs.mean(axis=(0, 1))[:2])
    assert error == pytest.approx(claimed, rel=0.25)
    assert claimed < 0.12
    assert 3.0 < float(runs[:, :, 2].mean()) < 5.0


def test_a_fleet_without_landmarks_drives_on_odometry_and_trusts_its_known_start() -> None:
    robot = Robot({}, np.random.default_rng(1), Body(1.0, 2.0, 0.3))
    localiser = localiser_of(robot)
    belief = list(drive(robot, localiser, 5.0))[-1]
    assert belief is not None
    assert localiser.trust().trusted
    assert robot.error_m(belief) < 0.05
    assert robot.sigmas(belief) < 2.0


@st.composite
def looks(draw: st.DrawFn) -> tuple[float, float, list[tuple[int, float, float]]]:
    """A motion, and bearings of any direction, deviation and age after it."""
    seen = st.tuples(
        st.integers(1, 4),
        st.floats(-math.pi, math.pi),
        st.floats(0.0, 0.6),
    )
    return draw(st.floats(-4.0, 4.0)), draw(st.floats(-5.0, 5.0)), draw(st.lists(seen, max_size=4))


@given(
    steps=st.lists(looks(), min_size=1, max_size=25),
    std_rad=st.sampled_from([1e-4, 0.05, 1.0]),
    bias_std_rad=st.sampled_from([0.0, 0.01]),
    gate_nis=st.sampled_from([9.0, 1e12]),
)
@settings(max_examples=40, deadline=None)
def test_the_covariance_is_symmetric_positive_definite_whatever_is_seen(
    steps: Sequence[tuple[float, float, list[tuple[int, float, float]]]],
    std_rad: float,
    bias_std_rad: float,
    gate_nis: float,
) -> None:
    chosen = Localiser(bias_std_rad=bias_std_rad, gate_nis=gate_nis)
    localiser = GaussianLocaliser(chosen, 0.25, "body", SQUARE, Pose(x_m=0.0, y_m=0.0))
    for speed, rate, seen in steps:
        localiser.predict(0.02, speed, rate)
        localiser.measure_steering(0.1)
        localiser.update([LandmarkBearing(n, bearing, std_rad, age) for n, bearing, age in seen])
        belief = localiser.estimate()
        if belief is None:
            return
        matrix = covariance_of(belief)
        assert matrix == pytest.approx(matrix.T, rel=1e-12)
        assert float(np.linalg.eigvalsh(matrix).min()) > 0.0
