"""Why a bus cannot be opened, and what a controller's error frames say, in words."""

import errno
from enum import Enum

_CONTROLLER = 0x04
_BUS_OFF = 0x40
_RESTARTED = 0x100
_PASSIVE = 0x10 | 0x20
_ACTIVE_AGAIN = 0x40
"""Error classes and bits of data byte 1, as the kernel's can/error.h numbers them."""


class BusNotice(Enum):
    """What an error frame changes."""

    PASSIVE = "passive"
    BUS_OFF = "bus-off"
    RECOVERED = "recovered"


class BusUnavailable(Exception):
    """A bus that cannot be opened: which one, why, and what to do."""

    def __init__(self, interface: str, channel: str, cause: str, advice: str) -> None:
        super().__init__(f"CAN bus {interface}:{channel} cannot be opened: {cause}. {advice}")
        self.interface = interface
        self.channel = channel
        self.cause = cause
        self.advice = advice


def decode_error_frame(error_class: int, data: bytes) -> tuple[BusNotice | None, str]:
    """What an error frame announces, with a sentence; no notice for passing errors."""
    detail = data[1] if len(data) > 1 else 0
    if error_class & _BUS_OFF:
        return BusNotice.BUS_OFF, "controller is bus-off: check wiring, termination and bit rate"
    if error_class & _RESTARTED:
        return BusNotice.RECOVERED, "controller restarted after bus-off"
    if error_class & _CONTROLLER and detail & _PASSIVE:
        return BusNotice.PASSIVE, "controller is error-passive: is any other node powered?"
    if error_class & _CONTROLLER and detail & _ACTIVE_AGAIN:
        return BusNotice.RECOVERED, "controller is error-active again"
    return None, ""


def unavailable(interface: str, channel: str, error: Exception) -> BusUnavailable:
    """The error to raise for what python-can raised on opening."""
    code = _number(error)
    return BusUnavailable(
        interface, channel, str(error).rstrip("."), _advice(interface, channel, code, error)
    )


def _number(error: BaseException | None) -> int | None:
    """The operating system's error number, from the error or from what caused it."""
    while error is not None:
        if isinstance(error, OSError):
            return error.errno
        code = getattr(error, "error_code", None)
        if isinstance(code, int):
            return code
        error = error.__cause__
    return None


def _advice(interface: str, channel: str, code: int | None, error: Exception) -> str:
    if code == errno.EAFNOSUPPORT:
        return "This kernel has no CAN sockets: load the modules can and can_raw, or another kernel"
    if code == errno.ENODEV:
        return f"There is no network interface {channel}: check `ip link`, plug the adapter in"
    if code == errno.ENETDOWN:
        return f"Bring it up: ip link set {channel} up type can bitrate <bit/s>"
    if code in (errno.EACCES, errno.EPERM):
        return f"This user may not use {channel}: check its owner and mode"
    if code in (errno.ENOENT, errno.ECONNREFUSED):
        return f"Nobody serves {channel}: start the process that does, or correct `can.channel`"
    if isinstance(error, NotImplementedError):
        return f"Check `can.interface` in the fleet file and that python-can can load {interface}"
    return "Check `can` in the fleet file and the adapter"
