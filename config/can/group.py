"""Groups of codecs, one field per message, built by name from a DBC and checked against it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Self, TypeVar, get_args, get_type_hints

from cantools.database.can import Database, Message, Signal

from config.can.codec import (
    Codec,
    UnsupportedSignal,
    argument,
    compile_message,
    is_scaled,
)

_E2E_PROFILE = 2
GroupT = TypeVar("GroupT", bound="CodecGroup")


class DatabaseMismatch(Exception):
    """A DBC file without something that the code relies on; the text names file and place."""


@dataclass(frozen=True, slots=True)
class CodecGroup:
    """Base of the groups: iterates over its codecs."""

    def __iter__(self) -> Iterator[Codec[Any]]:
        return (getattr(self, field.name) for field in fields(self))

    def moved(self, shift: int) -> Self:
        """The same messages with identifiers, and with them data ids, higher by `shift`."""
        return type(self)(**{f.name: _moved(getattr(self, f.name), shift) for f in fields(self)})


def _moved(codec: Codec[Any], shift: int) -> Codec[Any]:
    data_id = None if codec.e2e_data_id is None else codec.e2e_data_id + shift
    return replace(codec, can_id=codec.can_id + shift, e2e_data_id=data_id)


def build_group(group: type[GroupT], database: Database, dbc: str) -> GroupT:
    """Compile every message that `group` has a field for.

    Raises DatabaseMismatch, naming the file `dbc`, where a message or signal is missing, unknown,
    of another length or of another kind than the group's rows say.
    """
    messages = {_field_name(message.name): message for message in database.messages}
    hints = get_type_hints(group)
    codecs: dict[str, Codec[Any]] = {}
    for field in fields(group):
        (row,) = get_args(hints[field.name])
        if field.name not in messages:
            raise DatabaseMismatch(f"{dbc}: message for `{field.name}` is missing")
        message = messages[field.name]
        length = field.metadata.get("length", 8)
        if message.length != length:
            raise DatabaseMismatch(
                f"{dbc}: message {message.name} has {message.length} bytes, expected {length}"
            )
        codecs[field.name] = _build(
            message, row, field.metadata.get("min_length", length), f"{dbc}: message {message.name}"
        )
    return group(**codecs)


def _field_name(message_name: str) -> str:
    """`Axis_RxSdo` -> `rx_sdo`, `SteerEnc_Angle` -> `steering_angle`."""
    name = re.sub(r"^(Axis|Brg|Sys)_", "", message_name).replace("SteerEnc", "Steering")
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def _build(message: Message, row: type[Any], min_length: int, where: str) -> Codec[Any]:
    attributes = message.dbc.attributes if message.dbc else {}
    values = {name: attribute.value for name, attribute in attributes.items()}
    protected = values.get("E2E_Profile") == _E2E_PROFILE
    signals = _payload(message, protected, where)
    _check_row(signals, row, where)
    try:
        functions = compile_message(message, signals, row, min_length)
    except UnsupportedSignal as error:
        raise DatabaseMismatch(f"{where}: {error}") from None
    return Codec(
        name=message.name,
        can_id=message.frame_id,
        length=message.length,
        min_length=min_length,
        signals=tuple(argument(signal) for signal in signals),
        sender=message.senders[0],
        cycle_time_s=(message.cycle_time or 0) / 1000,
        feeds_watchdog=bool(values.get("FeedsWatchdog")),
        e2e_data_id=int(values.get("E2E_DataID") or 0) if protected else None,
        pack=functions.pack,
        unpack=functions.unpack,
    )


def _payload(message: Message, protected: bool, where: str) -> list[Signal]:
    """Signals in the order of the frame, without CRC and counter of a protected message."""
    signals = sorted(message.signals, key=lambda signal: signal.start)
    if not protected:
        return signals
    crc, counter, *payload = signals
    if (crc.start, crc.length, counter.start, counter.length) != (0, 8, 8, 4):
        raise DatabaseMismatch(f"{where}: E2E profile 2 needs a CRC in byte 0, a counter at bit 8")
    return payload


def _check_row(signals: list[Signal], row: type[Any], where: str) -> None:
    found = {argument(signal): signal for signal in signals}
    wanted = get_type_hints(row)
    for name, kind in wanted.items():
        if name not in found:
            raise DatabaseMismatch(f"{where}: signal `{name}` is missing")
        signal = found[name]
        is_real = bool(signal.is_float) or is_scaled(signal)
        if is_real != (kind is float):
            raise DatabaseMismatch(f"{where}: signal {signal.name} is not of kind {kind.__name__}")
    if tuple(found) != tuple(wanted):
        raise DatabaseMismatch(f"{where}: signals {list(found)}, expected {list(wanted)}")
