"""The particle filter finds the leader on the paper's mission and says when it cannot."""

import math
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.fleet import Localiser, Pose
from onboard.estimate.localiser import LandmarkBearing, UpdateOutcome
from onboard.estimate.localiser_particle import ParticleLocaliser, systematic_resample
from onboard.model.vehicle import WheelMotion
from tests.onboard.estimate.pair import DT, STD, WHEELBASE, Body

LANDMARKS = {1: (10.0, -3.0), 2: (-6.0, -8.0), 3: (3.0, 5.0), 4: (3.0, -20.0)}
START = Pose(x_m=0.0, y_m=0.0, heading_rad=math.pi / 4)


def make(
    mounting: Literal["body", "fork"] = "body", seed: int = 1, **settings: float
) -> ParticleLocaliser:
    chosen = Localiser.model_validate(settings)
    return ParticleLocaliser(chosen, WHEELBASE, mounting, LANDMARKS, START, seed)


def bearings(body: Body, steering: float = 0.0, age_s: float = 0.0) -> list[LandmarkBearing]:
    return [
        LandmarkBearing(k, math.remainder(body.bearing(p) - steering, math.tau), STD, age_s)
        for k, p in LANDMARKS.items()
    ]


def paper_steering(t: float, delta: float) -> float:
    """Rate of the steering angle that turns the fork as the paper's schedule says."""
    omega = -math.pi / 3 if t < 4.0 else math.pi / 3 if t < 7.0 else 0.0
    return omega - 4.0 * math.sin(delta) / WHEELBASE


def paper_mission(
    mounting: Literal["body", "fork"], seed: int, latency_steps: int = 1
) -> tuple[float, float]:
    """RMSE of position [m] and heading [rad]: 4 m/s, 1 % scale error, encoder and bearing noise."""
    rng = np.random.default_rng(seed)
    localiser, body, delta, encoder = make(mounting, seed), Body(0.0, 0.0, math.pi / 4), 0.0, 0.0
    past: list[tuple[Body, float]] = []
    position, heading = [], []
    for i in range(900):
        past.append((Body(**vars(body)), delta))
        new = delta + paper_steering(i * DT, delta) * DT
        body.move(WheelMotion(4.0, (delta + new) / 2), DT)
        delta = new
        reading = delta + rng.normal(0.0, 0.001)
        localiser.predict(DT, 4.0 * 1.01, (reading - encoder) / DT)
        encoder = reading
        seen, fork = past[-min(latency_steps, len(past))]
        taken = bearings(
            seen, fork if mounting == "fork" else 0.0, min(latency_steps, len(past)) * DT
        )
        localiser.update(
            [b._replace(bearing_rad=b.bearing_rad + rng.normal(0, STD)) for b in taken]
        )
        belief = localiser.estimate()
        if i >= 50:
            position.append((belief.x_m - body.x) ** 2 + (belief.y_m - body.y) ** 2)
            heading.append(math.remainder(belief.heading_rad - body.heading, math.tau) ** 2)
    return math.sqrt(float(np.mean(position))), math.sqrt(float(np.mean(heading)))


@pytest.mark.parametrize("mounting", ["body", "fork"])
def test_four_landmarks_hold_the_leader_within_nine_centimetres(
    mounting: Literal["body", "fork"],
) -> None:
    runs = [paper_mission(mounting, seed) for seed in (11, 12)]
    assert all(position < 0.09 for position, _ in runs)
    assert all(heading < 0.03 for _, heading in runs)


def test_late_bearings_are_compared_with_where_the_robot_was() -> None:
    """4 m/s, 50 ms late: 20 cm."""
    position, _ = paper_mission("body", 13, latency_steps=5)
    assert position < 0.1


def test_without_landmarks_the_robot_drives_as_its_odometry_says() -> None:
    localiser = make(position_noise_m=1e-9, heading_noise_rad=1e-9, start_std_m=1e-9,
                     start_std_rad=1e-9)  # fmt: skip
    body, delta = Body(0.0, 0.0, math.pi / 4), 0.0
    for i in range(900):
        rate = paper_steering(i * DT, delta)
        body.move(WheelMotion(4.0, delta + rate * DT / 2), DT)
        localiser.predict(DT, 4.0, rate)
        delta += rate * DT
    belief = localiser.estimate()
    assert (belief.x_m, belief.y_m) == pytest.approx((body.x, body.y), abs=2e-3)
    assert belief.fork_rad - belief.heading_rad == pytest.approx(delta, abs=1e-6)


