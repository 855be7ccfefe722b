"""Figure 5 (a)-(c): the formation in lockstep, with the spread over seeds from the core alone."""

from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from config.fleet import Fleet
from groundstation import formation_tree
from groundstation.evaluate import evaluate, origin_ns
from groundstation.formation_error import interpolated, sightline
from groundstation.lockstep import run_lockstep
from groundstation.mission_log import mission_window
from groundstation.series import Run, Times, gather
from groundstation.study.drawing import INK, ROBOT_COLOURS, decorate, save
from groundstation.study.formation_cells import FormationResult
from groundstation.study.leader_cells import kept_times_s
from groundstation.study.scenario import Floats, wrapped
from groundstation.summary import Follower

SWITCHING_S = 0.5


class Errors(NamedTuple):
    """One follower's estimate minus truth over mission time."""

    time_s: Floats
    bearing_rad: Floats
    heading_rad: Floats


class Switchings(msgspec.Struct, frozen=True):
    """Largest error of the estimated alpha [rad]: after the switchings, and from `from_s` on."""

    after_switching_rad: float
    overall_rad: float


class LockstepRun(NamedTuple):
    """The fleet, its messages, and the errors of its followers' estimates."""

    fleet: Fleet
    run: Run
    errors: dict[str, Errors]

    def formation(self, seed: int) -> dict[str, Follower]:
        """Formation errors per follower, as `echelon demo` judges them."""
        judged = evaluate(self.fleet, self.run, mode="lockstep", seed=seed, recording="")
        return dict(judged.followers)

    def heading_maxima(self) -> dict[str, Switchings]:
        """Per follower; a switching counts for half a second."""
        switches = switching_times_s(self.fleet)
        found = {}
        for name, error in self.errors.items():
            near = np.zeros(error.time_s.shape, dtype=np.bool_)
            for moment in switches:
                near |= (error.time_s >= moment) & (error.time_s <= moment + SWITCHING_S)
            late = error.time_s >= self.fleet.mission.acceptance.from_s
            size = np.abs(error.heading_rad)
            found[name] = Switchings(float(size[near].max()), float(size[late].max()))
        return found


def switching_times_s(fleet: Fleet) -> list[float]:
    """When the leader changes its turn, in mission time."""
    return list(accumulate(segment.duration_s for segment in fleet.mission.segments))[:-1]


def run_in_lockstep(
    fleet: Fleet, seed: int, progress: Callable[[float], None] | None = None
) -> LockstepRun:
    """Drive the mission with whole robots, buses and devices under virtual time.

    Raises LockstepFailed when a robot does not become ready or refuses.
    """
    messages: list[tuple[str, bytes]] = []
    run_lockstep(fleet, seed, lambda key, body, _: messages.append((key, body)), progress)
    run = gather(messages)
    names = formation_tree.followers(fleet)
    return LockstepRun(fleet, run, {name: _errors(fleet, run, name) for name in names})


def _errors(fleet: Fleet, run: Run, name: str) -> Errors:
    leader = fleet.robots[name].leader
    assert leader is not None, "a follower has a leader"
    window = mission_window(fleet, run)
    origin, estimate = origin_ns(run, window), run.relative[name]
    time_s = _seconds(estimate.t_ns - origin)
    within = (time_s >= 0.0) & (time_s <= fleet.mission.duration_s)
    chosen = estimate.at(within)
    mine, leaders = (interpolated(run.truth[each], chosen.t_ns) for each in (name, leader))
    seen = sightline(mine, leaders)
    return Errors(
        time_s[within],
        wrapped(chosen.bearing_rad - seen.bearing_rad),
        wrapped(chosen.heading_rad - seen.heading_rad),
    )


def _seconds(t_ns: Times) -> Floats:
    return t_ns.astype(np.float64) * 1e-9


def draw_figure5(
    shown: LockstepRun, core_alone: Sequence[FormationResult], seed: int, folder: Path, name: str
) -> list[Path]:
    """Paths, bearing error and direction-angle error, as PNG and PDF."""
    figure = Figure(figsize=(9.5, 5.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25))
    paths, bearings = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    headings = figure.add_subplot(grid[1, 1], sharex=bearings)
    colours = dict(zip(shown.fleet.robots, ROBOT_COLOURS, strict=False))
    _paths(paths, shown, colours)
    decorate(bearings, "(b) observation angle, estimation error", "time [s]", "bearing [rad]")
    decorate(headings, "(c) direction angle, estimation error", "time [s]", "alpha [rad]")
    for follower, error in shown.errors.items():
        bearings.plot(error.time_s, error.bearing_rad, color=colours[follower], lw=0.9)
        headings.plot(error.time_s, error.heading_rad, color=colours[follower], lw=0.9)
    for axes, field in ((bearings, "bearing_error_rad"), (headings, "heading_error_rad")):
        _spread(axes, core_alone, colours, field)
    _mark_switchings(headings, shown)
    figure.suptitle(
        f"Figure 5, formation: in lockstep, fleet {shown.fleet.name}, seed {seed}; "
        f"bands: RMS of {len(core_alone)} seeds, core alone",
        color=INK,
        fontsize=11,
        x=0.01,
        ha="left",
    )
    lines, texts = paths.get_legend_handles_labels()
    figure.legend(lines, texts, loc="outside lower center", ncols=4, frameon=False)
    return save(figure, folder, name)


def _paths(axes: Axes, shown: LockstepRun, colours: Mapping[str, str]) -> None:
    decorate(axes, "(a) true paths", "x [m]", "y [m]")
    for name, track in shown.run.truth.items():
        axes.plot(track.x_m, track.y_m, color=colours[name], lw=1.5, label=name)
        axes.plot(track.x_m[0], track.y_m[0], "o", ms=5, mfc="white", mec=colours[name])
    axes.set_aspect("equal", adjustable="datalim")


def _spread(
    axes: Axes, results: Sequence[FormationResult], colours: Mapping[str, str], field: str
) -> None:
    for follower in results[0].followers if results else ():
        runs = np.array([getattr(result.followers[follower], field) for result in results])
        spread = np.sqrt(np.mean(np.square(runs), axis=0))
        times = kept_times_s()
        axes.fill_between(times, -spread, spread, color=colours[follower], alpha=0.15, lw=0)


def _mark_switchings(axes: Axes, shown: LockstepRun) -> None:
    worst = max(each.after_switching_rad for each in shown.heading_maxima().values())
    for number, moment in enumerate(switching_times_s(shown.fleet)):
        label = f"largest within {SWITCHING_S:g} s of a switching: {worst:.4f} rad"
        axes.axvspan(
            moment,
            moment + SWITCHING_S,
            color="#eef3f7",
            zorder=0,
            label=label if not number else None,
        )
    axes.legend(loc="upper right", fontsize=8, frameon=False)
