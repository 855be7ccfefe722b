"""The loop must have real-time priority where the fleet file requires it."""

from config.fleet import Robot
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the kernel has refused the priority."""
    if seen.realtime or not settings.arming.require_realtime:
        return None
    return (
        f"control loop: no real-time priority, {settings.loop.realtime_priority} asked for "
        "(loop.realtime_priority): see docs/transport.md, permission for SCHED_FIFO"
    )
