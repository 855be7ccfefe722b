"""Faults of emulated hardware: the vocabulary, and the schema of a scripted fault.

The first seven kinds of a device carry the names that PX4 gives to failures of its simulated
sensors and motors. `python -m config.faults` writes the table in docs/faults.md again.
"""

from collections.abc import Collection, Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import ConfigDict, Field

from config.fleet import Finite, NonNegative, Positive, Section

DEVICES = ("steering", "drive", "encoder", "bearing", "bus")
HEALTHY = "ok"
"""The kind that ends every fault of a device."""

DOC_PATH = Path(__file__).parent.parent / "docs" / "faults.md"

_DRIVES = ("steering", "drive")
_SENSORS = ("encoder", "bearing")
_ALL = (*_DRIVES, *_SENSORS)
_BUS = ("bus",)


class Kind(NamedTuple):
    """One kind of fault on some devices.

    `unit` and `default` are those of the fault's value; a kind without a unit has none. The value
    lies between `least` and `most`. A `once` kind happens at one moment and has no duration.
    """

    name: str
    devices: tuple[str, ...]
    meaning: str
    unit: str = ""
    default: float = 0.0
    least: float = 0.0
    most: float = 1e6
    once: bool = False


KINDS: tuple[Kind, ...] = (
    Kind("off", _DRIVES, "no power: silent, deaf, the motor coasts; restarts when it ends"),
    Kind("off", _SENSORS, "no power: silent"),
    Kind("stuck", _DRIVES, "its position and velocity estimates freeze; the motor goes on"),
    Kind("stuck", ("encoder",), "the same angle and rate again and again, marked valid"),
    Kind("stuck", ("bearing",), "the last look again and again, under new capture numbers"),
    Kind("garbage", _DRIVES, "random estimates within +-value", "rev, rev/s", 100.0, least=1e-6),
    Kind("garbage", _SENSORS, "random angles in (-pi, pi), marked valid, with a good CRC"),
    Kind("wrong", ("steering",), "reports the angle too large by value", "rad", 0.3, -10, 10),
    Kind("wrong", ("drive",), "reports way and speed too large by this part", "1", 0.3, -10, 10),
    Kind("wrong", ("encoder",), "reports the angle too large by value", "rad", 0.3, -3.2, 3.2),
    Kind("wrong", ("bearing",), "every bearing too large by value", "rad", 0.3, -3.2, 3.2),
    Kind("slow", _ALL, "its cyclic messages come at 1/value of their rate", "1", 5.0, 1, 1000),
    Kind("delayed", _ALL, "its frames reach the bus late by value", "s", 0.2, 0, 60),
    Kind("intermittent", _ALL, "silent for value, sending for value, in turns", "s", 0.2, 1e-3, 60),
    Kind("failed", _DRIVES, "trips with DRV_FAULT, once", once=True),
    Kind("failed", ("encoder",), "says that its angle is invalid, magnet and internal fault"),
    Kind("failed", ("bearing",), "says that it is in state FAULT with an internal fault"),
    Kind("mute", _DRIVES, "sends nothing, but hears and obeys"),
    Kind("jammed", _DRIVES, "the motor cannot turn, whatever the drive asks for"),
    Kind("nan", _DRIVES, "its position and velocity estimates are not-a-number"),
    Kind("disarm", _DRIVES, "falls back to idle with error 0, once", once=True),
    Kind("restart", _DRIVES, "reboots: silent and deaf for 1 s, then idle, once", once=True),
    Kind(
        "overheat",
        _DRIVES,
        "inverter warms from 30 degC by value; INVERTER_OVER_TEMP from 80 degC on; cools at once",
        "degC/s",
        100.0,
        0.1,
        1e4,
    ),
    Kind(
        "undervolt",
        _DRIVES,
        "supply falls from 24 V to value; DC_BUS_UNDER_VOLTAGE below 12 V",
        "V",
        10.0,
        0,
        60,
    ),
    Kind("blind", ("bearing",), "looks on time, and sees nothing"),
    Kind("loss", _BUS, "each frame is lost by its receivers with this chance", "1", 0.2, 0, 1),
    Kind("duplication", _BUS, "each frame arrives twice with this chance", "1", 0.2, 0, 1),
    Kind("reordering", _BUS, "each frame arrives after the next with this chance", "1", 0.2, 0, 1),
    Kind(
        "corruption",
        _BUS,
        "one bit of a frame flips with this chance. In a frame with end-to-end protection behind "
        "CAN's own check (a receiver's or gateway's memory): it arrives changed. In any other on "
        "the wire, where CAN's CRC finds it: error frame, sent again",
        "1",
        0.2,
        0,
        1,
    ),
    Kind(
        "babbling",
        _BUS,
        "a node sends identifier 0x000 without pause for this part of each 10 ms",
        "1",
        1.0,
        0,
        1,
    ),
    Kind(
        "wrong_bitrate",
        _BUS,
        "the host's controller has another bit rate: it hears nothing, its frames are errors, and "
        "it destroys those of others until it is error-passive",
    ),
    Kind("bus_off", _BUS, "the host's controller is bus-off, and restarts when it ends"),
    Kind("unplugged", _BUS, "the host's cable is out: nothing heard, nobody acknowledges"),
    Kind("adapter_lost", _BUS, "the host's CAN adapter is gone: every call fails until it is back"),
)


