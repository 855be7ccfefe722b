"""The battery must be good and the drives cool, as far as the drives tell it."""

from config.fleet import Robot
from onboard.safety.observations import DriveSeen, Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where a drive's supply is low or it is too hot."""
    return _problem("steering", seen.steering, settings) or _problem("drive", seen.drive, settings)


def _problem(name: str, axis: DriveSeen, settings: Robot) -> str | None:
    limit_v = settings.failsafe.battery_low.limit_v
    limit_degc = settings.failsafe.temperature_high.limit_degc
    if axis.supply_v is not None and axis.supply_v < limit_v:
        return f"{name}: supply {axis.supply_v:.1f} V, limit {limit_v:.1f} V"
    if axis.temperature_degc is not None and axis.temperature_degc > limit_degc:
        return f"{name}: {axis.temperature_degc:.0f} degC, limit {limit_degc:.0f} degC"
    return None
