"""The one owner of a robot's CAN bus: python-can behind frames, counters and named states.

The control loop drains it with `receive` at every tick; there is no thread. A lost link is opened
again with a growing pause; what the robot does then is not the port's business, and nothing that
was meant for the old link is sent on the new one. Setpoints are never handed to python-can's
periodic sending, which would go on while the loop hangs, and a frame that could not be sent is
dropped and counted, never tried again later. No filter is set, because python-can's `recv(0)` says
"nothing more" at the first frame that a software filter takes out.
"""

import contextlib
import errno
from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from config.can.frame import Frame
from config.messages import BusHealth
from onboard.canbus.black_box import BlackBox, Logged
from onboard.canbus.bus_errors import BusNotice, BusUnavailable, decode_error_frame, unavailable
from onboard.canbus.bus_load import BusLoad

if TYPE_CHECKING:
    import can

MAX_PER_RECEIVE = 512
REOPEN_FIRST_S, REOPEN_MOST_S = 0.2, 2.0
"""Pause before a lost link is tried again; it doubles from try to try."""
MAX_FRAME_AGE_S = 0.05
"""Limit for the age of a received frame: a step of the wall clock must not age it more."""

_BITRATE_SET_ELSEWHERE = frozenset(
    ("socketcan", "simcan", "virtual", "udp_multicast", "socketcand")
)
_LINK_LOST = frozenset(
    (
        errno.ENETDOWN,
        errno.ENODEV,
        errno.ENXIO,
        errno.EPIPE,
        errno.ECONNRESET,
        errno.ECONNREFUSED,
        errno.ENOTCONN,
        errno.EBADF,
        errno.ESHUTDOWN,
    )
)


class BusState(StrEnum):
    """State of the bus as the port sees it. LOST ends when the link is open again."""

    ACTIVE = "active"
    PASSIVE = "passive"
    BUS_OFF = "bus-off"
    LOST = "lost"
    CLOSED = "closed"


_STATE_OF = {
    BusNotice.PASSIVE: BusState.PASSIVE,
    BusNotice.BUS_OFF: BusState.BUS_OFF,
    BusNotice.RECOVERED: BusState.ACTIVE,
}
_USABLE = (BusState.ACTIVE, BusState.PASSIVE)