def kind_of(device: str, kind: str) -> Kind:
    """The row of a kind on a device. Raises KeyError where the device has no such kind."""
    for row in KINDS:
        if row.name == kind and device in row.devices:
            return row
    raise KeyError(f"{device} has no fault {kind}")


def kinds_of(device: str) -> list[str]:
    """Every kind of fault that a device can have."""
    return [row.name for row in KINDS if device in row.devices]


class Fault(Section):
    """One scripted fault: at `at_s`, for `for_s` (None: for ever), on a device of a robot.

    In a file the times are the keys `at` and `for`. `value` means what its kind says; without one
    it is the kind's default.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    at_s: NonNegative = Field(default=0.0, validation_alias="at")
    for_s: Positive | None = Field(default=None, validation_alias="for")
    robot: str
    device: str
    kind: str
    value: Finite | None = None


class FaultScript(Section):
    """A file of scripted faults.

    Times count from power-up of the emulated hardware, or from the first motion of any robot.
    """

    version: Literal[1]
    clock: Literal["motion", "power"] = "motion"
    faults: Annotated[list[Fault], Field(min_length=1)]


def problems(fault: Fault, robots: Collection[str]) -> Iterator[tuple[str, str]]:
    """What is wrong with a fault for a fleet of these robots: the key to change, and why."""
    if fault.robot not in robots:
        yield "robot", _unknown("robot", fault.robot, robots)
    if fault.device not in DEVICES:
        yield "device", _unknown("device", fault.device, DEVICES)
        return
    known = kinds_of(fault.device)
    if fault.kind == HEALTHY:
        return
    if fault.kind not in known:
        yield "kind", _unknown(f"fault of {fault.device}", fault.kind, [*known, HEALTHY])
        return
    row = kind_of(fault.device, fault.kind)
    if fault.value is not None and not row.unit:
        yield "value", f"{fault.kind} of {fault.device} takes no value: leave it out"
    elif fault.value is not None and not row.least <= fault.value <= row.most:
        limits = f"{row.least:g} to {row.most:g} {row.unit}"
        yield "value", f"{fault.value:g} is not allowed for {fault.kind}: {limits}"
    if fault.for_s is not None and row.once:
        yield "for", f"{fault.kind} of {fault.device} happens once: leave `for` out"


def _unknown(what: str, given: str, known: Iterable[str]) -> str:
    near = get_close_matches(given, known := list(known), 1)
    hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
    return f"no {what} {given!r}; {hint}"


def table() -> str:
    """The vocabulary as a page of documentation."""
    lines = [_HEADING]
    for device in DEVICES:
        lines += [f"\n## {_TITLES[device]}\n", "| kind | what happens | value |", "|---|---|---|"]
        for row in KINDS:
            if device in row.devices:
                lines.append(f"| `{row.name}` | {row.meaning} | {_value_text(row)} |")
    return "\n".join(lines) + "\n"


def _value_text(row: Kind) -> str:
    if not row.unit:
        return "-"
    unit = "" if row.unit == "1" else f" {row.unit}"
    return f"{row.default:g}{unit} ({row.least:g} to {row.most:g})"


_TITLES = {
    "steering": "`steering`: the steering motor's drive",
    "drive": "`drive`: the wheel motor's drive",
    "encoder": "`encoder`: the steering encoder",
    "bearing": "`bearing`: the bearing sensor",
    "bus": "`bus`: the robot's CAN bus",
}

_HEADING = """# Faults of the emulated hardware

Written by `python -m config.faults` from `config/faults.py`; do not edit this page.

Live, on a running demo: `echelon fault r2 bearing stuck --for 2s`; the kind `ok` ends all faults of
a device. Scripted, for `echelon demo --faults FILE` and `echelon-sim --faults FILE`:

```yaml
version: 1
clock: motion        # or power: seconds since the first motion, or since power-up
faults:
  - {at: 5, for: 2, robot: r2, device: bearing, kind: stuck}
  - {at: 12, robot: r3, device: drive, kind: undervolt, value: 9}
```

Several faults of one device add up; the same kind again replaces the former. Without `for` a fault
stays. What is random is drawn from the simulation's seed. Values are given as
default (least to most)."""


if __name__ == "__main__":
    DOC_PATH.write_text(table(), encoding="utf-8")
