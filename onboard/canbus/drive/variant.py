"""What differs between the ODrive firmwares 0.6 and 0.5; the driver knows only this face."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntFlag
from typing import Literal, NamedTuple

from config.can.database import CanDatabase
from config.can.odrive import AxisCodecs, AxisError, AxisState, GetVersion, ProcedureResult
from config.can.odrive_05 import Axis05Codecs, AxisError05
from onboard.canbus.drive.odrive_frames import Content


class Report(NamedTuple):
    """A heartbeat: error bits, axis state, and the procedure's result where there is one."""

    errors: int
    state: int
    result: int | None = None


@dataclass(frozen=True, slots=True)
class OdriveVariant:
    """One firmware. `queries` are the messages to ask for by remote frame.

    `initialising` are error bits that are no fault before arming, `watchdog` the watchdog's.
    """

    firmware: str
    heartbeat_id: int
    report: Callable[[bytes], Report]
    clear_errors: Content
    errors: type[IntFlag]
    initialising: int
    watchdog: int
    tells_temperature: bool
    queries: tuple[int, ...]

    def error_names(self, bits: int) -> tuple[str, ...]:
        """Names of the bits of an error word; a bit without a name is given in hexadecimal."""
        names = []
        while bits:
            bit = bits & -bits
            names.append(self.errors(bit).name or f"0x{bit:08x}")
            bits ^= bit
        return tuple(names)

    def describe(self, report: Report) -> str:
        """State, result and errors of a heartbeat in words."""
        errors = ", ".join(self.error_names(report.errors)) or "none"
        state = _name(AxisState, report.state)
        if report.result is None:
            return f"state {state}, errors {errors}"
        return f"state {state}, result {_name(ProcedureResult, report.result)}, errors {errors}"

    def firmware_problem(self, version: GetVersion) -> str | None:
        """Why a drive that tells this version is not the one that the fleet file names."""
        told = f"{version.fw_version_major}.{version.fw_version_minor}"
        if told == self.firmware:
            return None
        return (
            f"firmware {told}.{version.fw_version_revision}, vehicle says {self.firmware}: set "
            "`firmware` of this axis in the fleet file, or update the drive"
        )


def variant_06(codecs: AxisCodecs) -> OdriveVariant:
    """Firmware 0.6."""

    def report(data: bytes) -> Report:
        heartbeat = codecs.heartbeat.unpack(data)
        return Report(heartbeat.axis_error, heartbeat.axis_state, heartbeat.procedure_result)

    return OdriveVariant(
        firmware="0.6",
        heartbeat_id=codecs.heartbeat.can_id,
        report=report,
        clear_errors=(codecs.clear_errors.can_id, codecs.clear_errors.pack(0)),
        errors=AxisError,
        initialising=AxisError.INITIALIZING,
        watchdog=AxisError.WATCHDOG_TIMER_EXPIRED,
        tells_temperature=True,
        queries=(
            codecs.get_version.can_id,
            codecs.get_bus_voltage_current.can_id,
            codecs.get_temperature.can_id,
        ),
    )


def variant_05(common: AxisCodecs, codecs: Axis05Codecs) -> OdriveVariant:
    """Firmware 0.5: error flags in the heartbeat, no procedure result, 0x15 is no temperature."""

    def report(data: bytes) -> Report:
        heartbeat = codecs.heartbeat.unpack(data)
        flags = (
            heartbeat.motor_error_flag
            | heartbeat.encoder_error_flag << 1
            | heartbeat.controller_error_flag << 2
        )
        return Report(heartbeat.axis_error | flags << 32, heartbeat.axis_state)

    return OdriveVariant(
        firmware="0.5",
        heartbeat_id=codecs.heartbeat.can_id,
        report=report,
        clear_errors=(codecs.clear_errors.can_id, codecs.clear_errors.pack()),
        errors=AxisError05,
        initialising=0,
        watchdog=AxisError05.WATCHDOG_TIMER_EXPIRED,
        tells_temperature=False,
        queries=(common.get_version.can_id, common.get_bus_voltage_current.can_id),
    )


def variant_of(database: CanDatabase, node: int, firmware: Literal["0.5", "0.6"]) -> OdriveVariant:
    """The variant of one axis."""
    if firmware == "0.5":
        return variant_05(database.axis(node), database.axis_05(node))
    return variant_06(database.axis(node))


def _name(kind: type[AxisState] | type[ProcedureResult], value: int) -> str:
    return kind(value).name if value in kind.__members__.values() else str(value)
