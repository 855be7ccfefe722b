"""The bearing sensor must run and deliver bearings that the robot can use."""

from config.fleet import Robot
from onboard.canbus.silence import silence
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the sensor complains or shows nothing usable."""
    return seen.bearing_problem or silence(
        "bearing sensor",
        "usable bearing",
        seen.bearing_age_s,
        settings.failsafe.bearings_stale.after_s,
    )
