"""What a report tells of one recording: read, judged against truth, brought into series."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from config import topics
from config.fleet import Fleet
from config.messages import BusHealth, Message
from groundstation import formation_tree, mission_log
from groundstation.evaluate import evaluate, origin_ns
from groundstation.formation_error import interpolated, sightline, wrap
from groundstation.recording import keys_in, read_info, read_messages, recorded_fleet
from groundstation.recording_format import RecordingInfo
from groundstation.series import Floats, Run, Track, read_run, topic_of
from groundstation.summary import Mode, Summary

CAUSES_SHOWN = 200


class Steps(NamedTuple):
    """Each recorded step of a robot: its time, the time since the one before, how late it was."""

    time_s: Floats
    interval_s: Floats
    late_s: Floats
    bus_load: Floats


class Band(NamedTuple):
    """An estimate over mission time: error against truth (None without it) and deviation."""

    time_s: Floats
    error: Floats | None
    std: Floats


class Happening(NamedTuple):
    """Something in the log of the run; `kind` is a state, "info", "warning" or "error"."""

    time_s: float
    robot: str
    kind: str
    text: str


class Told(NamedTuple):
    """One run, ready to be shown."""

    path: Path
    info: RecordingInfo
    fleet: Fleet
    run: Run
    judged: Summary
    origin_ns: int
    steps: dict[str, Steps]

    @property
    def has_truth(self) -> bool:
        """Whether anything knows where the robots really were."""
        return bool(self.run.truth)


class _Light(Message, frozen=True, kw_only=True):
    """Of a step's record, what a report needs: the rest is not decoded."""

    now_s: float
    late_s: float
    bus: BusHealth


def read_told(path: Path) -> Told:
    """Read and judge a recording. Raises GroundError when it is no whole Echelon recording."""
    info = read_info(path)
    fleet, run = recorded_fleet(info), read_run(path)
    origin = origin_ns(run, mission_log.mission_window(fleet, run))
    mode: Mode = "lockstep" if info.mode == "lockstep" else "processes"
    judged = evaluate(
        fleet,
        run,
        mode=mode,
        seed=info.seed,
        recording=str(path),
        incidents=mission_log.incidents(run, origin),
    )
    return Told(path, info, fleet, run, judged, origin, _steps(path, origin))


def _steps(path: Path, origin: int) -> dict[str, Steps]:
    wanted = [key for key in keys_in(path) if topic_of(key) is topics.STEP]
    decoder = msgspec.json.Decoder(_Light)
    rows: dict[str, list[tuple[float, float, float]]] = {}
    for each in read_messages(path, wanted) if wanted else ():
        light = decoder.decode(each.payload)
        robot = each.key.split("/")[2]
        rows.setdefault(robot, []).append((light.now_s, light.late_s, light.bus.load))
    found: dict[str, Steps] = {}
    for robot, each_row in rows.items():
        now, late, load = np.array(sorted(each_row)).T
        found[robot] = Steps(now - origin * 1e-9, np.diff(now, prepend=now[0]), late, load)
    return found


def seconds(t_ns: list[int], origin: int) -> Floats:
    """Mission time of capture times."""
    return (np.array(t_ns, dtype=np.int64) - origin).astype(np.float64) * 1e-9


def leader_bands(told: Told) -> dict[str, Band]:
    """The leader's localisation: x, y, heading; error estimate minus truth."""
    name = formation_tree.leader_of(told.fleet)
    rows = [row for row in told.run.poses.get(name, []) if row.valid]
    if not rows:
        return {}
    truth = told.run.truth.get(name)
    if truth is not None:
        rows = [row for row in rows if truth.t_ns[0] <= row.t_ns <= truth.t_ns[-1]]
    t_ns = [row.t_ns for row in rows]
    time_s = seconds(t_ns, told.origin_ns)
    known = interpolated(truth, np.array(t_ns, dtype=np.int64)) if truth is not None else None
    values = np.array([(row.x_m, row.y_m, row.heading_rad) for row in rows])
    variances = np.array([[row.covariance[n] for n in (0, 5, 15)] for row in rows])
    true = None if known is None else np.array([known.x_m, known.y_m, known.heading_rad]).T
    return _bands(time_s, ("x [m]", "y [m]", "heading [rad]"), values, true, variances)