def test_the_same_seed_gives_the_same_run_and_leaves_the_global_generator_alone() -> None:
    def run(seed: int) -> object:
        localiser, body = make(seed=seed), Body(0.0, 0.0, math.pi / 4)
        for _ in range(50):
            localiser.predict(DT, 0.0, 0.0)
            localiser.update(bearings(body))
        return localiser.estimate()

    np.random.seed(7)
    untouched = np.random.random()
    np.random.seed(7)
    assert run(3) == run(3)
    assert run(3) != run(4)
    assert np.random.random() == untouched


def test_unknown_landmarks_are_named() -> None:
    localiser = make()
    known = bearings(Body(0.0, 0.0, math.pi / 4))
    result = localiser.update([LandmarkBearing(99, 0.0, STD, 0.0), *known])
    assert result.unknown_ids == (99,)
    assert result.outcome in (UpdateOutcome.UPDATED, UpdateOutcome.RESAMPLED)
    only_unknown = localiser.update([LandmarkBearing(99, 0.0, STD, 0.0)])
    assert only_unknown.outcome is UpdateOutcome.NO_BEARINGS
    assert localiser.update([]).outcome is UpdateOutcome.NO_BEARINGS


def test_a_lost_robot_says_so_and_keeps_its_belief() -> None:
    localiser = make()
    before = localiser.estimate()
    turned = bearings(Body(0.0, 0.0, math.pi / 4 + 2.0))
    assert localiser.update(turned).outcome is UpdateOutcome.DIVERGED
    assert localiser.update(
        [b._replace(bearing_rad=math.nan) for b in turned]
    ).outcome is UpdateOutcome.DIVERGED  # fmt: skip
    assert localiser.estimate() == before


def test_tiny_likelihoods_do_not_underflow_to_nothing() -> None:
    localiser = make()
    body = Body(0.0, 0.0, math.pi / 4)
    sharp = [b._replace(std_rad=1e-5) for b in bearings(body)]
    loose = bearings(body)[0]._replace(std_rad=1.0)
    result = localiser.update([*sharp, loose])
    assert result.outcome is UpdateOutcome.RESAMPLED
    assert result.effective_particles == pytest.approx(1.0, abs=0.5)
    assert all(math.isfinite(value) for value in localiser.estimate().covariance)


def test_a_heading_at_pi_is_averaged_as_a_direction() -> None:
    start = Pose(x_m=0.0, y_m=0.0, heading_rad=math.pi)
    localiser = ParticleLocaliser(Localiser(), WHEELBASE, "body", LANDMARKS, start, 5)
    belief = localiser.estimate()
    assert abs(belief.heading_rad) == pytest.approx(math.pi, abs=0.01)
    assert math.sqrt(belief.covariance[15]) == pytest.approx(0.05, rel=0.15)


def test_half_a_minute_of_waiting_for_the_start_loses_neither_pose_nor_fork() -> None:
    """At standstill no bearing sees the fork's direction."""
    localiser, body = make(), Body(0.0, 0.0, math.pi / 4)
    rng = np.random.default_rng(0)
    for _ in range(3000):
        localiser.predict(DT, 0.0, 0.0)
        localiser.update(
            [b._replace(bearing_rad=b.bearing_rad + rng.normal(0, STD)) for b in bearings(body)]
        )
    belief = localiser.estimate()
    assert math.hypot(belief.x_m, belief.y_m) < 0.1
    assert belief.fork_rad == pytest.approx(math.pi / 4, abs=0.1)


weights = st.lists(st.floats(0.0, 1.0), min_size=2, max_size=40).filter(lambda w: sum(w) > 1e-3)


@given(raw=weights, offset=st.floats(0.0, 1.0, exclude_max=True))
def test_each_particle_is_copied_as_often_as_its_weight_says(
    raw: list[float], offset: float
) -> None:
    w = np.array(raw) / sum(raw)
    counts = np.bincount(systematic_resample(w, offset), minlength=len(w))
    assert counts.sum() == len(w)
    assert np.all(np.abs(counts - len(w) * w) < 1.0 + 1e-9)


def test_resampling_is_unbiased() -> None:
    """Paper (9): the mean number of copies is N w; offsets evenly spaced over [0, 1)."""
    w = np.array([0.31, 0.02, 0.0, 0.47, 0.2])
    offsets = (np.arange(4000) + 0.5) / 4000
    counts = [np.bincount(systematic_resample(w, u), minlength=5) for u in offsets.tolist()]
    assert np.mean(counts, axis=0) == pytest.approx(5 * w, abs=1e-3)
