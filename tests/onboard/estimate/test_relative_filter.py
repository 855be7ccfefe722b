"""The follower's filter finds its leader, stays consistent, and agrees with filterpy."""

import math
import random
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from config.fleet import RelativeFilter as Settings
from onboard.control.formation import leader_frame_velocity
from onboard.estimate.beliefs import RelativeBelief, RelativeFilter, RelativePrior
from onboard.estimate.cholesky4 import cholesky4
from onboard.estimate.factory import make_relative_filter
from onboard.model.vehicle import WheelMotion
from tests.onboard.estimate.pair import DT, FRONT, REAR, WHEELBASE, Pair, make_pair

STILL = WheelMotion(0.0, 0.0)
GOOD = RelativePrior(0.45, 0.1, math.pi / 4, 0.1, 0.0, 0.1)


def make(
    prior: RelativePrior = GOOD, kind: str = "ukf", chosen: Settings | None = None
) -> RelativeFilter:
    chosen = (chosen or Settings()).model_copy(update={"kind": kind})
    return make_relative_filter(chosen, WHEELBASE, WHEELBASE, prior)


def scaled(motion: WheelMotion, error: float) -> WheelMotion:
    """What an odometer with this scale error reports."""
    return WheelMotion(motion.speed_mps * (1.0 + error), motion.steering_rad)


def follow(belief: RelativeBelief, leader: WheelMotion) -> WheelMotion:
    """Ideal actuation of the leader-frame law at (-0.318, -0.318)."""
    offset = REAR.model_copy(update={"x_m": -0.45 / math.sqrt(2), "y_m": -0.45 / math.sqrt(2)})
    forward, left = leader_frame_velocity(belief, leader, WHEELBASE, offset, 2.0)
    return WheelMotion(math.hypot(forward, left), math.atan2(left, forward))


def errors(belief: RelativeBelief, pair: Pair) -> tuple[float, float, float]:
    rho, phi, alpha = pair.truth()
    return (
        belief.range_m - rho,
        math.remainder(belief.bearing_rad - phi, math.tau),
        math.remainder(belief.heading_rad - alpha, math.tau),
    )


def is_positive_definite(belief: RelativeBelief) -> bool:
    matrix = np.reshape(belief.covariance, (4, 4))
    return bool(np.all(matrix == matrix.T) and np.linalg.eigvalsh(matrix)[0] > 0.0)


@pytest.mark.parametrize("speed", [0.4, 4.0])
def test_range_holds_on_a_long_straight_with_odometry_scale_errors(speed: float) -> None:
    """Where one bearing leaves the range unobservable: 60 s, opposite 1 % scale errors.

    The leader reports 1 % too little; the follower's odometer shows 1 % too much, and its drive
    regulates what the odometer shows.
    """
    pair, f = make_pair(seed=5), make()
    leader = WheelMotion(speed, 0.0)
    range_errors, nis = [], []
    for step in range(6000):
        own = follow(f.estimate(), scaled(leader, -0.01))
        pair.move(scaled(own, 1 / 1.01 - 1), leader)
        f.predict(DT, own, scaled(leader, -0.01))
        nis += pair.observe(f)
        if step >= 5000:
            range_errors.append(errors(f.estimate(), pair)[0])
    assert math.sqrt(sum(e * e for e in range_errors) / len(range_errors)) < 0.02
    assert sum(nis) / len(nis) == pytest.approx(1.0, abs=0.08)
    scale_std = math.sqrt(f.estimate().covariance[15])
    assert f.estimate().speed_scale == pytest.approx(1.01 / 0.99 - 1, abs=3 * scale_std)
    assert pair.truth()[0] == pytest.approx(0.45, abs=0.05)


