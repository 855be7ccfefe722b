"""A recorded run judged against truth and the fleet's acceptance bars."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from config.fleet import Fleet
from groundstation import formation_tree, mission_log, summary
from groundstation.formation_error import (
    FormationError,
    Proximity,
    at_common_times,
    formation_error,
    interpolated,
    proximity,
    sightline,
    wrap,
)
from groundstation.formation_tree import leader_of
from groundstation.mission_log import Window
from groundstation.series import Floats, Run, Times, Track
from groundstation.summary import Estimation, Fault, Follower, Leader, Loop, Mode, Summary


def evaluate(
    fleet: Fleet,
    run: Run,
    *,
    mode: Mode,
    seed: int,
    recording: str,
    incidents: Sequence[Fault] = (),
) -> Summary:
    """Judge a run. `incidents` are faults that the messages cannot tell, such as a dead process."""
    mission = mission_log.mission_window(fleet, run)
    judged = mission_log.judged_window(fleet, mission)
    behind = formation_tree.followers(fleet)
    faults = [*mission_log.faults(fleet, run, origin_ns(run, mission)), *incidents]
    unfinished = mission_log.unfinished(fleet, run, mission)
    faulted = {fault.robot for fault in faults}
    followers = {name: _follower(formation_errors(fleet, run, name), judged) for name in behind}
    leader = _leader(fleet, run, judged)
    near = proximity(run.truth, fleet.mission.acceptance.min_distance_m)
    loops = {name: _loop(run, name) for name in fleet.robots if run.status.get(name)}
    why = [
        *(
            f"mission not completed: {text}"
            for name, text in unfinished.items()
            if name not in faulted
        ),
        *(f"{fault.robot} at {fault.t_s:.2f} s: {fault.reason}" for fault in faults),
        *_missed_follower_bars(fleet, followers),
        *_missed_leader_bar(fleet, leader),
        *_too_close(fleet, near),
        *(_overruns(fleet, loops) if mode == "processes" else ()),
    ]
    return Summary(
        verdict="fail" if why else "pass",
        why=why,
        fleet=fleet.name,
        mission=summary.Mission(
            duration_s=fleet.mission.duration_s,
            from_s=fleet.mission.acceptance.from_s,
            seconds_judged=judged.seconds,
            completed=not unfinished,
            mode=mode,
            seed=seed,
            law={name: fleet.robots[name].formation.law for name in behind},
        ),
        followers=followers,
        leader=leader,
        estimation={name: _estimation(fleet, run, name, judged) for name in behind},
        min_distance_m=near.min_distance_m,
        collisions=near.collisions,
        faults=faults,
        loop=loops,
        recording=recording,
    )


def formation_errors(fleet: Fleet, run: Run, follower: str) -> FormationError | None:
    """A follower's errors over the whole run; None without truth of it and its leader."""
    robot = fleet.robots[follower]
    if robot.leader is None or robot.offset is None:
        return None
    if follower not in run.truth or robot.leader not in run.truth:
        return None
    mine, leaders = at_common_times(run.truth[follower], run.truth[robot.leader])
    return formation_error(mine, leaders, robot.offset)


def origin_ns(run: Run, mission: Window | None) -> int:
    """The capture time [ns] that is second 0: start of the mission, else of the recording."""
    if mission is not None:
        return mission.start_ns
    return min((rows[0].t_ns for rows in run.status.values() if rows), default=0)


def _within(t_ns: Times, window: Window) -> NDArray[np.bool_]:
    if window.seconds == 0:
        return np.zeros(t_ns.shape, dtype=np.bool_)
    return (t_ns >= window.start_ns) & (t_ns <= window.end_ns)


def _rms(values: Floats) -> float | None:
    return math.sqrt(float(np.mean(values**2))) if values.size else None


def _follower(error: FormationError | None, window: Window) -> Follower:
    if error is None:
        return Follower(None, None, None)
    rows = _within(error.t_ns, window)
    return Follower(
        range_rms_m=_rms(error.range_m[rows]),
        bearing_rms_rad=_rms(error.bearing_rad[rows]),
        position_rms_m=_rms(error.position_m[rows]),
    )


