"""`echelon dataset`: real robots' recordings played to onboard robots, judged by motion capture."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from groundstation.dataset_figure import draw_track
from groundstation.dataset_fleet import Start, dataset_fleet, robot_name
from groundstation.dataset_follow import FollowScore, follow_score
from groundstation.dataset_play import Played, Progress, play_lockstep
from groundstation.dataset_report import DataSetReport, mean_position_rms_m, misses
from groundstation.dataset_score import RobotScore, pose_errors, pose_track, score, truth_at
from groundstation.errors import GroundError
from groundstation.lockstep import DataSetError, Recording, read_recording, robots_in

UNKNOWN_START_JUDGED_FROM_S = 120.0
WHOLE_S = float("inf")


@dataclass(frozen=True, slots=True)
class Options:
    """What to play. `robots` is a number or "all", `follow` "FOLLOWER:LEADER"."""

    folder: Path
    robots: str
    start: Start
    follow: str | None
    realtime: bool
    seconds: float | None
    out: Path | None
    say: Callable[[str], None]
    progress: Progress


def run_dataset(options: Options) -> DataSetReport:
    """Play, judge and draw.

    Raises GroundError for a data set or a wish that cannot be played.
    """
    try:
        return _run(options)
    except DataSetError as error:
        raise GroundError(str(error)) from error


def _run(options: Options) -> DataSetReport:
    if options.realtime and options.follow is not None:
        raise GroundError("--follow plays in lockstep only: leave --realtime out")
    pair = None if options.follow is None else _pair(options.follow)
    read = cache(lambda number: read_recording(options.folder, number))
    recordings = {n: read(n) for n in _numbers(options)}
    for each in recordings.values():
        _tell_unknown(each, options.say)
    followed = None if pair is None else _shared_time(read(pair[0]), read(pair[1]))
    out = _results_folder(options)
    robots = {str(n): _one(options, each, out) for n, each in recordings.items()}
    why = misses(robots)
    return DataSetReport(
        verdict="fail" if why else "pass",
        why=why,
        data_set=str(options.folder),
        mode="processes" if options.realtime else "lockstep",
        start=options.start,
        mean_position_rms_m=mean_position_rms_m(robots),
        robots=robots,
        follow=None if followed is None else _follow(options, *followed),
        results=str(out),
    )


def _one(options: Options, recording: Recording, out: Path) -> RobotScore:
    """One robot on its recording, alone."""
    number, name = recording.robot, robot_name(recording.robot)
    limit_s = options.seconds or WHOLE_S
    if options.realtime:
        from groundstation.dataset_processes import play_processes

        played = play_processes(recording, options.start, limit_s, out, options.progress)
    else:
        fleet = dataset_fleet({number: recording}, options.start)
        played = play_lockstep(fleet, {name: recording}, limit_s, options.progress)[name]
    return _judge(options, recording, played, out)


def _judge(options: Options, recording: Recording, played: Played, out: Path) -> RobotScore:
    from_s = UNKNOWN_START_JUDGED_FROM_S if options.start == "unknown" else 0.0
    track = pose_track(played.trusted_poses)
    truth = truth_at(recording, track.t_s)
    errors = pose_errors(track, truth, from_s)
    if not len(errors.t_s):
        raise GroundError(
            f"robot {recording.robot}: no pose estimate to judge between {from_s:g} and "
            f"{played.seconds:.1f} s: play more --seconds"
        )
    draw_track(recording, track, truth, pose_errors(track, truth, 0.0), out / _picture(recording))
    return score(
        recording,
        errors,
        seconds=played.seconds,
        judged_from_s=from_s,
        times_real_time=played.seconds / played.real_s,
        trusted_from_s=played.trusted_from_s,
        trusted_share=played.trusted_share(from_s),
        rejected=played.poses[-1][1].rejected,
    )


def _follow(options: Options, follower: Recording, leader: Recording) -> FollowScore:
    names = robot_name(follower.robot), robot_name(leader.robot)
    recordings = {leader.robot: leader, follower.robot: follower}
    fleet = dataset_fleet(recordings, options.start, (follower.robot, leader.robot))
    by_name = {robot_name(number): each for number, each in recordings.items()}
    played = play_lockstep(fleet, by_name, options.seconds or WHOLE_S, options.progress)
    estimates = played[names[0]]
    return follow_score(follower, leader, estimates, estimates.seconds)


def _shared_time(one: Recording, two: Recording) -> tuple[Recording, Recording]:
    """Both recordings over the time that they share."""
    start_s, end_s = max(one.start_s, two.start_s), min(one.end_s, two.end_s)
    if start_s >= end_s:
        raise GroundError(
            f"{one.path}: robots {one.robot} and {two.robot} were not recorded together"
        )
    return (
        one._replace(start_s=start_s, end_s=end_s),
        two._replace(start_s=start_s, end_s=end_s),
    )


def _numbers(options: Options) -> list[int]:
    if options.robots == "all":
        return robots_in(options.folder)
    if not re.fullmatch(r"[1-9][0-9]{0,3}", options.robots):
        raise GroundError(f"--robot {options.robots!r}: give a robot's number, or all")
    return [int(options.robots)]


def _pair(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([1-9][0-9]{0,3}):([1-9][0-9]{0,3})", text)
    if match is None or match[1] == match[2]:
        raise GroundError(
            f"--follow {text!r}: give two robots' numbers as FOLLOWER:LEADER, e.g. 2:1"
        )
    return int(match[1]), int(match[2])


def _tell_unknown(recording: Recording, say: Callable[[str], None]) -> None:
    unknown = recording.unknown_barcodes
    if unknown:
        counts = ", ".join(f"barcode {barcode} ({n} x)" for barcode, n in unknown.items())
        say(
            f"robot {recording.robot}: {counts} not in Barcodes.dat: misread, or a subject is "
            "missing there; these measurements are left out"
        )


def _results_folder(options: Options) -> Path:
    name = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-dataset-{options.folder.resolve().name}"
    path = options.out if options.out is not None else Path("runs") / name
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GroundError(f"cannot make the folder {path}: {error.strerror}") from error
    return path


def _picture(recording: Recording) -> str:
    return f"robot{recording.robot}.png"
