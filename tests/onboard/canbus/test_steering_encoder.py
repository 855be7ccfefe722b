"""The steering encoder: an angle is given only while it can be relied on."""

import pytest

from config.can.database import CanDatabase
from onboard.canbus.steering_encoder import SteeringEncoder
from tests.onboard.canbus.fakes import steering_angle


@pytest.fixture
def encoder(database: CanDatabase) -> SteeringEncoder:
    encoder = SteeringEncoder(database.vehicle_aux(), timeout_s=0.05)
    for counter in range(3):
        encoder.on_frame(steering_angle(-0.2, counter, 1.0))
    return encoder


def test_angle_and_rate_are_read(encoder: SteeringEncoder) -> None:
    assert encoder.angle_rad == pytest.approx(-0.2)
    assert encoder.rate_radps == pytest.approx(0.25)
    assert encoder.problem(1.05) is None


def test_nothing_is_given_before_the_signal_is_trusted(database: CanDatabase) -> None:
    encoder = SteeringEncoder(database.vehicle_aux(), timeout_s=0.05)
    for counter in range(2):
        encoder.on_frame(steering_angle(0.1, counter, 1.0))
    assert encoder.angle_rad is None
    assert encoder.problem(1.0) == "steering encoder: no angle yet"


def test_silence_is_named_with_its_limit(encoder: SteeringEncoder) -> None:
    assert encoder.problem(1.06) == "steering encoder: no angle for 0.06 s, limit 0.05 s"
    assert encoder.stale_for(1.06) == pytest.approx(0.06)


def test_a_repeated_or_broken_frame_does_not_count(encoder: SteeringEncoder) -> None:
    encoder.on_frame(steering_angle(0.9, 2, 1.04))
    broken = steering_angle(0.9, 3, 1.04)
    encoder.on_frame(broken._replace(data=broken.data[:7] + b"\xff"))
    assert encoder.angle_rad == pytest.approx(-0.2)
    assert encoder.stale_for(1.04) == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (0x20, "angle not valid"),
        (0x10, "angle not referenced"),
        (0xB0, "internal fault"),
        (0x40, "angle not valid, angle not referenced, magnet fault"),
    ],
)
def test_the_encoders_own_complaint_is_passed_on(
    encoder: SteeringEncoder, flags: int, complaint: str
) -> None:
    encoder.on_frame(steering_angle(0.3, 3, 1.01, flags))
    assert encoder.problem(1.01) == f"steering encoder: {complaint}"
    assert encoder.angle_rad is None
    assert encoder.rate_radps is None
