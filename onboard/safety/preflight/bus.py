"""The CAN bus must be open and free of errors."""

from config.fleet import Robot
from onboard.canbus.port import BusState
from onboard.safety.observations import Observations


def check(seen: Observations, _settings: Robot) -> str | None:
    """Reason where the bus is not active."""
    if seen.bus_state is BusState.ACTIVE:
        return None
    return f"CAN bus {seen.bus_state}: {seen.bus_reason}"