def test_speed_scale_is_learnt() -> None:
    pair, f = make_pair(seed=2), make()
    for _ in range(1000):
        leader = WheelMotion(2.0, 0.05)
        own = follow(f.estimate(), scaled(leader, -0.03))
        pair.move(own, leader)
        f.predict(DT, own, scaled(leader, -0.03))
        pair.observe(f)
    assert f.estimate().speed_scale == pytest.approx(1 / 0.97 - 1, abs=0.006)


@settings(max_examples=15, deadline=None)
@example(rho=1.2, phi=0.5, side=1, wrong_heading=-0.5, factor=2.0, seed=0)
@given(
    rho=st.floats(0.3, 1.2),
    phi=st.floats(0.5, 1.2),
    side=st.sampled_from((-1, 1)),
    wrong_heading=st.sampled_from((-0.5, 0.5)),
    factor=st.sampled_from((0.5, 2.0)),
    seed=st.integers(0, 1000),
)
def test_a_standing_pair_recovers_from_a_bad_prior(
    rho: float, phi: float, side: int, wrong_heading: float, factor: float, seed: int
) -> None:
    pair = make_pair(seed, rho, side * phi, 0.1)
    prior = RelativePrior(
        rho * factor, rho * factor / 2, side * phi + 0.1, 0.3, 0.1 + wrong_heading, 0.5
    )
    f = make(prior)
    for _ in range(300):
        pair.move(STILL, STILL)
        f.predict(DT, STILL, STILL)
        pair.observe(f)
    belief = f.estimate()
    range_error, bearing_error, heading_error = errors(belief, pair)
    assert abs(range_error) < 4 * belief.range_std_m + 0.01
    assert abs(range_error) < 0.15 * max(rho, 1.0)
    assert abs(bearing_error) < 0.06
    assert abs(heading_error) < 0.06
    assert is_positive_definite(belief)


@pytest.mark.parametrize("phi", [math.pi - 1e-3, -math.pi + 1e-3])
def test_angles_cross_pi_without_a_jump(phi: float) -> None:
    """The leader is behind, both bearings and headings straddle +-pi."""
    pair = make_pair(seed=3, rho=0.6, phi=phi, alpha=math.pi)
    f = make(RelativePrior(0.6, 0.1, math.remainder(phi + 0.02, math.tau), 0.1, -3.1, 0.1))
    for step in range(400):
        own = WheelMotion(0.5, 0.2 * math.sin(step / 20))
        pair.move(own, STILL)
        f.predict(DT, own, STILL)
        pair.observe(f)
        assert max(abs(e) for e in errors(f.estimate(), pair)[1:]) < 0.15
        assert -math.pi < f.estimate().bearing_rad <= math.pi


def test_late_bearings_are_used_at_their_capture_time() -> None:
    """Turning at 4 m/s, 30 ms late: without the age the line of sight is off by a tenth."""

    def rms(told_age: bool) -> float:
        pair, f = make_pair(seed=8), make()
        leader, own, squares = WheelMotion(4.0, 0.0), WheelMotion(3.0, 0.15), []
        for step in range(20):
            pair.move(own, leader)
            f.predict(DT, own, leader)
            if step < 3:
                continue
            seen_leader, seen_from = pair.past[-3]
            bearing = seen_from.bearing(seen_leader.place(FRONT))
            f.update_leader_marker(bearing, 0.01, FRONT, 0.03 if told_age else 0.0)
            squares.append(errors(f.estimate(), pair)[1] ** 2)
        return math.sqrt(sum(squares) / len(squares))

    assert rms(told_age=True) < 0.01
    assert rms(told_age=False) > 5 * rms(told_age=True)


def test_an_outlier_is_gated_and_counted_and_changes_nothing() -> None:
    f = make()
    for _ in range(50):
        f.predict(DT, STILL, STILL)
        f.update_leader_marker(math.pi / 4, 0.05, FRONT, 0.0)
    before = f.estimate()
    innovation = f.update_leader_marker(-2.0, 0.05, FRONT, 0.0)
    assert not innovation.accepted
    assert innovation.nis > Settings().gate_nis
    assert f.estimate() == before
    f.update_mutual(math.nan, 0.05, FRONT, 0.0)
    assert (f.rejected, f.rejected_in_a_row) == (2, 2)
    assert f.update_leader_marker(math.pi / 4, 0.05, FRONT, 0.0).accepted
    assert (f.rejected, f.rejected_in_a_row) == (2, 0)


