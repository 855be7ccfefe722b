"""A follower's wall clock must be its leader's: ages of messages are counted on it."""

from config.fleet import Robot
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where even the freshest of the last messages seems old, or from the future."""
    if seen.leader is None or seen.leader.offset_s is None:
        return None
    limit_s = settings.arming.max_clock_offset_s
    if abs(seen.leader.offset_s) <= limit_s:
        return None
    return (
        f"clock: messages of {seen.leader.name} are {seen.leader.offset_s:+.3f} s old on arrival, "
        f"limit {limit_s:.3f} s: synchronise the wall clocks (chrony), look at the network"
    )
