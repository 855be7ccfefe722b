"""Figures of a run: the paths, and the formation errors over time."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from config.fleet import Fleet
from groundstation import formation_tree
from groundstation.evaluate import formation_errors, origin_ns
from groundstation.mission_log import Window, judged_window, mission_window
from groundstation.series import Floats, Run, Times, Track

ESTIMATE = "#6ec1e4"
COLOURS = ("#1b3a57", "#d1495b", "#2a9d8f", "#e9a23b", "#7b5ea7", "#5c7f2e", "#b0578d", "#4a90c2")
INK, FAINT, SHADE = "#333333", "#9a9a9a", "#eef3f7"
LINK_PERIOD_S = 5.0
MARGIN_S = 1.0
DPI = 150


def draw_trajectories(fleet: Fleet, run: Run, path: Path) -> None:
    """Write `trajectory_figure` as a picture."""
    _save(trajectory_figure(fleet, run), path)


def draw_formation(fleet: Fleet, run: Run, path: Path) -> None:
    """Write `formation_figure` as a picture."""
    _save(formation_figure(fleet, run), path)


def trajectory_figure(
    fleet: Fleet, run: Run, believed: Mapping[str, Track] | None = None
) -> Figure:
    """True paths of all robots, the leader's own estimate, the formation every 5 s, landmarks.

    `believed` are paths to draw for robots that nobody knows the truth of.
    """
    figure = Figure(figsize=(8, 7), layout="constrained")
    axes: Axes = figure.add_subplot()
    _decorate(axes)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(f"Fleet {fleet.name}: paths of the front wheels", loc="left", color=INK)
    _draw_links(axes, fleet, run)
    for (name, track), colour in zip(_in_fleet_order(fleet, run), _colours(fleet), strict=False):
        _draw_path(axes, name, track, colour)
    for name, colour in zip(fleet.robots, _colours(fleet), strict=True):
        if believed and name in believed and name not in run.truth:
            track = believed[name]
            axes.plot(track.x_m, track.y_m, ":", color=colour, lw=1.6, label=f"{name}, estimated")
    estimate = run.pose.get(formation_tree.leader_of(fleet))
    if estimate is not None:
        (line,) = axes.plot(estimate.x_m, estimate.y_m, ":", color=ESTIMATE, lw=1.6, zorder=4)
        line.set_label("leader's estimate")
    if fleet.landmarks:
        axes.plot(
            [mark.x_m for mark in fleet.landmarks],
            [mark.y_m for mark in fleet.landmarks],
            "*",
            ms=13,
            color="#f2c14e",
            mec=INK,
            mew=0.7,
            ls="none",
            label="landmark",
        )
    axes.plot([], [], "o", ms=8, mfc="white", mec=INK, mew=2, label="start")
    axes.plot([], [], ">", ms=9, color=INK, ls="none", label="end")
    _legend(figure, axes)
    return figure


def formation_figure(fleet: Fleet, run: Run) -> Figure:
    """Range, bearing and position error of each follower; the judged window is shaded.

    Limits are drawn where the followers' laws are judged by them.
    """
    bars = fleet.mission.acceptance
    mission = mission_window(fleet, run)
    origin = origin_ns(run, mission)
    figure = Figure(figsize=(9, 7), layout="constrained")
    panels: Sequence[Axes] = figure.subplots(3, 1, sharex=True)
    for axes, label in zip(
        panels, ("range error [m]", "bearing error [rad]", "position error [m]"), strict=True
    ):
        _decorate(axes)
        axes.set_ylabel(label)
        _shade(axes, judged_window(fleet, mission), origin)
    colours = dict(zip(fleet.robots, _colours(fleet), strict=True))
    for name in formation_tree.followers(fleet):
        error = formation_errors(fleet, run, name)
        if error is not None and error.t_ns.size:
            time_s = _seconds(error.t_ns, origin)
            for axes, values in zip(
                panels, (error.range_m, error.bearing_rad, error.position_m), strict=True
            ):
                label = f"{name} ({fleet.robots[name].formation.law} law)"
                axes.plot(time_s, values, color=colours[name], lw=1.2, label=label)
    laws = {fleet.robots[name].formation.law for name in formation_tree.followers(fleet)}
    if "polar" in laws:
        _limit(panels[0], bars.range_rms_m, both_sides=True)
        _limit(panels[1], bars.bearing_rms_rad, both_sides=True)
    if "leader_frame" in laws:
        _limit(panels[2], bars.position_rms_m, both_sides=False)
    panels[2].set_ylim(bottom=0)
    panels[2].set_xlabel("mission time [s]")
    if mission is not None:
        panels[2].set_xlim(-MARGIN_S, mission.seconds + MARGIN_S)
    figure.align_ylabels(panels)
    panels[0].set_title(f"Fleet {fleet.name}: formation error against truth", loc="left", color=INK)
    _legend(figure, panels[2])
    return figure


def _in_fleet_order(fleet: Fleet, run: Run) -> list[tuple[str, Track]]:
    return [(name, run.truth[name]) for name in fleet.robots if name in run.truth]


def _colours(fleet: Fleet) -> list[str]:
    return [COLOURS[index % len(COLOURS)] for index in range(len(fleet.robots))]


def _seconds(t_ns: Times, origin_ns: int) -> Floats:
    return (t_ns - origin_ns).astype(np.float64) * 1e-9


def _decorate(axes: Axes) -> None:
    axes.grid(color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK)


def _draw_path(axes: Axes, name: str, track: Track, colour: str) -> None:
    axes.plot(track.x_m, track.y_m, color=colour, lw=2, label=name)
    axes.plot(track.x_m[0], track.y_m[0], "o", ms=8, mfc="white", mec=colour, mew=2, zorder=5)
    heading_deg = float(np.degrees(track.heading_rad[-1]))
    axes.plot(
        track.x_m[-1],
        track.y_m[-1],
        marker=(3, 0, heading_deg - 90),
        ms=13,
        color=colour,
        mec="white",
        mew=0.8,
        zorder=6,
    )


def _draw_links(axes: Axes, fleet: Fleet, run: Run) -> None:
    """Thin lines from each follower to its leader show the formation's shape on the way."""
    for name in formation_tree.followers(fleet):
        leader = fleet.robots[name].leader
        if name not in run.truth or leader not in run.truth:
            continue
        mine, leaders = run.truth[name], run.truth[leader]
        first, last = int(leaders.t_ns[0]), int(leaders.t_ns[-1])
        for moment in range(first, last + 1, round(LINK_PERIOD_S * 1e9)):
            here = int(np.argmin(np.abs(mine.t_ns - moment)))
            there = int(np.argmin(np.abs(leaders.t_ns - moment)))
            axes.plot(
                [mine.x_m[here], leaders.x_m[there]],
                [mine.y_m[here], leaders.y_m[there]],
                color=FAINT,
                lw=0.9,
                zorder=1,
            )


def _shade(axes: Axes, judged: Window, origin_ns: int) -> None:
    if judged.seconds > 0:
        start, end = ((each - origin_ns) * 1e-9 for each in judged)
        axes.axvspan(start, end, color=SHADE, zorder=0, label="judged window")


def _limit(axes: Axes, limit: float, both_sides: bool) -> None:
    axes.axhline(limit, color=INK, lw=1.0, ls="--", zorder=3, label="limit of the RMS")
    if both_sides:
        axes.axhline(-limit, color=INK, lw=1.0, ls="--", zorder=3)


def _legend(figure: Figure, axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        figure.legend(
            *axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
        )


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
