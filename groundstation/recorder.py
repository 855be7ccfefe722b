"""Recording of a run: an MCAP file with one channel per key expression, payloads as they came."""

from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from groundstation import keys
from groundstation.json_schema import inlined_schema

PROFILE = "echelon"


class Recorder:
    """Writes `<path>.active`, which becomes `<path>` when it is closed whole.

    The same calls give the same bytes. The owner calls `flush` now and then, so that a killed
    process loses little.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._active = path.with_name(path.name + ".active")
        self._stream = self._active.open("wb")
        self._writer = Writer(self._stream, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}

    def write(self, topic: str, payload: bytes, log_time_ns: int) -> None:
        """Add one message; `log_time_ns` is its wall time.

        Raises ValueError for a key that is no published topic of the registry.
        """
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._register(topic)
        count = self._counts[topic]
        self._counts[topic] = count + 1
        self._writer.add_message(channel, log_time_ns, payload, log_time_ns, count)

    def flush(self) -> None:
        """Hand everything written so far to the operating system."""
        self._writer.flush()  # type: ignore[no-untyped-call]  # mcap leaves it without types

    def close(self) -> None:
        """Finish the file and give it its final name. Closing again does nothing."""
        if self._stream.closed:
            return
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it without types
        self._stream.close()
        self._active.rename(self._path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _register(self, topic: str) -> int:
        message = keys.parse(topic).topic.message
        name = f"echelon.{message.__name__}"
        if name not in self._schemas:
            data = inlined_schema(message)
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", data)
        channel = self._writer.register_channel(topic, "json", self._schemas[name])
        self._channels[topic] = channel
        self._counts[topic] = 0
        return channel
