"""The speed that a robot loses in turns, as a state of the Gaussian localiser."""

import math

import numpy as np
import pytest

from config.fleet import Localiser, Pose
from onboard.estimate.localiser import LandmarkBearing
from onboard.estimate.localiser_gaussian import GaussianLocaliser
from onboard.estimate.localiser_motion import STATES, Input, Mean, advance

LANDMARKS = {1: (3.0, 0.0), 2: (0.0, 3.0), 3: (-3.0, 0.5), 4: (0.5, -3.0)}
DT_S = 0.05


@pytest.mark.parametrize(("loss", "wheelbase_m"), [(0.0, 0.25), (0.9, 200.0)])
def test_the_jacobian_is_that_of_the_motion(loss: float, wheelbase_m: float) -> None:
    mean: Mean = (1.0, -2.0, 0.7, 0.4, 0.01, 0.05, -0.04, loss)
    given = Input(DT_S, 0.3, 0.6)
    _, jacobian, _ = advance(mean, given, wheelbase_m, "steering")
    numeric = np.zeros((STATES, STATES))
    for column in range(STATES):
        ends = []
        for sign in (1.0, -1.0):
            moved = list(mean)
            moved[column] += sign * 1e-6
            x, y, eta, theta, bias, speed, turn, lost = moved
            ends.append(
                np.array(
                    advance(
                        (x, y, eta, theta, bias, speed, turn, lost), given, wheelbase_m, "steering"
                    )[0]
                )
            )
        numeric[:, column] = (ends[0] - ends[1]) / 2e-6
    assert jacobian == pytest.approx(numeric, abs=5e-5)


def test_bearings_tell_how_much_speed_turns_cost() -> None:
    """A robot told 0.2 m/s that loses 0.5 of it per rad/s learns that, and where it is."""
    settings = Localiser(
        position_noise_m=0.002, heading_noise_rad=0.01, travel_noise_m=0.02, turn_loss_std=1.0
    )
    filter_ = GaussianLocaliser(settings, 200.0, "fork", LANDMARKS, Pose(x_m=0.0, y_m=0.0))
    rng = np.random.default_rng(1)
    x, y, heading, steering = 0.0, 0.0, 0.0, 0.0
    for step in range(1200):
        rate = 0.5 if step % 400 < 250 else 0.0
        speed = 0.2 * (1.0 - 0.5 * rate)
        x += DT_S * speed * math.cos(heading + 0.5 * DT_S * rate)
        y += DT_S * speed * math.sin(heading + 0.5 * DT_S * rate)
        heading += DT_S * rate
        steering += DT_S * rate
        filter_.predict(DT_S, 0.2, rate)
        filter_.measure_steering(math.remainder(steering, math.tau))
        seen = [
            LandmarkBearing(
                number,
                math.remainder(math.atan2(north - y, east - x) - heading, math.tau)
                + rng.normal(0.0, 0.01),
                0.01,
                0.0,
            )
            for number, (east, north) in LANDMARKS.items()
            if step % 10 == 0
        ]
        filter_.update(seen)
    belief = filter_.estimate()
    assert belief is not None
    assert math.hypot(belief.x_m - x, belief.y_m - y) < 0.05