def follower_bands(told: Told, name: str) -> dict[str, Band]:
    """A follower's estimate of its leader: range, bearing, relative heading."""
    rows = [row for row in told.run.relatives.get(name, []) if row.valid]
    leader = told.fleet.robots[name].leader
    mine, theirs = told.run.truth.get(name), told.run.truth.get(leader or "")
    if not rows:
        return {}
    true = None
    if mine is not None and theirs is not None:
        first = max(int(mine.t_ns[0]), int(theirs.t_ns[0]))
        last = min(int(mine.t_ns[-1]), int(theirs.t_ns[-1]))
        rows = [row for row in rows if first <= row.t_ns <= last]
        moments = np.array([row.t_ns for row in rows], dtype=np.int64)
        seen = sightline(interpolated(mine, moments), interpolated(theirs, moments))
        true = np.array([seen.range_m, seen.bearing_rad, seen.heading_rad]).T
    time_s = seconds([row.t_ns for row in rows], told.origin_ns)
    values = np.array([(row.range_m, row.bearing_rad, row.heading_rad) for row in rows])
    variances = np.array([[row.covariance[n] for n in (0, 5, 10)] for row in rows])
    names = ("range [m]", "bearing [rad]", "relative heading [rad]")
    return _bands(time_s, names, values, true, variances)


def _bands(
    time_s: Floats, names: tuple[str, ...], values: Floats, true: Floats | None, variances: Floats
) -> dict[str, Band]:
    found: dict[str, Band] = {}
    for column, name in enumerate(names):
        error = None
        if true is not None:
            error = values[:, column] - true[:, column]
            error = wrap(error) if "rad" in name else error
        found[name] = Band(time_s, error, np.sqrt(np.maximum(variances[:, column], 0.0)))
    return found


def inside_two_sigma(band: Band, from_s: float) -> float | None:
    """Share of the errors from `from_s` on that lie within two standard deviations."""
    late = band.time_s >= from_s
    if band.error is None or not np.any(late):
        return None
    return float(np.mean(np.abs(band.error[late]) <= 2 * band.std[late]))


def believed_tracks(told: Told) -> dict[str, Track]:
    """Where followers are by their own estimates, through the chain up to the leader's pose."""
    known = {name: track for name, track in told.run.pose.items() if track.t_ns.size}
    waiting = formation_tree.followers(told.fleet)
    for _ in range(len(waiting)):
        for name in waiting:
            leader = known.get(told.fleet.robots[name].leader or "")
            seen = told.run.relative.get(name)
            if leader is None or seen is None or name in known:
                continue
            inside = (seen.t_ns >= leader.t_ns[0]) & (seen.t_ns <= leader.t_ns[-1])
            line = seen.at(inside)
            ahead = interpolated(leader, line.t_ns)
            heading = ahead.heading_rad - line.heading_rad
            towards = heading + line.bearing_rad
            known[name] = Track(
                line.t_ns,
                ahead.x_m - line.range_m * np.cos(towards),
                ahead.y_m - line.range_m * np.sin(towards),
                heading,
            )
    return known


def happenings(told: Told) -> list[Happening]:
    """States with their reasons and all events, in order of time."""
    return sorted([*_states(told), *_events(told)], key=lambda each: each.time_s)[:CAUSES_SHOWN]


def _states(told: Told) -> Iterator[Happening]:
    for name in told.fleet.robots:
        before = ""
        for row in told.run.motion.get(name, []):
            if row.state != before:
                time_s = (row.t_ns - told.origin_ns) * 1e-9
                yield Happening(time_s, name, row.state, row.reason)
                before = row.state


def _events(told: Told) -> Iterator[Happening]:
    for name, rows in told.run.events.items():
        for row in rows:
            time_s = (row.t_ns - told.origin_ns) * 1e-9
            yield Happening(time_s, name, row.severity, row.text)
