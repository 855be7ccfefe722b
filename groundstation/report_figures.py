"""Figures of a report, one subject each. Bands are two standard deviations of the estimate."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from groundstation import formation_tree
from groundstation.figures import COLOURS, formation_figure, trajectory_figure
from groundstation.report_data import (
    Band,
    Told,
    believed_tracks,
    follower_bands,
    inside_two_sigma,
    leader_bands,
    seconds,
)
from groundstation.series import Floats
from groundstation.study.drawing import INK, decorate

STATE_COLOURS = {
    "STANDBY": "#c9d3db",
    "ARMING": "#ffe3a3",
    "ARMED": "#f2c14e",
    "RUNNING": "#2a9d8f",
    "STOPPING": "#e9a23b",
    "FAULT": "#d1495b",
    "ESTOP": "#8b1e3f",
}
OTHER_STATE = "#7b5ea7"
EVENT_MARKS = {"warning": ("v", "#e9a23b"), "error": ("X", "#d1495b")}
MOST_POINTS = 1500
WIDTH_IN = 9.5
NIS_MEDIAN = 0.455
"""Median of chi-square with one degree of freedom: a leader's, where its filter is right."""


class Picture(NamedTuple):
    """A figure with its place in the report: an anchor, a heading and what it shows."""

    name: str
    heading: str
    caption: str
    figure: Figure


def pictures(told: Told) -> Iterator[Picture]:
    """All figures of a run for which the recording holds something."""
    for make in (_map, _formation, _leader, _followers, _nis, _timeline, _timing, _bus):
        picture = make(told)
        if picture is not None:
            yield picture


def _map(told: Told) -> Picture:
    figure = trajectory_figure(told.fleet, told.run, believed_tracks(told))
    caption = "Paths of the front wheels; thin lines show the formation every 5 s."
    if not told.has_truth:
        caption = "Paths as the robots believe: nothing in this recording knows the truth."
    return Picture("map", "Map", caption, figure)


def _formation(told: Told) -> Picture | None:
    if not told.has_truth:
        return None
    caption = (
        "How far each follower is from its place, by truth. Dashed: the bars of the mission, for "
        "the RMS over the judged window."
    )
    return Picture("formation", "Formation error", caption, formation_figure(told.fleet, told.run))


def _leader(told: Told) -> Picture | None:
    bands = leader_bands(told)
    if not bands:
        return None
    figure = Figure(figsize=(WIDTH_IN, 7.2), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True).ravel().tolist()
    colour = _colours(told)[formation_tree.leader_of(told.fleet)]
    _position(panels[0], bands, colour)
    for axes, letter, (name, band) in zip(panels[1:], "cde", bands.items(), strict=True):
        _band(axes, f"({letter}) {name.split(' [')[0]}", name, band, colour, told)
    _mission_axis(told, panels[2:])
    caption = (
        "The leader among its landmarks, as in the paper's figure 4: (b) distance from truth, "
        "(c) to (e) errors, with bands of two standard deviations that the filter claims."
    )
    return Picture("leader", "Leader's localisation", _without_truth(told, caption), figure)


def _position(axes: Axes, bands: Mapping[str, Band], colour: str) -> None:
    decorate(axes, "(b) position error", "", "[m]")
    x, y = bands["x [m]"], bands["y [m]"]
    keep = _thin(x.time_s)
    if x.error is not None and y.error is not None:
        error = np.hypot(x.error, y.error)
        axes.plot(x.time_s[keep], error[keep], color=colour, lw=1.1, label="error")
    claimed = np.hypot(x.std, y.std)
    axes.plot(x.time_s[keep], claimed[keep], color=INK, lw=1.0, ls="--", label="deviation claimed")
    axes.set_ylim(0, 1.2 * axes.get_ylim()[1])
    axes.legend(frameon=False, fontsize=8, loc="upper right", ncols=2)


