"""`echelon fault`: a fault for the simulated hardware of a running fleet."""

import re

import msgspec

from config.faults import Fault, problems
from config.fleet import Fleet
from config.messages import FaultOrder
from groundstation.errors import GroundError
from groundstation.fleet_link import FleetLink, operator

_DURATION = re.compile(r"(?P<number>[0-9]+(\.[0-9]*)?|\.[0-9]+)(?P<unit>ms|s|)")


class FaultReport(msgspec.Struct, frozen=True):
    """What the simulated hardware has answered. `ok`: accepted."""

    ok: bool
    fleet: str
    robot: str
    device: str
    kind: str
    reason: str


def seconds(text: str) -> float:
    """A duration such as 2s, 500ms or 1.5. Raises GroundError."""
    found = _DURATION.fullmatch(text.strip())
    value = float(found["number"]) * (1e-3 if found["unit"] == "ms" else 1.0) if found else 0.0
    if value <= 0:
        raise GroundError(f"{text!r} is no duration: write for example 2s, 500ms or 1.5")
    return value


def inject(fleet: Fleet, fault: Fault) -> FaultReport:
    """Check a fault and order it from the fleet's simulated hardware.

    Raises GroundError where the fleet cannot have this fault.
    """
    if wrong := [text for _, text in problems(fault, fleet.robots)]:
        raise GroundError("; ".join(wrong))
    order = FaultOrder(
        device=fault.device,
        kind=fault.kind,
        for_s=fault.for_s,
        value=fault.value,
        operator=operator(),
    )
    with FleetLink.as_visitor(fleet) as link:
        reply = link.order_fault(fault.robot, order)
    return FaultReport(
        reply.accepted, fleet.name, fault.robot, fault.device, fault.kind, reply.reason
    )


def to_text(report: FaultReport) -> str:
    """The answer for people."""
    name = f"{report.robot} {report.device} {report.kind}"
    return f"{name}: accepted" if report.ok else f"{name}: NOT ACCEPTED: {report.reason}"


def to_json(report: FaultReport) -> str:
    """The answer as an indented JSON document."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2).decode()
