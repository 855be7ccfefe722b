"""Log of all CAN frames as BLF files, written by a thread of its own that the loop never waits for.

The loop hands over one batch per cycle; where the queue is full the batch is dropped and counted.
A file is flushed at least every second, so that a killed process loses a second at the most.
"""

import queue
import shutil
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import can

CONTAINER_BYTES = 16_384
"""Of a BLF file: what is not yet compressed and written is lost with the process."""
FLUSH_S = 0.5
QUEUE_BATCHES = 500
"""Some 2.5 s of a loop at 100 Hz that hands over what it received and what it sent."""
_MB = 1e6


class Logged(NamedTuple):
    """One frame on the bus. Time is the wall clock's."""

    wall_s: float
    can_id: int
    data: bytes
    remote: bool = False
    sent: bool = False
    error: bool = False


class BlackBox:
    """Files `<name>-<start>-<number>.blf` in a folder: the last `files`, of about `file_mb` each.

    `dropped` counts frames that were not written; `problem` says why nothing can be any more.

    Raises:
        OSError: the folder cannot be made or written to.
    """

    def __init__(self, folder: Path, name: str, file_mb: float, files: int) -> None:
        self.dropped = 0
        self.problem: str | None = None
        folder.mkdir(parents=True, exist_ok=True)
        self.free_mb = _free_mb(folder)
        self._folder, self._name = folder, name
        self._file_bytes, self._files = file_mb * _MB, files
        self._stem = f"{name}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}"
        self._number = 0
        self._batches: queue.Queue[list[Logged] | None] = queue.Queue(QUEUE_BATCHES)
        self._writer = self._next_file()
        self._thread = threading.Thread(target=self._run, name="black-box", daemon=True)
        self._thread.start()

    def put(self, batch: list[Logged]) -> None:
        """Hand over frames, without waiting."""
        if not batch:
            return
        if self.problem is not None:
            self.dropped += len(batch)
            return
        try:
            self._batches.put_nowait(batch)
        except queue.Full:
            self.dropped += len(batch)

    def close(self, timeout_s: float = 2.0) -> None:
        """Write what waits, and close the file."""
        try:
            self._batches.put(None, timeout=timeout_s)
        except queue.Full:
            return
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self._write_all()
        except Exception as error:  # a full disk, a lost folder, or python-can's own mistakes
            self.problem = f"black box in {self._folder}: {type(error).__name__}: {error}"

    def _write_all(self) -> None:
        flushed_s = time.monotonic()
        while True:
            batch = self._next_batch()
            if batch is None:
                self._writer.stop()
                return
            for frame in batch:
                self._writer.on_message_received(_message(frame))
            if time.monotonic() - flushed_s >= FLUSH_S:
                flushed_s = time.monotonic()
                self._flush()

    def _next_batch(self) -> list[Logged] | None:
        try:
            return self._batches.get(timeout=FLUSH_S)
        except queue.Empty:
            return []

    def _flush(self) -> None:
        self._writer.file.flush()
        self.free_mb = _free_mb(self._folder)
        if self._writer.file_size() >= self._file_bytes:
            self._writer.stop()
            self._writer = self._next_file()

    def _next_file(self) -> "can.BLFWriter":
        """Open the next file, and remove the oldest ones of this robot."""
        import can

        self._number += 1
        path = self._folder / f"{self._stem}-{self._number:04d}.blf"
        writer = can.BLFWriter(path, max_container_size=CONTAINER_BYTES)
        for old in sorted(self._folder.glob(f"{self._name}-*.blf"))[: -self._files]:
            old.unlink(missing_ok=True)
        return writer


def _message(frame: Logged) -> "can.Message":
    import can

    return can.Message(
        timestamp=frame.wall_s,
        arbitration_id=frame.can_id,
        data=None if frame.remote else frame.data,
        is_remote_frame=frame.remote,
        is_error_frame=frame.error,
        is_extended_id=False,
        is_rx=not frame.sent,
    )


def _free_mb(folder: Path) -> float:
    return shutil.disk_usage(folder).free / _MB