def _followers(told: Told) -> Picture | None:
    found = {name: follower_bands(told, name) for name in formation_tree.followers(told.fleet)}
    found = {name: bands for name, bands in found.items() if bands}
    if not found:
        return None
    rows = len(found)
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 2.3 * rows), layout="constrained")
    grid = figure.subplots(rows, 3, sharex=True, squeeze=False)
    colours = _colours(told)
    for panels, (name, bands) in zip(grid, found.items(), strict=True):
        for axes, (what, band) in zip(panels, bands.items(), strict=True):
            _band(axes, f"{name}: {what.split(' [')[0]}", what, band, colours[name], told)
    _mission_axis(told, list(grid[-1]))
    caption = (
        "What each follower believes of its leader, minus truth; bearing and relative heading are "
        "the paper's figure 5 (b) and (c). Bands: two standard deviations."
    )
    return Picture("followers", "Followers' estimates", _without_truth(told, caption), figure)


def _band(axes: Axes, title: str, label: str, band: Band, colour: str, told: Told) -> None:
    inside = inside_two_sigma(band, told.fleet.mission.acceptance.from_s)
    share = "" if inside is None else f", {inside:.0%} inside"
    decorate(axes, title + share, "", label[label.index("[") :])
    keep = _thin(band.time_s)
    time_s, spread = band.time_s[keep], 2 * band.std[keep]
    axes.fill_between(time_s, -spread, spread, color=colour, alpha=0.16, lw=0)
    if band.error is not None:
        axes.plot(time_s, band.error[keep], color=colour, lw=0.9)
    started = band.time_s >= 0.0
    if band.error is not None and np.any(started):
        reach = np.maximum(np.abs(band.error[started]), 2 * band.std[started])
        limit = 1.15 * float(np.percentile(reach, 99))
        if limit > 0:
            axes.set_ylim(-limit, limit)


