"""A follower's leader must be alive."""

from config.fleet import Robot
from onboard.canbus.silence import silence
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the leader is silent; None for a robot without a leader."""
    if seen.leader is None:
        return None
    limit_s = settings.failsafe.leader_stale.after_s
    return silence(f"leader {seen.leader.name}", "message", seen.leader.age_s, limit_s)
