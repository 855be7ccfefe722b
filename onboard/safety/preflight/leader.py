"""A follower's leader must be alive."""

from config.fleet import Failsafe
from onboard.canbus.silence import silence
from onboard.safety.observations import Observations


def check(seen: Observations, limits: Failsafe) -> str | None:
    """Reason where the leader is silent; None for a robot without a leader."""
    if seen.leader is None:
        return None
    return silence(
        f"leader {seen.leader.name}", "message", seen.leader.age_s, limits.leader_timeout_s
    )