class CanPort:
    """An open bus. `state` and `reason` say how it is, the counters are in `health`.

    `reopen` makes a new bus where the link was lost; without it the port stays lost. `black_box`
    gets every frame.
    """

    def __init__(
        self,
        bus: "can.BusABC",
        bitrate: int = 500_000,
        reopen: Callable[[], "can.BusABC"] | None = None,
        black_box: BlackBox | None = None,
    ) -> None:
        self.state = BusState.ACTIVE
        self.reason = "open"
        self._bus = bus
        self._received = 0
        self._sent = 0
        self._send_failures = 0
        self._error_frames = 0
        self._reopened = 0
        self._reopen = reopen
        self._next_try_s: float | None = None
        self._pause_s = REOPEN_FIRST_S
        self._load = BusLoad(bitrate)
        self._black_box = black_box
        self._log: list[Logged] = []
        self._lost_for = ""
        self._told_of_box = False
        self._wall_offset_s = 0.0
        self._notes: list[str] = []

    @classmethod
    def open(
        cls, interface: str, channel: str, bitrate: int, black_box: BlackBox | None = None
    ) -> Self:
        """Open a bus in python-can's words; raises BusUnavailable.

        `bitrate` [bit/s] is passed on only to interfaces that set it; on socketcan, for one, it
        is a setting of the network interface.
        """

        def make() -> "can.BusABC":
            return _open_bus(interface, channel, bitrate)

        return cls(make(), bitrate, make, black_box)

    def receive(self, now_s: float, wall_s: float) -> list[Frame]:
        """Take what has arrived, without waiting, at most 512 frames.

        `now_s` and `wall_s` are the monotonic and the wall clock at this moment. python-can
        stamps frames with the wall clock; the result carries monotonic time.
        """
        frames: list[Frame] = []
        self._wall_offset_s = wall_s - now_s
        if self.state is BusState.LOST:
            self._try_again(now_s)
        if self.state in (BusState.LOST, BusState.CLOSED):
            return frames
        for _ in range(MAX_PER_RECEIVE):
            try:
                message = self._bus.recv(0)
            except Exception as error:  # python-can lets OSError, ValueError, struct.error through
                self._lose(f"receiving failed: {_text(error)}")
                break
            if message is None:
                break
            if self._black_box is not None:
                self._log.append(_logged(message))
            if message.is_error_frame:
                self._on_error_frame(message.arbitration_id, bytes(message.data))
            elif not message.is_extended_id:
                age_s = min(max(wall_s - message.timestamp, 0.0), MAX_FRAME_AGE_S)
                frames.append(_frame(message, now_s - age_s))
        self._received += len(frames)
        self._load.count(frames)
        self._load.at(now_s)
        if self._black_box is not None:
            self._hand_over()
        return frames

    def send(self, frames: Iterable[Frame]) -> int:
        """Send without waiting and return how many frames went; the others are counted, dropped."""
        went = 0
        for frame in frames:
            if self.state in _USABLE and self._send_one(frame):
                went += 1
                self._load.count((frame,))
                if self._black_box is not None:
                    wall_s = frame.t_s + self._wall_offset_s
                    self._log.append(
                        Logged(wall_s, frame.can_id, frame.data, frame.remote, sent=True)
                    )
            else:
                self._send_failures += 1
        self._sent += went
        return went

    def health(self) -> BusHealth:
        """State with its reason, and the counters since the port was made."""
        return BusHealth(
            state=self.state,
            reason=self.reason,
            received=self._received,
            sent=self._sent,
            send_failures=self._send_failures,
            error_frames=self._error_frames,
            load=self._load.load,
            reopened=self._reopened,
            log_dropped=0 if self._black_box is None else self._black_box.dropped,
        )

    def take_notes(self) -> list[str]:
        """What people should know of the link and the black box since the last call."""
        notes, self._notes = self._notes, []
        return notes

    def close(self) -> None:
        """Give the bus back; the port cannot be used again."""
        if self.state is not BusState.CLOSED:
            if self._black_box is not None:
                self._hand_over()
            self._bus.shutdown()
            self.state, self.reason = BusState.CLOSED, "closed"

    def _try_again(self, now_s: float) -> None:
        """Open the lost link once its pause is over; the pause grows with every failure."""
        if self._reopen is None:
            return
        if self._next_try_s is None:
            self._next_try_s = now_s + self._pause_s
        if now_s < self._next_try_s:
            return
        with contextlib.suppress(Exception):  # the old bus is gone, however it takes its leave
            self._bus.shutdown()
        try:
            bus = self._reopen()
        except BusUnavailable as error:
            self._pause_s = min(2 * self._pause_s, REOPEN_MOST_S)
            self._next_try_s = now_s + self._pause_s
            self.reason = f"{self._lost_for}; not open again: {error}"
            return
        self._notes.append(f"CAN link open again; it was lost because {self._lost_for}")
        self._bus, self._next_try_s, self._pause_s = bus, None, REOPEN_FIRST_S
        self._reopened += 1
        self.state, self.reason = BusState.ACTIVE, "open again"

    def _hand_over(self) -> None:
        box, batch = self._black_box, self._log
        assert box is not None, "only called with a black box"
        self._log = []
        box.put(batch)
        if box.problem is not None and not self._told_of_box:
            self._told_of_box = True
            self._notes.append(f"{box.problem}: nothing is logged any more")

    def _send_one(self, frame: Frame) -> bool:
        try:
            self._bus.send(_message(frame), timeout=0)
        except Exception as error:  # python-can lets OSError through
            if _is_link_loss(error):
                self._lose(f"sending failed: {_text(error)}")
            return False
        return True

    def _on_error_frame(self, error_class: int, data: bytes) -> None:
        self._error_frames += 1
        notice, text = decode_error_frame(error_class, data)
        if notice is not None:
            self.state, self.reason = _STATE_OF[notice], text

    def _lose(self, reason: str) -> None:
        self.state, self.reason, self._lost_for = BusState.LOST, reason, reason


def _open_bus(interface: str, channel: str, bitrate: int) -> "can.BusABC":
    import can

    try:
        if interface in _BITRATE_SET_ELSEWHERE:
            return can.Bus(channel, interface, ignore_config=True)
        return can.Bus(channel, interface, ignore_config=True, bitrate=bitrate)
    except Exception as error:  # back-ends raise whatever their libraries do
        raise unavailable(interface, channel, error) from error


def _logged(message: "can.Message") -> Logged:
    return Logged(
        message.timestamp,
        message.arbitration_id,
        bytes(message.data),
        message.is_remote_frame,
        error=message.is_error_frame,
    )


def _frame(message: "can.Message", t_s: float) -> Frame:
    return Frame(message.arbitration_id, bytes(message.data), t_s, message.is_remote_frame)


def _message(frame: Frame) -> "can.Message":
    import can

    return can.Message(
        arbitration_id=frame.can_id,
        data=None if frame.remote else frame.data,
        is_remote_frame=frame.remote,
        is_extended_id=False,
    )


def _is_link_loss(error: Exception) -> bool:
    """A full buffer, or any error that python-can gives no number for, is no loss of the link."""
    code = error.errno if isinstance(error, OSError) else getattr(error, "error_code", None)
    return code in _LINK_LOST


def _text(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


__all__ = ["BusState", "BusUnavailable", "CanPort"]
