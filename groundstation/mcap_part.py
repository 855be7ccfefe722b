"""One part of a recording: an MCAP file that is called `.active` until it is whole."""

import errno
import fcntl
import os
from collections.abc import Iterable
from pathlib import Path

from mcap.writer import CompressionType, Writer

from groundstation.json_schema import inlined_schema
from groundstation.recording_format import ACTIVE, PROFILE, message_type


class PartStream:
    """An unbuffered file that writes all or raises, and is locked while it is open.

    The lock dies with the process: whoever can take it knows that nobody writes any more.
    """

    def __init__(self, path: Path) -> None:
        self.closed = False
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT, 0o644)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.ftruncate(self._file, 0)
        except OSError:
            self.close()
            raise
        self._size = 0

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Append all of it. Raises OSError, after which the end of the file is not whole."""
        rest = memoryview(data)
        while rest:
            written = os.write(self._file, rest)
            self._size += written
            rest = rest[written:]
        return len(data)

    def tell(self) -> int:
        """Bytes written so far."""
        return self._size

    def flush(self) -> None:
        """Nothing waits here: what was written belongs to the operating system."""

    def close(self) -> None:
        """Close the file and give up its lock."""
        if not self.closed:
            self.closed = True
            os.close(self._file)


class McapPart:
    """Writes `<path>.active`, which becomes `<path>` when it is closed whole.

    Every call may raise OSError; after that only `abandon` makes sense.
    """

    def __init__(self, path: Path) -> None:
        if path.exists():
            raise FileExistsError(errno.EEXIST, "there is a recording of that name", str(path))
        self.path = path
        self.active = path.with_name(path.name + ACTIVE)
        self._stream = PartStream(self.active)
        self._writer = Writer(self._stream, compression=CompressionType.ZSTD)  # type: ignore[arg-type]  # any object with write, tell and flush will do
        self._writer.start(profile=PROFILE)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}

    @property
    def size(self) -> int:
        """Bytes on disk."""
        return self._stream.tell()

    def register(self, topics: Iterable[str]) -> None:
        """Make channels, so that their schemas stand at the beginning of the file."""
        for topic in topics:
            self._channel(topic)

    def write(self, topic: str, payload: bytes, log_time_ns: int) -> None:
        """Add one message.

        Raises ValueError for a key that is no published topic of the registry.
        """
        channel = self._channel(topic)
        count = self._counts[topic]
        self._counts[topic] = count + 1
        self._writer.add_message(channel, log_time_ns, payload, log_time_ns, count)

    def flush(self) -> None:
        """Hand everything written so far to the operating system."""
        self._writer.flush()  # type: ignore[no-untyped-call]  # mcap leaves it without types

    def close(self) -> None:
        """Finish the file and give it its final name."""
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it without types
        self._stream.close()
        self.active.rename(self.path)

    def abandon(self) -> None:
        """Leave the file as it is, for `recover`."""
        self._stream.close()

    def _channel(self, topic: str) -> int:
        known = self._channels.get(topic)
        if known is not None:
            return known
        name, message = message_type(topic)
        if name not in self._schemas:
            data = inlined_schema(message)
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", data)
        channel = self._writer.register_channel(topic, "json", self._schemas[name])
        self._channels[topic] = channel
        self._counts[topic] = 0
        return channel