def test_the_range_stays_positive_when_sigma_points_pass_through_the_leader() -> None:
    f = make(RelativePrior(0.05, 0.5, 0.0, 1.0, 0.0, 0.5))
    for bearing in (3.0, -3.0, 0.5, 2.0):
        f.predict(DT, WheelMotion(4.0, 0.3), STILL)
        f.update_leader_marker(bearing, 0.05, REAR, 0.0)
        assert f.estimate().range_m > 0.0
        assert is_positive_definite(f.estimate())


@settings(max_examples=50)
@given(values=st.lists(st.floats(-3, 3), min_size=16, max_size=16))
def test_cholesky_agrees_with_numpy(values: list[float]) -> None:
    a = np.reshape(values, (4, 4))
    p = a @ a.T + 0.1 * np.eye(4)
    lower = np.tril_indices(4)
    q = p[lower].tolist()
    factor = cholesky4((q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], q[8], q[9]))
    assert factor == pytest.approx(tuple(np.linalg.cholesky(p)[lower].tolist()), abs=1e-9)


def test_a_broken_covariance_is_refused() -> None:
    with pytest.raises(ArithmeticError, match="not positive definite: pivot 1"):
        cholesky4((1.0, 2.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))


def test_a_covariance_that_rounding_has_made_singular_is_factored() -> None:
    singular = (4.0, 2.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    factor = np.zeros((4, 4))
    factor[np.tril_indices(4)] = cholesky4(singular)
    expected = np.zeros((4, 4))
    expected[np.tril_indices(4)] = singular
    assert np.tril(factor @ factor.T) == pytest.approx(expected, abs=1e-11)
    assert factor[1, 1] > 0.0


def run_both(observe: Callable[[Pair, RelativeFilter], list[float]]) -> float:
    """Greatest difference between the two kinds over two seconds of a lively drive."""
    worst = 0.0
    pairs = [make_pair(seed=4), make_pair(seed=4)]
    filters = [make(), make(kind="reference")]
    inputs = random.Random(9)
    for _ in range(200):
        own = WheelMotion(inputs.uniform(0.5, 2.0), inputs.uniform(-0.3, 0.3))
        leader = WheelMotion(inputs.uniform(0.5, 2.0), inputs.uniform(-0.3, 0.3))
        nis = []
        for pair, f in zip(pairs, filters, strict=True):
            pair.move(own, leader)
            f.predict(DT, own, leader)
            nis.append(observe(pair, f))
        (*a, p), (*b, q) = (f.estimate() for f in filters)
        differences = np.array([*a, *p, *nis[0]]) - np.array([*b, *q, *nis[1]])
        worst = max(worst, float(np.max(np.abs(differences))))
    assert filters[0].rejected == filters[1].rejected
    return worst


def test_the_filter_gives_filterpys_numbers() -> None:
    assert run_both(lambda pair, f: pair.observe(f)) < 1e-9


def test_the_filter_gives_filterpys_numbers_when_bearings_are_gated() -> None:
    def observe(pair: Pair, f: RelativeFilter) -> list[float]:
        wrong = f.update_leader_marker(-2.0, 0.05, FRONT, 0.0).nis
        return [wrong, *pair.observe(f)]

    assert run_both(observe) < 1e-9


def test_the_default_filter_loads_neither_filterpy_nor_scipy() -> None:
    code = (
        "import sys, onboard.estimate.factory, onboard.estimate.localiser_particle;"
        "sys.exit(any(m.split('.')[0] in ('filterpy', 'scipy') for m in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
