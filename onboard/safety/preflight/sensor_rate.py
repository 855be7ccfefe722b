"""The bearing sensor must look about as often as the fleet file says."""

from config.fleet import Robot
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the last second held too few looks."""
    least_hz = settings.arming.min_sensor_rate_fraction * settings.bearing_sensor.rate_hz
    if seen.bearing_rate_hz is None or seen.bearing_rate_hz >= least_hz:
        return None
    return (
        f"bearing sensor: {seen.bearing_rate_hz:.0f} looks per s, limit {least_hz:.0f} "
        f"(bearing_sensor.rate_hz is {settings.bearing_sensor.rate_hz:g})"
    )
