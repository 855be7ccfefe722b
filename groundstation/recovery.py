"""Makes a whole recording of what is readable in an unfinished or damaged one.

A chunk is the unit: one with a wrong check sum is left out, and after bytes that make no sense
the search goes on at the next chunk.
"""

import errno
import fcntl
import os
import struct
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import CompressionType, Writer

from groundstation.errors import GroundError
from groundstation.recording import MAGIC
from groundstation.recording_format import ACTIVE, PROFILE

RECOVERING, DAMAGED = ".recovering", ".damaged"
RECORD_HEADER = struct.Struct("<BQ")
CHUNK_HEAD = 8 + 8 + 8 + 4
"""Bytes of a chunk before the name of its compression: times, size, check sum."""
COMPRESSIONS = tuple(struct.pack("<I", len(name)) + name for name in (b"zstd", b"lz4"))
LARGEST_CHUNK = 1 << 28
_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
}


class Recovered(msgspec.Struct, frozen=True):
    """What became of a file. `lost_chunks` counts those whose content was not readable."""

    recording: str
    messages: int
    lost_chunks: int
    seconds: float
    last_wall_ns: int
    kept: str | None

    def __str__(self) -> str:
        text = f"{self.recording}: {self.messages} messages, {self.seconds:.1f} s"
        if self.lost_chunks:
            text += f"; {self.lost_chunks} damaged chunks left out"
        return text if self.kept is None else f"{text}; the original is {self.kept}"


class _Tally:
    """Counts while a file is carried over."""

    def __init__(self) -> None:
        self.messages = self.lost_chunks = 0
        self.first_ns, self.last_ns = 1 << 63, 0


def recover(path: Path) -> Recovered:
    """Write what is readable in `path` as a whole recording.

    `x.mcap.active` becomes `x.mcap`, and stays only where more is lost than its end; a damaged
    `x.mcap` is replaced. What stays of the original is called `x.mcap.damaged`.

    Raises GroundError when the file cannot be read, is still being written, or is no MCAP file.
    """
    final = path.with_name(path.name.removesuffix(ACTIVE))
    if final != path and final.exists():
        raise GroundError(f"{final} exists already: move it away, then recover {path} again")
    interim = final.with_name(final.name + RECOVERING)
    try:
        data = _read_alone(path)
        if not data.startswith(MAGIC):
            raise GroundError(f"{path} is {'no MCAP file' if data else 'empty'}: nothing to save")
        with interim.open("wb") as stream:
            tally = _carry_over(data, stream)
            os.fsync(stream.fileno())
        kept = None
        if tally.lost_chunks or final == path:
            kept = final.with_name(final.name + DAMAGED)
            path.rename(kept)
        interim.rename(final)
        if final != path:
            path.unlink(missing_ok=True)
    except OSError as error:
        interim.unlink(missing_ok=True)
        raise GroundError(f"cannot recover {path}: {error.strerror or error}") from error
    return Recovered(
        str(final),
        tally.messages,
        tally.lost_chunks,
        max(0, tally.last_ns - tally.first_ns) * 1e-9,
        tally.last_ns,
        None if kept is None else str(kept),
    )


def left_behind(folder: Path) -> list[Path]:
    """Unfinished recordings in a folder and in the folders below it that nobody writes."""
    found = [*folder.glob(f"*.mcap{ACTIVE}"), *folder.glob(f"*/*.mcap{ACTIVE}")]
    return sorted(path for path in found if not _being_written(path))


def save_left_behind(folder: Path) -> list[str]:
    """Recover what killed recorders left in a folder and those below; returns what to tell."""
    told: list[str] = []
    for path in left_behind(folder):
        try:
            told.append(f"recovered an unfinished recording: {recover(path)}")
        except GroundError as error:
            told.append(f"an unfinished recording stays as it is: {error}")
    return told


def _read_alone(path: Path) -> bytes:
    with path.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise GroundError(f"{path} is still being written: stop its recorder first") from error
        return stream.read()


def _being_written(path: Path) -> bool:
    try:
        _read_lock(path)
    except OSError as error:
        return error.errno in (errno.EWOULDBLOCK, errno.EACCES)
    return False


