"""Figure 4 (a)-(f): the leader's localisation with 0 to 4 landmarks, on the core alone."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from groundstation.study.bound_cells import BoundResult
from groundstation.study.drawing import COUNT_COLOURS, INK, decorate, save
from groundstation.study.leader_cells import (
    COUNTS,
    KEEP_EVERY,
    NOISE_PER_SQRT_S,
    START_STD,
    LeaderResult,
    kept_times_s,
)
from groundstation.study.scenario import landmark_positions, leader_truth, paper_fleet

Results = Mapping[int, Sequence[LeaderResult]]
Bounds = Mapping[int, Sequence[BoundResult]]
ERRORS = (("(c)", "x", "m"), ("(d)", "y", "m"), ("(e)", "heading", "rad"))


def draw_figure4(
    title: str, results: Results, bounds: Bounds, seeds: Sequence[int], folder: Path, name: str
) -> list[Path]:
    """Six panels for one filter, as PNG and PDF.

    `results` and `bounds` hold every seed, per number of landmarks.
    """
    figure = Figure(figsize=(9.5, 10.5), layout="constrained")
    panels = figure.subplots(3, 2).ravel().tolist()
    _paths(panels[0], results, seeds[0])
    _rmse(panels[1], results, bounds, len(seeds))
    for axes, (letter, what, unit) in zip(panels[2:5], ERRORS, strict=True):
        _errors(axes, results, letter, what, unit, seeds)
    _bearings(panels[5], results, len(seeds))
    figure.suptitle(title, color=INK, fontsize=11, x=0.01, ha="left")
    _legend(figure, panels)
    return save(figure, folder, name)


def _paths(axes: Axes, results: Results, seed: int) -> None:
    decorate(axes, f"(a) true and estimated path, seed {seed}", "x [m]", "y [m]")
    source = paper_fleet()
    true = leader_truth(source, seed, NOISE_PER_SQRT_S, START_STD).states
    kept = true[KEEP_EVERY::KEEP_EVERY]
    for count in COUNTS:
        run = results[count][0]
        x, y = kept[:, 0] + run.x_m, kept[:, 1] + run.y_m
        axes.plot(x, y, color=COUNT_COLOURS[count], lw=1.1, label=_label(count))
    axes.plot(true[:, 0], true[:, 1], color="black", lw=2.2, ls=":", label="truth", zorder=4)
    marks = np.array(list(landmark_positions(source, len(source.landmarks)).values()))
    axes.plot(*marks.T, "*", ms=11, color="#f2c14e", mec=INK, mew=0.7, ls="none", label="landmark")
    for number, (x, y) in enumerate(marks.tolist(), start=1):
        axes.annotate(str(number), (x, y), xytext=(6, 4), textcoords="offset points", fontsize=8)
    axes.set_aspect("equal", adjustable="datalim")


def _rmse(axes: Axes, results: Results, bounds: Bounds, seeds: int) -> None:
    decorate(axes, f"(b) position RMSE over {seeds} seeds", "time [s]", "RMSE [m]")
    times = kept_times_s()
    for count in COUNTS:
        squares = [np.square(r.x_m) + np.square(r.y_m) for r in results[count]]
        axes.semilogy(times, np.sqrt(np.mean(squares, axis=0)), color=COUNT_COLOURS[count], lw=1.5)
        bound = np.sqrt(np.mean([each.variance_m2 for each in bounds[count]], axis=0))
        axes.semilogy(times, bound, color=COUNT_COLOURS[count], lw=1.2, ls="--")
    axes.plot(
        [], [], color=INK, lw=1.2, ls="--", label="bound (Riccati, linearised along the paths)"
    )


def _errors(
    axes: Axes, results: Results, letter: str, what: str, unit: str, seeds: Sequence[int]
) -> None:
    title = f"{letter} error in {what}: seed {seeds[0]}, and RMS of {len(seeds)}"
    decorate(axes, title, "time [s]", f"{what} [{unit}]")
    times = kept_times_s()
    for count in COUNTS:
        runs = np.array([getattr(r, f"{what}_{unit}") for r in results[count]])
        spread = np.sqrt(np.mean(np.square(runs), axis=0))
        axes.fill_between(times, -spread, spread, color=COUNT_COLOURS[count], alpha=0.18, lw=0)
        axes.plot(times, runs[0], color=COUNT_COLOURS[count], lw=1.1)
    axes.plot([], [], color=INK, alpha=0.3, lw=6, label="RMS over seeds")


def _bearings(axes: Axes, results: Results, seeds: int) -> None:
    title = f"(f) observation angle, RMS error over {seeds} seeds"
    decorate(axes, title, "time [s]", "bearing [rad]")
    for count in COUNTS[1:]:
        runs = np.array([r.bearing_rad for r in results[count]])
        values = np.sqrt(np.mean(np.square(runs), axis=0))
        axes.plot(kept_times_s(), values, color=COUNT_COLOURS[count], lw=1.3)
    axes.set_ylim(bottom=0)


def _label(count: int) -> str:
    return f"{count}-LM"


def _legend(figure: Figure, panels: Sequence[Axes]) -> None:
    entries = {
        text: line
        for axes in panels
        for line, text in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(), entries.keys(), loc="outside lower center", ncols=5, frameon=False
    )
