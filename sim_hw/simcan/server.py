"""Server of one simulated CAN bus: what `SimCanBus` clients connect to.

Nothing here blocks. A frame of one client goes to the devices (the caller) and to every other
client, as on a bus; a client that does not read loses frames, and these are counted.
"""

import contextlib
import errno
import socket
from pathlib import Path

from config.can.frame import Frame
from config.closing import Closing
from sim_hw.error_frames import ERROR_FLAG
from sim_hw.simcan.bus import FLAG_CONTROL, FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, RECORD

_BACKLOG = 8
_MAX_PATH_BYTES = 107
_MAX_FRAMES_PER_CALL = 1000


class ChannelError(Exception):
    """The bus cannot be served at this path; the text says why and what to do."""


class SimCanServer(Closing):
    """One bus at a socket path. `dropped` counts frames lost to clients that do not read.

    `refused` counts records that no device can hear: extended identifiers and error frames.
    Raises `ChannelError` when the path is in use or unusable.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.dropped = 0
        self.refused = 0
        self._clients: list[socket.socket] = []
        self._listener = _listen(path)

    @property
    def clients(self) -> int:
        """How many clients are on the bus."""
        return len(self._clients)

    def filenos(self) -> list[int]:
        """File numbers that become readable when `receive` has something to do."""
        return [self._listener.fileno(), *(client.fileno() for client in self._clients)]

    def receive(self, t_s: float, wall_s: float) -> list[Frame]:
        """Accept waiting clients, pass their frames on, and return those frames.

        `t_s` is the monotonic time that the frames are stamped with, `wall_s` the same instant on
        the wall clock, which the other clients see.
        """
        self._accept()
        frames: list[Frame] = []
        for client in list(self._clients):
            for _ in range(_MAX_FRAMES_PER_CALL):
                record = self._read(client)
                if record is None:
                    break
                can_id, flags, dlc, data, _ = RECORD.unpack(record)
                self._relay(RECORD.pack(can_id, flags, dlc, data, wall_s), client)
                if flags & (FLAG_EXTENDED | FLAG_ERROR):
                    self.refused += 1
                    continue
                remote = bool(flags & FLAG_REMOTE)
                frames.append(Frame(can_id, b"" if remote else data[:dlc], t_s, remote))
        return frames

    def send(self, frame: Frame, wall_s: float) -> None:
        """Send a device's frame, or an error frame, to every client, stamped with `wall_s`."""
        if self._clients:
            flags = FLAG_REMOTE if frame.remote else 0
            if frame.can_id & ERROR_FLAG:
                flags |= FLAG_ERROR
            can_id = frame.can_id & ~ERROR_FLAG
            record = RECORD.pack(can_id, flags, len(frame.data), frame.data, wall_s)
            self._relay(record, None)

    def tell_queue(self, full: bool) -> None:
        """Tell every client whether the host's transmit queue is full."""
        self._relay(RECORD.pack(0, FLAG_CONTROL, 1, bytes((full,)), 0.0), None)

    def reopen(self) -> None:
        """Serve the same path again after `close`. Raises ChannelError."""
        self._listener = _listen(self.path)

    def close(self) -> None:
        """Disconnect everybody and remove the socket file."""
        for client in self._clients:
            client.close()
        self._clients.clear()
        self._listener.close()
        self.path.unlink(missing_ok=True)

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                client, _ = self._listener.accept()
                client.setblocking(False)
                self._clients.append(client)

    def _read(self, client: socket.socket) -> bytes | None:
        """Next record of a client; None when there is none for now or the client has left."""
        try:
            record = client.recv(RECORD.size)
        except BlockingIOError:
            return None
        except OSError:
            record = b""
        if len(record) == RECORD.size:
            return record
        self._drop_client(client)
        return None

    def _relay(self, record: bytes, sender: socket.socket | None) -> None:
        for client in list(self._clients):
            if client is sender:
                continue
            try:
                client.send(record)
            except BlockingIOError:
                self.dropped += 1
            except OSError:
                self._drop_client(client)

    def _drop_client(self, client: socket.socket) -> None:
        client.close()
        if client in self._clients:
            self._clients.remove(client)


def _listen(path: Path) -> socket.socket:
    if len(str(path).encode()) > _MAX_PATH_BYTES:
        raise ChannelError(
            f"CAN channel {path} is longer than the {_MAX_PATH_BYTES} bytes that a Unix socket "
            "may have; give the fleet a shorter `channel`"
        )
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_if_stale(path)
        listener.bind(str(path))
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        raise ChannelError(f"cannot serve CAN channel {path}: {error.strerror or error}") from error
    except ChannelError:
        listener.close()
        raise
    listener.setblocking(False)
    return listener


def _remove_if_stale(path: Path) -> None:
    """Remove a socket file that nobody serves; raise ChannelError when somebody answers there."""
    if not path.exists():
        return
    if not path.is_socket():
        raise ChannelError(f"CAN channel {path} is a file, not a socket; remove it")
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except OSError as error:
            if error.errno == errno.ECONNREFUSED:
                path.unlink()
                return
    raise ChannelError(
        f"CAN channel {path} is in use: another echelon-sim serves it; end that one first"
    )
