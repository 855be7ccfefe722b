"""All checks before arming, in the order in which an operator would go about them."""

from collections.abc import Callable, Collection
from typing import NamedTuple

from config.fleet import CheckName, Robot
from onboard.safety.observations import Observations
from onboard.safety.preflight import (
    bearing_sensor,
    bus,
    bus_load,
    clock_offset,
    disk,
    drives,
    firmware,
    leader,
    realtime,
    safety_node,
    sensor_rate,
    steering_encoder,
    steering_reference,
    supply,
)


class Blocker(NamedTuple):
    """A check that does not pass, and why; its text names value and limit."""

    check: str
    reason: str

    def __str__(self) -> str:
        return f"{self.reason} [check {self.check}]"


CHECKS: dict[CheckName, Callable[[Observations, Robot], str | None]] = {
    "bus": bus.check,
    "bus_load": bus_load.check,
    "safety_node": safety_node.check,
    "drives": drives.check,
    "firmware": firmware.check,
    "supply": supply.check,
    "steering_encoder": steering_encoder.check,
    "steering_reference": steering_reference.check,
    "bearing_sensor": bearing_sensor.check,
    "sensor_rate": sensor_rate.check,
    "leader": leader.check,
    "clock_offset": clock_offset.check,
    "disk": disk.check,
    "realtime": realtime.check,
}
"""`estimate`, the last check of the fleet file's names, is the role's own."""


def not_ready(seen: Observations, settings: Robot, estimate: Collection[str] = ()) -> list[Blocker]:
    """What speaks against arming; empty where nothing does. `estimate`: the role's objections."""
    found = [
        Blocker(name, reason)
        for name, check in CHECKS.items()
        if (reason := check(seen, settings)) is not None
    ]
    return [*found, *(Blocker("estimate", reason) for reason in estimate)]


def refused_overrides(asked: Collection[str], settings: Robot) -> str | None:
    """Why an operator may not override these checks, or None where they may."""
    allowed: list[str] = list(settings.arming.allow_override)
    known = [*CHECKS, "estimate"]
    for name in asked:
        if name not in known:
            return f"no check {name!r} to override; checks are {', '.join(known)}"
        if name not in allowed:
            listed = ", ".join(allowed) or "none"
            return f"check {name} may not be overridden here (arming.allow_override: {listed})"
    return None
