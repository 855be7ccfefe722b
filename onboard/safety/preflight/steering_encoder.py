"""The steering encoder must be heard, valid and referenced."""

from config.fleet import Failsafe
from onboard.canbus.silence import silence
from onboard.safety.observations import Observations


def check(seen: Observations, limits: Failsafe) -> str | None:
    """Reason where the steering angle cannot be relied on."""
    return seen.encoder_problem or silence(
        "steering encoder", "angle", seen.encoder_age_s, limits.encoder_timeout_s
    )
