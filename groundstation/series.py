"""A recording, read back into one array per quantity and robot."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader
from numpy.typing import NDArray

from config import messages, topics
from groundstation import keys
from groundstation.errors import GroundError

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Rows = NDArray[np.bool_] | NDArray[np.intp]
M = TypeVar("M", bound=messages.Message)


class Track(NamedTuple):
    """Front-wheel midpoint and body heading over time; also a pose estimate's track."""

    t_ns: Times
    x_m: Floats
    y_m: Floats
    heading_rad: Floats

    def at(self, rows: Rows) -> "Track":
        """Some rows of the track."""
        return Track(self.t_ns[rows], self.x_m[rows], self.y_m[rows], self.heading_rad[rows])


class Sightline(NamedTuple):
    """A follower's valid estimates of its leader: range, bearing and relative heading."""

    t_ns: Times
    range_m: Floats
    bearing_rad: Floats
    heading_rad: Floats

    def at(self, rows: Rows) -> "Sightline":
        """Some rows of the estimates."""
        return Sightline(
            self.t_ns[rows], self.range_m[rows], self.bearing_rad[rows], self.heading_rad[rows]
        )


@dataclass(frozen=True, slots=True)
class Run:
    """Everything that a run is judged by, per robot, in order of capture time.

    Pose and relative estimates that their publisher called invalid are left out.
    """

    truth: dict[str, Track] = field(default_factory=dict)
    pose: dict[str, Track] = field(default_factory=dict)
    relative: dict[str, Sightline] = field(default_factory=dict)
    motion: dict[str, list[messages.Motion]] = field(default_factory=dict)
    status: dict[str, list[messages.Status]] = field(default_factory=dict)


def read_run(path: Path) -> Run:
    """Read a finished recording.

    Raises GroundError when the file is missing or is no whole recording.
    """
    try:
        with path.open("rb") as stream:
            found = (
                (channel.topic, message.data)
                for _, channel, message in make_reader(stream).iter_messages()
            )
            return gather(found)
    except OSError as error:
        raise GroundError(f"cannot read the recording {path}: {error.strerror}") from error
    except (McapError, msgspec.MsgspecError, ValueError) as error:
        raise GroundError(f"{path} is not a whole Echelon recording: {error}") from error


def gather(found: Iterable[tuple[str, bytes]]) -> Run:
    """Sort messages, given as (key, JSON payload), into a run."""
    decoders = {topic.name: msgspec.json.Decoder(topic.message) for topic in topics.PUBLISHED}
    rows: dict[str, dict[str, list[msgspec.Struct]]] = {name: {} for name in decoders}
    addresses: dict[str, keys.Address] = {}
    for key, payload in found:
        if key not in addresses:
            addresses[key] = keys.parse(key)
        name, robot = addresses[key].topic.name, addresses[key].robot
        rows[name].setdefault(robot, []).append(decoders[name].decode(payload))
    return Run(
        truth=_tracks(_of(rows[topics.TRUTH.name], messages.Truth)),
        pose=_tracks(_of(rows[topics.POSE.name], messages.PoseEstimate)),
        relative=_sightlines(_of(rows[topics.RELATIVE.name], messages.RelativeEstimate)),
        motion=_of(rows[topics.MOTION.name], messages.Motion),
        status=_of(rows[topics.STATUS.name], messages.Status),
    )


def _of(rows: dict[str, list[msgspec.Struct]], kind: type[M]) -> dict[str, list[M]]:
    """The rows with their type, per robot in a fixed order, each in order of capture time."""
    return {
        robot: sorted((row for row in rows[robot] if isinstance(row, kind)), key=_capture_time)
        for robot in sorted(rows)
    }


def _capture_time(message: messages.Message) -> int:
    return message.t_ns


def _tracks(
    rows: dict[str, list[messages.Truth]] | dict[str, list[messages.PoseEstimate]],
) -> dict[str, Track]:
    return {
        robot: Track(
            _times(found),
            _column(found, lambda row: row.x_m),
            _column(found, lambda row: row.y_m),
            _column(found, lambda row: row.heading_rad),
        )
        for robot, each in rows.items()
        if (found := [row for row in each if row.valid])
    }


def _sightlines(rows: dict[str, list[messages.RelativeEstimate]]) -> dict[str, Sightline]:
    return {
        robot: Sightline(
            _times(found),
            _column(found, lambda row: row.range_m),
            _column(found, lambda row: row.bearing_rad),
            _column(found, lambda row: row.heading_rad),
        )
        for robot, each in rows.items()
        if (found := [row for row in each if row.valid])
    }


def _times(rows: list[M]) -> Times:
    return np.array([row.t_ns for row in rows], dtype=np.int64)


def _column(rows: list[M], value: Callable[[M], float]) -> Floats:
    return np.array([value(row) for row in rows], dtype=np.float64)
