"""The black box needs room."""

from config.fleet import Robot
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where too little is free; None where nothing is written here."""
    limit_mb = settings.arming.min_free_disk_mb
    if seen.free_disk_mb is None or seen.free_disk_mb >= limit_mb:
        return None
    return f"disk: {seen.free_disk_mb:.0f} MB free for the black box, limit {limit_mb:.0f} MB"
