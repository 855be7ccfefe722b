"""All checks before arming, in the order in which an operator would go about them."""

from collections.abc import Callable

from config.fleet import Failsafe
from onboard.safety.observations import Observations
from onboard.safety.preflight import bearing_sensor, bus, drives, leader, steering_encoder

CHECKS: tuple[Callable[[Observations, Failsafe], str | None], ...] = (
    bus.check,
    drives.check,
    steering_encoder.check,
    bearing_sensor.check,
    leader.check,
)


def not_ready(seen: Observations, limits: Failsafe) -> list[str]:
    """The reasons against arming; empty where there are none."""
    return [reason for check in CHECKS if (reason := check(seen, limits)) is not None]
