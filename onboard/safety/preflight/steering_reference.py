"""The steering angle must be one that the fork can have: the reference for the steering drive."""

from config.fleet import Robot
from onboard.safety.observations import Observations

SLACK_RAD = 0.1
"""A fork at its stop may read a little more than the limit for setpoints."""


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the encoder's angle is beyond the steering range."""
    angle_rad, limit_rad = seen.steering_rad, settings.limits.steering_rad + SLACK_RAD
    if angle_rad is None or abs(angle_rad) <= limit_rad:
        return None
    return (
        f"steering encoder: angle {angle_rad:+.3f} rad, limit {limit_rad:.3f} rad: turn the fork "
        "back, or reference the encoder anew"
    )
