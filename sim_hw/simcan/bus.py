"""python-can interface `simcan`: one simulated CAN bus behind a Unix socket.

The channel is the path of a socket on which `echelon-sim` serves the bus. Behaviour on failure is
that of socketcan: a lost link raises `CanOperationError` on receive and on send, a full transmit
buffer raises it at once (or after the time-out given), so code cannot tell the two apart.
"""

import select
import socket
import struct
import time

import can
from can.typechecking import CanFilters

RECORD = struct.Struct("<IBB2x8sd")
"""One frame: identifier, flags, data length, data, wall-clock time [s]; 24 bytes."""

FLAG_EXTENDED = 0x01
FLAG_REMOTE = 0x02
FLAG_ERROR = 0x04
FLAG_CONTROL = 0x08
"""No frame: byte 0 says whether the host's transmit queue is full."""

_MAX_DATA = 8


def pack_message(message: can.Message) -> bytes:
    """Record of a classic CAN message; raises ValueError for CAN FD or more than 8 bytes."""
    if message.is_fd or message.dlc > _MAX_DATA:
        raise ValueError(f"simcan carries classic CAN frames of up to 8 bytes, not {message}")
    flags = (
        FLAG_EXTENDED * message.is_extended_id
        | FLAG_REMOTE * message.is_remote_frame
        | FLAG_ERROR * message.is_error_frame
    )
    return RECORD.pack(
        message.arbitration_id, flags, message.dlc, bytes(message.data), message.timestamp
    )


def unpack_message(record: bytes, channel: str) -> can.Message:
    """Message of a record as `pack_message` makes it."""
    can_id, flags, dlc, data, timestamp_s = RECORD.unpack(record)
    return can.Message(
        timestamp=timestamp_s,
        arbitration_id=can_id,
        is_extended_id=bool(flags & FLAG_EXTENDED),
        is_remote_frame=bool(flags & FLAG_REMOTE),
        is_error_frame=bool(flags & FLAG_ERROR),
        channel=channel,
        dlc=dlc,
        data=None if flags & FLAG_REMOTE else data[:dlc],
    )


class SimCanBus(can.BusABC):
    """Client of one simulated bus. Hears every frame of the bus but its own.

    Raises `CanInitializationError` when nobody serves `channel`.
    """

    def __init__(
        self,
        channel: str,
        can_filters: CanFilters | None = None,
        **kwargs: object,
    ) -> None:
        self._channel = str(channel)
        self.channel_info = f"simcan {self._channel}"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._socket.connect(self._channel)
        except OSError as error:
            self._socket.close()
            raise can.CanInitializationError(
                f"no simulated CAN bus at {self._channel} ({error.strerror or error}); "
                "start echelon-sim for this fleet",
                error.errno,
            ) from error
        self._socket.setblocking(False)
        self._queue_full = False
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def fileno(self) -> int:
        """File number to poll for received frames."""
        return self._socket.fileno()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Next message, or None after `timeout` seconds (None waits for ever, 0 does not wait).

        The base class counts the time-out on the wall clock; here it is monotonic. Raises
        `CanOperationError` when the bus is gone.
        """
        message, _ = self._recv_internal(timeout)
        return message

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline_s = None if timeout is None else time.monotonic() + timeout
        while True:
            record = self._receive_record()
            if record is None:
                if deadline_s is not None and time.monotonic() >= deadline_s:
                    return None, True
                select.select([self._socket], [], [], _remaining_s(deadline_s))
                continue
            message = unpack_message(record, self._channel)
            if self._matches_filters(message):
                return message, True

    def _receive_record(self) -> bytes | None:
        try:
            record = self._socket.recv(RECORD.size)
        except BlockingIOError:
            return None
        except OSError as error:
            raise self._lost(error) from error
        if not record:
            raise self._lost(None)
        if record[4] & FLAG_CONTROL:
            self._queue_full = bool(record[8])
            return self._receive_record()
        return record

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a message on the bus, waiting up to `timeout` seconds (None and 0 do not wait).

        Raises `CanOperationError` when the transmit buffer stays full or the bus is gone. What the
        simulated controller's queue says is learnt on receiving.
        """
        record = pack_message(msg)
        if self._queue_full:
            raise can.CanOperationError("Transmit buffer full")
        deadline_s = time.monotonic() + (timeout or 0.0)
        while True:
            try:
                self._socket.send(record)
            except BlockingIOError:
                if time.monotonic() >= deadline_s:
                    raise can.CanOperationError("Transmit buffer full") from None
                select.select([], [self._socket], [], _remaining_s(deadline_s))
            except OSError as error:
                raise self._lost(error) from error
            else:
                return

    def shutdown(self) -> None:
        """Leave the bus; may be called again."""
        super().shutdown()
        self._socket.close()

    def _lost(self, error: OSError | None) -> can.CanOperationError:
        reason = "closed by echelon-sim" if error is None else error.strerror
        return can.CanOperationError(
            f"simulated CAN bus {self._channel} is gone: {reason}",
            None if error is None else error.errno,
        )


def _remaining_s(deadline_s: float | None) -> float | None:
    return None if deadline_s is None else max(0.0, deadline_s - time.monotonic())
