"""The steering encoder must be heard, valid and referenced."""

from config.fleet import Robot
from onboard.canbus.silence import silence
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the steering angle cannot be relied on."""
    limit_s = settings.failsafe.encoder_stale.after_s
    return silence("steering encoder", "angle", seen.encoder_age_s, limit_s) or seen.encoder_problem