def _read_lock(path: Path) -> None:
    with path.open("rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)


def _carry_over(data: bytes, stream: object) -> _Tally:
    """Copy schemas, channels and messages; identifiers are given anew."""
    writer = Writer(stream, compression=CompressionType.ZSTD)  # type: ignore[arg-type]  # a file
    tally = _Tally()
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    written_schemas: dict[int, int] = {}
    written: dict[int, int] = {}
    started = False
    for record in _records(data, tally):
        if not started:
            header = record if isinstance(record, Header) else Header(PROFILE, "")
            writer.start(profile=header.profile)
            started = True
        if isinstance(record, Schema):
            schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            channels.setdefault(record.id, record)
            if record.id not in written and (record.schema_id in schemas or not record.schema_id):
                written[record.id] = _register(writer, record, schemas, written_schemas)
        elif isinstance(record, Message) and record.channel_id in written:
            tally.messages += 1
            tally.first_ns = min(tally.first_ns, record.log_time)
            tally.last_ns = max(tally.last_ns, record.log_time)
            writer.add_message(
                written[record.channel_id],
                record.log_time,
                record.data,
                record.publish_time,
                record.sequence,
            )
    if not started:
        writer.start(profile=PROFILE)
    writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it without types
    return tally


def _register(
    writer: Writer, channel: Channel, schemas: dict[int, Schema], written: dict[int, int]
) -> int:
    schema = schemas.get(channel.schema_id)
    if schema is not None and schema.id not in written:
        written[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
    number = 0 if schema is None else written[schema.id]
    return writer.register_channel(
        channel.topic, channel.message_encoding, number, channel.metadata
    )


def _records(data: bytes, tally: _Tally) -> Iterator[McapRecord]:
    """Every readable header, schema, channel and message, in the order of the file."""
    position = len(MAGIC)
    while position + RECORD_HEADER.size <= len(data):
        opcode, length = RECORD_HEADER.unpack_from(data, position)
        start = position + RECORD_HEADER.size
        if opcode == Opcode.DATA_END and length == 4:
            return
        if not 0 < opcode < Opcode.DATA_END or start + length > len(data):
            cut_off = opcode == Opcode.CHUNK and _next_chunk(data, start) is None
            tally.lost_chunks += 0 if cut_off else 1
            found = _next_chunk(data, start)
            if found is None:
                return
            position = found
            continue
        yield from _content(opcode, data[start : start + length], tally)
        position = start + length


def _content(opcode: int, content: bytes, tally: _Tally) -> list[McapRecord]:
    """The records in one record, or none where it cannot be read."""
    stream = ReadDataStream(BytesIO(content))
    try:
        if opcode == Opcode.CHUNK:
            return _unpacked(Chunk.read(stream))
        if opcode == Opcode.MESSAGE:
            return [Message.read(stream, len(content))]
        reader = _READERS.get(opcode)
        return [] if reader is None else [reader(stream)]
    except Exception:  # a flipped byte makes the decoders raise whatever they like
        tally.lost_chunks += 1
        return []


def _unpacked(chunk: Chunk) -> list[McapRecord]:
    if chunk.uncompressed_size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
    return breakup_chunk(chunk, validate_crc=True)


def _next_chunk(data: bytes, start: int) -> int | None:
    """Where the next record begins that is a whole chunk, from its compression's name."""
    marks = [_next_whole(data, start, mark) for mark in COMPRESSIONS]
    return min((mark for mark in marks if mark is not None), default=None)


def _next_whole(data: bytes, start: int, mark: bytes) -> int | None:
    at = data.find(mark, start)
    while at >= 0:
        position = at - CHUNK_HEAD - RECORD_HEADER.size
        if position >= start - RECORD_HEADER.size:
            opcode, length = RECORD_HEADER.unpack_from(data, position)
            end = position + RECORD_HEADER.size + length
            if opcode == Opcode.CHUNK and CHUNK_HEAD + len(mark) < length and end <= len(data):
                return position
        at = data.find(mark, at + 1)
    return None
