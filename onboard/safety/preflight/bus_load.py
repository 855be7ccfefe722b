"""The CAN bus must have room for the setpoints."""

from config.fleet import Robot
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the frames seen and sent fill too much of the bus; stuffing at its worst."""
    limit = settings.arming.max_bus_load
    if seen.bus_load <= limit:
        return None
    return (
        f"CAN bus: load {seen.bus_load:.0%}, limit {limit:.0%}: raise the bit rate "
        f"({settings.can.bitrate} bit/s) or lower the sensor's rate"
    )
