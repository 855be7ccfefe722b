"""The emulated steering encoder."""

import math

import numpy as np
import pytest

from config.can.frame import Frame
from sim_hw.steering_encoder import SteeringEncoder
from tests.sim_hw.fleets import database

CODEC = database().vehicle_aux().steering_angle


def frames(std_rad: float, angle_rad: float, rate_radps: float, duration_s: float) -> list[Frame]:
    encoder = SteeringEncoder(
        CODEC, std_rad, 20.0, np.random.default_rng(1), np.random.default_rng(2)
    )
    found: list[Frame] = []
    for step in range(1, round(duration_s * 1000) + 1):
        found += encoder.advance(20.0 + step * 0.001, angle_rad, rate_radps)
    return found


def test_the_true_angle_and_rate_are_reported_100_times_a_second_as_valid() -> None:
    sent = frames(0.0, -0.4321, 1.25, 1.0)
    assert len(sent) == 100
    assert sent[0].can_id == 0x060
    row = CODEC.unpack(sent[0].data)
    assert row.angle == pytest.approx(-0.4321)
    assert row.rate == pytest.approx(1.25)
    assert (row.angle_valid, row.angle_referenced) == (1, 1)
    assert (row.fault_magnet, row.fault_internal) == (0, 0)


def test_noise_has_the_deviation_asked_for() -> None:
    values = np.array([CODEC.unpack(f.data).angle for f in frames(0.01, 0.2, 0.0, 20.0)])
    assert values.mean() == pytest.approx(0.2, abs=4 * 0.01 / math.sqrt(2000))
    assert values.std() == pytest.approx(0.01, rel=4 / math.sqrt(2 * 2000))


def test_the_sample_time_is_the_encoders_own_clock_and_wraps() -> None:
    sent = frames(0.0, 0.0, 0.0, 8.0)
    clock_ms = np.array([CODEC.unpack(f.data).sample_time for f in sent])
    assert (np.diff(clock_ms) < 0).sum() >= 1
    assert np.diff(clock_ms) % 6553.6 == pytest.approx(
        np.diff([f.t_s for f in sent]) * 1e3, abs=0.11
    )
