"""The paper's literal filter: against an independent implementation, and its erratum."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from config.fleet import PaperFilter as PaperSettings
from config.fleet import RelativeFilter as Settings
from onboard.estimate.beliefs import RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.estimate.paper_filter import PaperFilter
from onboard.model.vehicle import WheelMotion
from tests.onboard.estimate.pair import DT, FRONT, REAR, WHEELBASE, make_pair

H = 0.03
PRIOR = RelativePrior(0.45, 0.1, math.pi / 4, 0.1, 0.2, 0.1)
Array = NDArray[np.float64]


class Independent:
    """The cubature form of the unscented filter for (31)-(33), written from the equations."""

    def __init__(self, start_variance: float) -> None:
        self.x = np.array([PRIOR.range_m, PRIOR.bearing_rad, PRIOR.heading_rad])
        self.p = start_variance * np.eye(3)

    def step(self, own: WheelMotion, leader: WheelMotion, y: Array) -> None:
        moved = np.array([self.euler(s, own, leader) for s in self.sigma()])
        self.x = moved.mean(axis=0)
        d = moved - self.x
        self.p = d.T @ d / 6 + DT**2 * H * np.eye(3)
        gain = self.p[:, 1:] @ np.linalg.inv(self.p[1:, 1:] + H * np.eye(2))
        self.x = self.x + gain @ (y - self.x[1:])
        self.p = self.p - gain @ self.p[1:, :]

    def sigma(self) -> list[Array]:
        root = math.sqrt(3) * np.linalg.cholesky(self.p)
        return [self.x + sign * root[:, i] for i in range(3) for sign in (1, -1)]

    @staticmethod
    def euler(s: Array, own: WheelMotion, leader: WheelMotion) -> Array:
        """Complex numbers: the line of sight is rho e^(i phi) in the follower's axes."""
        rho, phi, alpha = s
        velocity = leader.speed_mps * np.exp(1j * (alpha + leader.steering_rad))
        velocity -= own.speed_mps * np.exp(1j * own.steering_rad)
        seen = velocity * np.exp(-1j * phi)
        turns = [m.speed_mps * math.sin(m.steering_rad) / WHEELBASE for m in (own, leader)]
        rates = [seen.real, seen.imag / rho - turns[0], turns[1] - turns[0]]
        moved: Array = s + DT * np.array(rates)
        return moved


def test_the_literal_filter_is_the_equations() -> None:
    start_variance = 0.01
    f = PaperFilter.from_prior(
        PaperSettings(start_variance=start_variance), WHEELBASE, WHEELBASE, PRIOR
    )
    other, noise = Independent(start_variance), np.random.default_rng(1)
    for step in range(300):
        own = WheelMotion(4.0, 0.1 * math.sin(step / 20))
        leader = WheelMotion(4.0, 0.1 * math.cos(step / 20))
        y = np.array([math.pi / 4, 0.1]) + 0.05 * noise.standard_normal(2)
        f.predict(DT, own, leader)
        f.update_outputs(*y.tolist())
        other.step(own, leader, y)
        belief = f.estimate()
        assert belief[:3] == pytest.approx(other.x.tolist(), abs=1e-9)
        assert np.reshape(belief.covariance, (4, 4))[:3, :3] == pytest.approx(other.p, abs=1e-9)


def test_it_is_selected_in_the_fleet_file_and_starts_from_the_papers_p() -> None:
    f = make_relative_filter(Settings(kind="paper"), WHEELBASE, WHEELBASE, PRIOR)
    assert isinstance(f, PaperFilter)
    assert f.estimate().covariance[0] == 1.13
    assert f.estimate()[:4] == (0.45, math.pi / 4, 0.2, 0.0)


def test_front_bearings_both_ways_make_one_output_pair_and_others_are_left_out() -> None:
    f = make_relative_filter(Settings(kind="paper"), WHEELBASE, WHEELBASE, PRIOR)
    pair = make_pair(seed=1)
    leader_bearing = pair.own.bearing(pair.leader.place(FRONT))
    back = pair.leader.bearing(pair.own.place(FRONT))
    assert not f.update_leader_marker(1.0, 0.05, REAR, 0.0).accepted
    assert not f.update_mutual(back, 0.05, FRONT, 0.0).accepted
    assert not f.update_leader_marker(leader_bearing, 0.05, FRONT, 0.0).accepted
    assert f.update_mutual(back, 0.05, FRONT, 0.0).accepted
    assert f.estimate().heading_rad == pytest.approx(0.0, abs=0.01)


def test_taking_the_forks_rate_for_the_yaw_rate_turns_the_estimate_when_the_fork_jumps() -> None:
    """Errata, section 3: the steady spurious heading is the jump of the steering angle itself."""
    found = {}
    for kind in ("body", "fork"):
        chosen = PaperSettings(start_variance=1e-4).model_copy(update={"yaw_rate": kind})
        f = PaperFilter.from_prior(chosen, WHEELBASE, WHEELBASE, PRIOR._replace(heading_rad=0.0))
        for steering in (0.0, 0.05):
            f.predict(DT, WheelMotion(0.0, 0.0), WheelMotion(0.0, steering))
        found[kind] = f.estimate().heading_rad
    assert found["body"] == pytest.approx(0.0, abs=1e-12)
    assert found["fork"] == pytest.approx(0.05)
