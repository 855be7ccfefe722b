"""Both drives must run the firmware that the fleet file says, where they tell it."""

from config.fleet import Robot
from onboard.safety.observations import Observations


def check(seen: Observations, _settings: Robot) -> str | None:
    """Reason where a drive has told another firmware."""
    problems = [
        f"{name}: {axis.firmware}"
        for name, axis in (("steering", seen.steering), ("drive", seen.drive))
        if axis.firmware is not None
    ]
    return "; ".join(problems) or None