def _leader(fleet: Fleet, run: Run, window: Window) -> Leader:
    name = leader_of(fleet)
    if name not in run.pose or name not in run.truth:
        return Leader(None, None)
    estimate = run.pose[name].at(_covered(run.pose[name].t_ns, run.truth[name], window))
    truth = interpolated(run.truth[name], estimate.t_ns)
    return Leader(
        position_rmse_m=_rms(np.hypot(estimate.x_m - truth.x_m, estimate.y_m - truth.y_m)),
        heading_rmse_rad=_rms(wrap(estimate.heading_rad - truth.heading_rad)),
    )


def _estimation(fleet: Fleet, run: Run, name: str, window: Window) -> Estimation:
    leader, estimate = fleet.robots[name].leader, run.relative.get(name)
    if estimate is None or leader not in run.truth or name not in run.truth:
        return Estimation(None, None, None)
    mine, leaders = at_common_times(run.truth[name], run.truth[leader])
    if not mine.t_ns.size:
        return Estimation(None, None, None)
    chosen = estimate.at(_covered(estimate.t_ns, mine, window))
    seen = sightline(interpolated(mine, chosen.t_ns), interpolated(leaders, chosen.t_ns))
    return Estimation(
        range_rmse_m=_rms(chosen.range_m - seen.range_m),
        bearing_rmse_rad=_rms(wrap(chosen.bearing_rad - seen.bearing_rad)),
        heading_rmse_rad=_rms(wrap(chosen.heading_rad - seen.heading_rad)),
    )


def _covered(t_ns: Times, truth: Track, window: Window) -> NDArray[np.bool_]:
    """Which estimates lie in the window and within the span of truth."""
    known: NDArray[np.bool_] = (t_ns >= truth.t_ns[0]) & (t_ns <= truth.t_ns[-1])
    return known & _within(t_ns, window)


def _loop(run: Run, name: str) -> Loop:
    last = run.status[name][-1].loop
    return Loop(last.p50_ms, last.p99_ms, last.max_ms, last.overruns, last.cycles)


def _missed_follower_bars(fleet: Fleet, followers: dict[str, Follower]) -> Iterator[str]:
    bars = fleet.mission.acceptance
    for name, error in followers.items():
        if fleet.robots[name].formation.law == "leader_frame":
            yield from _missed(
                f"{name} position error", error.position_rms_m, bars.position_rms_m, "m"
            )
        else:
            yield from _missed(f"{name} range error", error.range_rms_m, bars.range_rms_m, "m")
            yield from _missed(
                f"{name} bearing error", error.bearing_rms_rad, bars.bearing_rms_rad, "rad"
            )


def _missed_leader_bar(fleet: Fleet, leader: Leader) -> Iterator[str]:
    limit = fleet.mission.acceptance.leader_rmse_m
    return _missed(f"{leader_of(fleet)} pose estimate error", leader.position_rmse_m, limit, "m")


def _missed(what: str, value: float | None, limit: float, unit: str) -> Iterator[str]:
    if value is None:
        yield f"{what}: nothing to judge in the recording (limit {limit:g} {unit})"
    elif not value <= limit:
        yield f"{what} {value:.4f} {unit} RMS exceeds the limit {limit:g} {unit}"


def _too_close(fleet: Fleet, near: Proximity) -> Iterator[str]:
    limit = fleet.mission.acceptance.min_distance_m
    if near.collisions and near.min_distance_m is not None:
        yield (
            f"smallest distance between robots {near.min_distance_m:.3f} m is below the limit "
            f"{limit:g} m (collisions: {near.collisions})"
        )


def _overruns(fleet: Fleet, loops: dict[str, Loop]) -> Iterator[str]:
    limit = fleet.mission.acceptance.overrun_fraction
    for name in fleet.robots:
        loop = loops.get(name)
        if loop is None:
            yield f"{name} control loop: no status in the recording"
        elif loop.cycles == 0 or loop.overruns / loop.cycles > limit:
            yield (
                f"{name} control loop: {loop.overruns} of {loop.cycles} cycles overran, "
                f"limit {limit:.1%}"
            )
