"""Reading recordings: all parts as one, and one clear message where a file is none."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.stream_reader import CRCValidationError
from pydantic import ValidationError

from config.fleet import Fleet
from groundstation.errors import GroundError
from groundstation.recording_format import (
    ACTIVE,
    FORMAT_VERSION,
    INFO,
    PROFILE,
    RecordingInfo,
    part_paths,
)

MAGIC = b"\x89MCAP0\r\n"
BROKEN = (McapError, CRCValidationError, msgspec.MsgspecError, ValueError, EOFError)
"""What reading a damaged file raises, besides OSError."""


class Recorded(NamedTuple):
    """One message of a recording; `wall_ns` is its wall time."""

    key: str
    wall_ns: int
    payload: bytes


def read_info(path: Path) -> RecordingInfo:
    """What the recording holds.

    Raises GroundError when the file is missing, unfinished, damaged or no Echelon recording.
    """
    for each in _messages(path, [INFO]):
        return _info(path, each.payload)
    raise GroundError(f"{path} is no Echelon recording: it does not say what it holds")


def recorded_fleet(info: RecordingInfo) -> Fleet:
    """The effective fleet of the recorded run.

    Raises GroundError when this program does not understand it.
    """
    return parse_fleet(info.fleet_json, f"the fleet {info.fleet_name} of the recording")


def parse_fleet(fleet_json: str, what: str) -> Fleet:
    """A recorded effective fleet. Raises GroundError when this program does not understand it."""
    try:
        return Fleet.model_validate_json(fleet_json)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(each) for each in first["loc"])
        raise GroundError(
            f"{what} is not understood: {place}: {first['msg']}; it was written by another "
            "version of Echelon"
        ) from error


def read_messages(path: Path, wanted: list[str] | None = None) -> Iterator[Recorded]:
    """All messages in order of time, of the keys `wanted` or of all, through all parts.

    Raises GroundError as `read_info` does.
    """
    read_info(path)
    for part in part_paths(path):
        yield from _messages(part, wanted)


def keys_in(path: Path) -> list[str]:
    """Keys that the recording has messages of. Raises GroundError as `read_info` does."""
    found: dict[str, None] = {}
    for part in part_paths(path):
        with _opened(part) as reader:
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise GroundError(f"{part} is damaged: it has no summary{_repair(part)}")
            counts = summary.statistics.channel_message_counts
            found |= {
                channel.topic: None
                for number, channel in summary.channels.items()
                if counts.get(number, 0)
            }
    return list(found)


class _opened:  # noqa: N801  # a context manager that reads like a function
    """A reader of one whole part; what goes wrong inside the block becomes a GroundError."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> McapReader:
        path = self._path
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise GroundError(_cannot_read(path, error)) from error
        try:
            _check_ends(path)
            reader = make_reader(self._stream, validate_crcs=True)
            if reader.get_header().profile != PROFILE:
                raise GroundError(
                    f"{path} is no Echelon recording: an MCAP file with profile "
                    f"{reader.get_header().profile!r}, not {PROFILE!r}"
                )
        except BaseException as error:
            self._stream.close()
            self._tell(error)
            raise
        return reader

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._stream.close()
        self._tell(error)

    def _tell(self, error: BaseException | None) -> None:
        if isinstance(error, OSError):
            raise GroundError(_cannot_read(self._path, error)) from error
        if isinstance(error, BROKEN) or type(error).__module__.startswith(("zstandard", "struct")):
            raise GroundError(f"{self._path} is damaged: {error}{_repair(self._path)}") from error


def _messages(path: Path, wanted: list[str] | None) -> Iterator[Recorded]:
    with _opened(path) as reader:
        for _, channel, message in reader.iter_messages(topics=wanted):
            yield Recorded(channel.topic, message.log_time, message.data)


def _check_ends(path: Path) -> None:
    """Whether the file begins and ends as an MCAP file does; GroundError with the remedy if not."""
    size = path.stat().st_size
    if size == 0:
        raise GroundError(f"{path} is empty: nothing was recorded")
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise GroundError(f"{path} is no MCAP file")
        stream.seek(max(0, size - len(MAGIC)))
        if size < 2 * len(MAGIC) or stream.read() != MAGIC:
            raise GroundError(
                f"{path} is not a whole recording, its end is missing: make it whole with "
                f"`echelon recover {path}`"
            )


def _info(path: Path, payload: bytes) -> RecordingInfo:
    try:
        found = msgspec.json.decode(payload, type=RecordingInfo)
    except msgspec.MsgspecError as error:
        raise GroundError(f"{path} does not say what it holds: {error}") from error
    if found.version != FORMAT_VERSION:
        raise GroundError(
            f"{path} has format version {found.version}, this program reads version "
            f"{FORMAT_VERSION}: use the Echelon that wrote it"
        )
    return found


def _cannot_read(path: Path, error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        active = path.with_name(path.name + ACTIVE)
        if active.exists():
            return (
                f"no recording {path}, but {active}: if no recorder writes it any more, make it "
                f"whole with `echelon recover {active}`"
            )
    return f"cannot read the recording {path}: {error.strerror or error}"


def _repair(path: Path) -> str:
    return f"; save what is readable with `echelon recover {path}`"
