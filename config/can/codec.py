"""Compile the messages of a DBC to plain functions, once, at start.

`pack` and `unpack` are written as Python source per message and executed, as the standard
library does for named tuples: each frame then costs one struct call, or one expression of shifts
and masks, instead of a walk over signal descriptions. cantools reads the file and judges the
result in the tests.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from cantools.database.can import Message, Signal

RowT = TypeVar("RowT", bound=tuple[Any, ...])

FLOAT32_MAX = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
_STRUCT_CODES = {8: "Bb", 16: "Hh", 32: "Ii"}


class CodecError(ValueError):
    """A frame or a value that a codec cannot take."""


class FrameTooShort(CodecError):
    """A frame with fewer data bytes than its message has."""


class NonFiniteSignal(CodecError):
    """NaN or infinity for a signal that is an integer on the wire."""


class UnsupportedSignal(Exception):
    """A signal layout that this compiler does not know; the text names it."""


class Pack(Protocol):
    """Signal values, by position or name, in the DBC's units -> data bytes.

    Values beyond a signal's bits are clamped. NaN and infinity pass in float signals and raise
    NonFiniteSignal in others.
    """

    def __call__(self, *values: float, **named: float) -> bytes: ...


@dataclass(frozen=True, slots=True)
class Codec(Generic[RowT]):
    """One message on one bus.

    `name` is the DBC's. `pack` and `unpack` leave out the CRC and counter of a message that is
    protected end to end: `config.can.e2e` fills and checks them. `unpack` raises FrameTooShort
    below `min_length` bytes and reads missing bytes above it as zeros. `cycle_time_s` is 0 for
    messages that are not cyclic.
    """

    name: str
    can_id: int
    length: int
    min_length: int
    signals: tuple[str, ...]
    sender: str
    cycle_time_s: float
    feeds_watchdog: bool
    e2e_data_id: int | None
    pack: Pack
    unpack: Callable[[bytes], RowT]


class Functions(NamedTuple):
    """The two halves of a message's codec."""

    pack: Pack
    unpack: Callable[[bytes], Any]


def compile_message(
    message: Message, signals: list[Signal], row: type[tuple[Any, ...]], min_length: int
) -> Functions:
    """Compile one message; `row` takes the values of `signals` by position.

    Raises UnsupportedSignal for big-endian, multiplexed or oddly placed float signals.
    """
    for signal in signals:
        _check_supported(signal)
    layout = struct.Struct(_struct_format(signals, message.length) or "<")
    in_struct = layout.size == message.length and bool(signals)
    if not in_struct and any(signal.is_float for signal in signals):
        raise UnsupportedSignal("a float signal shares its message with bit fields")
    source = _struct_source(signals) if in_struct else _bits_source(signals, message.length)
    namespace: dict[str, Any] = {
        "STRUCT": layout,
        "ROW": row,
        "NEW": tuple.__new__,
        "LENGTH": message.length,
        "padded": _padder(message.name, min_length, message.length),
        "clamped": _clamped,
        "float32": _float32,
    }
    names = ", ".join(argument(signal) for signal in signals)
    exec(source.format(arguments=names), namespace)
    return Functions(namespace["pack"], namespace["unpack"])


def argument(signal: Signal) -> str:
    """Name of a signal's value in Python."""
    return signal.name.lower()


def _check_supported(signal: Signal) -> None:
    if signal.byte_order != "little_endian" or signal.is_multiplexer or signal.multiplexer_ids:
        raise UnsupportedSignal(f"signal {signal.name} is big-endian or multiplexed")
    if signal.is_float and (signal.length != 32 or is_scaled(signal)):
        raise UnsupportedSignal(f"signal {signal.name} is a float of other than 32 bits, scale 1")


def is_scaled(signal: Signal) -> bool:
    """True where a raw step is not one unit."""
    return signal.scale != 1 or signal.offset != 0


def _struct_format(signals: list[Signal], length: int) -> str | None:
    """Struct format of a message whose signals fill whole words, else None."""
    parts, position = ["<"], 0
    for signal in sorted(signals, key=lambda signal: signal.start):
        codes = "ff" if signal.is_float else _STRUCT_CODES.get(signal.length)
        if codes is None or signal.start % 8:
            return None
        parts += [f"{signal.start // 8 - position}x", codes[signal.is_signed]]
        position = (signal.start + signal.length) // 8
    return "".join([*parts, f"{length - position}x"])


def _struct_source(signals: list[Signal]) -> str:
    ordered = sorted(signals, key=lambda signal: signal.start)
    values = ", ".join(_raw_value(signal) for signal in ordered)
    words = ", ".join(argument(signal) for signal in ordered)
    scaled = "".join(f"{_physical(argument(signal), signal)}, " for signal in signals)
    return f"""
def pack({{arguments}}):
    return STRUCT.pack({values})

def unpack(data):
    {words}, = STRUCT.unpack_from(data if len(data) >= LENGTH else padded(data))
    return NEW(ROW, ({scaled}))
"""


def _bits_source(signals: list[Signal], length: int) -> str:
    fields = [
        f"(({_raw_value(signal)}) & {_mask(signal):#x}) << {signal.start}" for signal in signals
    ]
    scaled = "".join(f"{_physical(_field(signal), signal)}, " for signal in signals)
    return f"""
def pack({{arguments}}):
    return ({" | ".join(fields) or 0}).to_bytes({length}, "little")

def unpack(data):
    bits = int.from_bytes(data if len(data) >= LENGTH else padded(data), "little")
    return NEW(ROW, ({scaled}))
"""


def _mask(signal: Signal) -> int:
    return (1 << signal.length) - 1


def _field(signal: Signal) -> str:
    field = f"(bits >> {signal.start} & {_mask(signal):#x})"
    if not signal.is_signed:
        return field
    sign = 1 << (signal.length - 1)
    return f"(({field} ^ {sign:#x}) - {sign:#x})"


def _physical(raw: str, signal: Signal) -> str:
    return f"{raw} * {signal.scale!r} + {signal.offset!r}" if is_scaled(signal) else raw


def _raw_value(signal: Signal) -> str:
    name = argument(signal)
    if signal.is_float:
        return f"{name} if {-FLOAT32_MAX!r} <= {name} <= {FLOAT32_MAX!r} else float32({name})"
    low = -(1 << (signal.length - 1)) if signal.is_signed else 0
    high = low + _mask(signal)
    value = f"({name} - {signal.offset!r}) / {signal.scale!r}" if is_scaled(signal) else name
    return (
        f"round(raw) if {low} <= (raw := {value}) <= {high} "
        f"else clamped(raw, {low}, {high}, {signal.name!r})"
    )


def _clamped(raw: float, low: int, high: int, name: str) -> int:
    if not math.isfinite(raw):
        raise NonFiniteSignal(f"signal {name}: {raw} cannot be sent as an integer")
    return low if raw < low else high


def _float32(value: float) -> float:
    return math.copysign(FLOAT32_MAX, value) if math.isfinite(value) else value


def _padder(name: str, min_length: int, length: int) -> Callable[[bytes], bytes]:
    """A function that fills up a frame that is shorter than its message but long enough."""

    def padded(data: bytes) -> bytes:
        if len(data) < min_length:
            raise FrameTooShort(f"{name}: {len(data)} data bytes, needs {min_length}")
        return data.ljust(length, b"\0")

    return padded
