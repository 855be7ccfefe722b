"""Error frames as socketcan hands them to a host; numbers of the kernel's can/error.h."""

from config.can.frame import Frame
from sim_hw.can_controller import Controller, ErrorState

ERROR_FLAG = 0x2000_0000
"""Set in the identifier of a Frame that is an error frame, as in the kernel's can_frame."""

_CONTROLLER, _PROTOCOL, _NO_ACK, _BUS_OFF, _BUS_ERROR = 0x04, 0x08, 0x20, 0x40, 0x80
_RESTARTED, _COUNTERS = 0x100, 0x200
_RX_WARNING, _TX_WARNING, _RX_PASSIVE, _TX_PASSIVE, _ACTIVE_AGAIN = 0x04, 0x08, 0x10, 0x20, 0x40
_WHILE_SENDING, _IN_CRC = 0x80, 0x08


def state_changed(host: Controller, t_s: float) -> Frame:
    """The host's controller has changed its error state."""
    if host.state is ErrorState.BUS_OFF:
        return _frame(_BUS_OFF, host, t_s)
    sending = host.transmit_errors >= host.receive_errors
    detail = {
        ErrorState.ACTIVE: _ACTIVE_AGAIN,
        ErrorState.WARNING: _TX_WARNING if sending else _RX_WARNING,
        ErrorState.PASSIVE: _TX_PASSIVE if sending else _RX_PASSIVE,
    }[host.state]
    return _frame(_CONTROLLER, host, t_s, controller=detail)


def restarted(host: Controller, t_s: float) -> Frame:
    """The host's controller is back after bus-off."""
    return _frame(_RESTARTED, host, t_s)


def wire_error(host: Controller, t_s: float, *, sending: bool) -> Frame:
    """A frame was destroyed on the wire (with `berr-reporting on`)."""
    return _frame(
        _PROTOCOL | _BUS_ERROR,
        host,
        t_s,
        protocol=_WHILE_SENDING if sending else 0,
        place=_IN_CRC,
    )


def no_acknowledge(host: Controller, t_s: float) -> Frame:
    """No other node has heard the host's frame."""
    return _frame(_NO_ACK | _BUS_ERROR, host, t_s)


def _frame(
    error_class: int,
    host: Controller,
    t_s: float,
    controller: int = 0,
    protocol: int = 0,
    place: int = 0,
) -> Frame:
    counters = min(host.transmit_errors, 0xFF), min(host.receive_errors, 0xFF)
    data = bytes((0, controller, protocol, place, 0, 0, *counters))
    return Frame(ERROR_FLAG | _COUNTERS | error_class, data, t_s)