def _nis(told: Told) -> Picture | None:
    leader = formation_tree.leader_of(told.fleet)
    colours = _colours(told)
    figure = Figure(figsize=(WIDTH_IN, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    decorate(left, "followers: mean of the last bearings' NIS", "", "NIS")
    decorate(right, f"leader {leader}: median NIS", "", "NIS")
    limits: tuple[float, float] | None = None
    for name in formation_tree.followers(told.fleet):
        rows = [row for row in told.run.relatives.get(name, []) if row.nis_mean is not None]
        if rows:
            time_s = seconds([row.t_ns for row in rows], told.origin_ns)
            values = np.array([row.nis_mean for row in rows], dtype=np.float64)
            keep = _thin(time_s)
            left.plot(time_s[keep], values[keep], color=colours[name], lw=1.0, label=name)
            limits = (rows[-1].nis_low, rows[-1].nis_high)
    if limits is not None:
        left.axhspan(*limits, color="#2a9d8f", alpha=0.12, lw=0, label="consistent")
        left.legend(frameon=False, fontsize=8, ncols=4, loc="upper right")
    poses = [row for row in told.run.poses.get(leader, []) if row.nis_median is not None]
    if poses:
        time_s = seconds([row.t_ns for row in poses], told.origin_ns)
        medians = np.array([row.nis_median for row in poses], dtype=np.float64)
        keep = _thin(time_s)
        right.plot(time_s[keep], medians[keep], color=colours[leader], lw=1.0)
        right.axhline(NIS_MEDIAN, color=INK, lw=1.0, ls="--", label=f"{NIS_MEDIAN} where right")
        right.legend(frameon=False, fontsize=8, loc="upper right")
    if limits is None and not poses:
        return None
    for axes in (left, right):
        axes.set_ylim(bottom=0)
    _mission_axis(told, [left, right])
    caption = (
        "Normalised innovation squared: how well bearings fit what the filters claim. Too high is "
        "overconfident, too low is timid."
    )
    return Picture("nis", "Consistency (NIS)", caption, figure)


def _timeline(told: Told) -> Picture | None:
    names = [name for name in told.fleet.robots if told.run.motion.get(name)]
    if not names:
        return None
    figure = Figure(figsize=(WIDTH_IN, 1.1 + 0.5 * len(names)), layout="constrained")
    axes: Axes = figure.add_subplot()
    decorate(axes, "", "", "")
    axes.grid(axis="y", visible=False)
    shown: dict[str, str] = {}
    for row, name in enumerate(names):
        for state, start_s, end_s in _stretches(told, name):
            colour = STATE_COLOURS.get(state, OTHER_STATE)
            shown[state] = colour
            axes.broken_barh(
                [(start_s, max(end_s - start_s, 0.01))], (row - 0.32, 0.64), color=colour
            )
        for event in told.run.events.get(name, []):
            mark = EVENT_MARKS.get(event.severity)
            if mark is not None:
                time_s = (event.t_ns - told.origin_ns) * 1e-9
                axes.plot(time_s, row, mark[0], color=mark[1], mec="white", ms=9, zorder=5)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    for state, colour in shown.items():
        axes.plot([], [], "s", ms=9, color=colour, label=state)
    for severity, (marker, colour) in EVENT_MARKS.items():
        axes.plot([], [], marker, ms=8, color=colour, label=severity)
    axes.set_xlabel("mission time [s]")
    figure.legend(loc="outside lower center", ncols=9, frameon=False, fontsize=8)
    caption = "States of the robots, and events; the reasons are in the log below."
    return Picture("timeline", "Timeline", caption, figure)


def _stretches(told: Told, name: str) -> Iterator[tuple[str, float, float]]:
    rows = told.run.motion[name]
    begin = rows[0]
    for row in rows:
        if row.state != begin.state:
            yield begin.state, *_span(told, begin.t_ns, row.t_ns)
            begin = row
    yield begin.state, *_span(told, begin.t_ns, rows[-1].t_ns)


def _span(told: Told, first_ns: int, last_ns: int) -> tuple[float, float]:
    return (first_ns - told.origin_ns) * 1e-9, (last_ns - told.origin_ns) * 1e-9


def _timing(told: Told) -> Picture | None:
    if told.info.mode == "lockstep" or not told.steps:
        return None
    figure = Figure(figsize=(WIDTH_IN, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    decorate(left, "time between steps", "[ms]", "steps")
    decorate(right, "wake-up lateness", "[ms]", "steps")
    colours = _colours(told)
    for name, steps in told.steps.items():
        period_ms = 1e3 / told.fleet.robots[name].loop.rate_hz
        _histogram(left, 1e3 * steps.interval_s[1:], 3 * period_ms, name, colours[name])
        _histogram(right, 1e3 * steps.late_s, period_ms, name, colours[name])
    right.legend(frameon=False, fontsize=8)
    caption = (
        "Every recorded step of the control loops; what is beyond the axis is in its last bin. A "
        "loop that misses a period shows a second peak at twice the period."
    )
    return Picture("timing", "Timing of the control loops", caption, figure)


def _histogram(axes: Axes, values_ms: Floats, most_ms: float, name: str, colour: str) -> None:
    bins = np.linspace(0.0, most_ms, 61)
    clipped = np.clip(values_ms, 0.0, most_ms)
    axes.hist(clipped, bins=bins.tolist(), histtype="step", color=colour, lw=1.3, label=name)
    axes.set_yscale("log")


def _bus(told: Told) -> Picture | None:
    shares = {name: steps for name, steps in told.steps.items() if steps.time_s.size}
    if not shares:
        return None
    figure = Figure(figsize=(WIDTH_IN, 2.8), layout="constrained")
    axes: Axes = figure.add_subplot()
    decorate(axes, "", "", "bus load [%]")
    colours = _colours(told)
    for name, steps in shares.items():
        keep = _thin(steps.time_s)
        load = 100 * steps.bus_load[keep]
        axes.plot(steps.time_s[keep], load, color=colours[name], lw=1.1, label=name)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=8, ncols=4)
    _mission_axis(told, [axes])
    caption = "Share of each CAN bus that is in use, over the last second, stuffing at its worst."
    return Picture("bus", "CAN bus load", caption, figure)


def _colours(told: Told) -> dict[str, str]:
    return {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(told.fleet.robots)}


def _mission_axis(told: Told, panels: list[Axes]) -> None:
    for axes in panels:
        axes.set_xlabel("mission time [s]")
        axes.set_xlim(-1.0, max(told.fleet.mission.duration_s, 1.0) + 2.0)


def _without_truth(told: Told, caption: str) -> str:
    return caption if told.has_truth else f"{caption} No truth here: only the bands are drawn."


def _thin(time_s: Floats) -> slice:
    """Every n-th value, so that a figure has no more points than it can show."""
    return slice(None, None, max(1, time_s.size // MOST_POINTS))
