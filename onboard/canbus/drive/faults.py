"""Names and sentences for what an ODrive reports."""

from config.can.odrive import AxisError, AxisState, Heartbeat, ProcedureResult


def error_names(bits: int) -> tuple[str, ...]:
    """Names of the bits of an error word; a bit without a name is given in hexadecimal."""
    names = []
    while bits:
        bit = bits & -bits
        names.append(AxisError(bit).name or f"0x{bit:08x}")
        bits ^= bit
    return tuple(names)


def describe(heartbeat: Heartbeat) -> str:
    """State, result and errors of a heartbeat in words."""
    errors = ", ".join(error_names(heartbeat.axis_error)) or "none"
    state = _name(AxisState, heartbeat.axis_state)
    result = _name(ProcedureResult, heartbeat.procedure_result)
    return f"state {state}, result {result}, errors {errors}"


def _name(kind: type[AxisState] | type[ProcedureResult], value: int) -> str:
    return kind(value).name if value in kind.__members__.values() else str(value)
