"""A recording, read back into one array per quantity and robot."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from config import messages, topics
from groundstation import keys
from groundstation.errors import GroundError
from groundstation.recording import keys_in, read_messages

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
    poses: dict[str, list[messages.PoseEstimate]] = field(default_factory=dict)
    relatives: dict[str, list[messages.RelativeEstimate]] = field(default_factory=dict)
    events: dict[str, list[messages.Event]] = field(default_factory=dict)
    start: dict[str, list[messages.RobotStart]] = field(default_factory=dict)
    simulated_bus: dict[str, list[messages.SimulatedBus]] = field(default_factory=dict)


GATHERED = (
    topics.TRUTH,
    topics.POSE,
    topics.RELATIVE,
    topics.MOTION,
    topics.STATUS,
    topics.EVENT,
    topics.ROBOT_START,
    topics.SIM_BUS,
)


def read_run(path: Path) -> Run:
    """Read a finished recording.

    Raises GroundError when the file is missing or is no whole recording.
    """
    wanted = [key for key in keys_in(path) if (topic := topic_of(key)) and topic in GATHERED]
    try:
        return gather((each.key, each.payload) for each in read_messages(path, wanted))
    except msgspec.MsgspecError as error:
        raise GroundError(f"{path} is no recording of this version: {error}") from error


def topic_of(key: str) -> topics.Topic | None:
    """The registry's topic that a key of a recording belongs to, if any."""
    try:
        return keys.parse(key).topic
    except ValueError:
        return None


def gather(found: Iterable[tuple[str, bytes]]) -> Run:
    """Sort messages, given as (key, JSON payload), into a run. Other topics are left aside."""
    decoders = {topic.name: msgspec.json.Decoder(topic.message) for topic in GATHERED}
    rows: dict[topics.Topic, dict[str, list[msgspec.Struct]]] = {each: {} for each in GATHERED}
    addresses: dict[str, keys.Address] = {}
    for key, payload in found:
        if key not in addresses:
            addresses[key] = keys.parse(key)
        address = addresses[key]
        if address.topic in rows:
            message = decoders[address.topic.name].decode(payload)
            rows[address.topic].setdefault(address.robot, []).append(message)
    poses = _of(rows[topics.POSE], messages.PoseEstimate)
    relatives = _of(rows[topics.RELATIVE], messages.RelativeEstimate)
    return Run(
        truth=_tracks(_of(rows[topics.TRUTH], messages.Truth)),
        pose=_tracks(poses),
        relative=_sightlines(relatives),
        motion=_of(rows[topics.MOTION], messages.Motion),
        status=_of(rows[topics.STATUS], messages.Status),
        poses=poses,
        relatives=relatives,
        events=_of(rows[topics.EVENT], messages.Event),
        start=_of(rows[topics.ROBOT_START], messages.RobotStart),
        simulated_bus=_of(rows[topics.SIM_BUS], messages.SimulatedBus),
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
