"""A recorded robot's track: where it was, where it believed to be, and how sure it was."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from groundstation.dataset_score import Errors, Floats, PoseTrack, TruthTrack
from groundstation.figures import COLOURS, DPI, FAINT, INK
from groundstation.lockstep import Recording


def draw_track(
    recording: Recording, track: PoseTrack, truth: TruthTrack, errors: Errors, path: Path
) -> None:
    """Map with both paths and the landmarks; position and heading error with two deviations."""
    figure = Figure(figsize=(12, 6), layout="constrained")
    grid = figure.add_gridspec(2, 2)
    _draw_map(figure.add_subplot(grid[:, 0]), recording, track, truth)
    position = figure.add_subplot(grid[0, 1])
    heading = figure.add_subplot(grid[1, 1], sharex=position)
    _draw_error(position, errors.t_s, errors.position_m, errors.position_std_m)
    position.set_ylabel("position error [m]")
    _draw_error(heading, errors.t_s, errors.heading_rad, errors.heading_std_rad, both_sides=True)
    heading.set_ylabel("heading error [rad]")
    heading.set_xlabel("time since the recording's start [s]")
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_map(axes: Axes, recording: Recording, track: PoseTrack, truth: TruthTrack) -> None:
    rows = truth.usable
    axes.plot(truth.x_m[rows], truth.y_m[rows], color=COLOURS[0], lw=1.6, label="motion capture")
    axes.plot(track.x_m, track.y_m, color=COLOURS[1], lw=1.0, label="estimate")
    axes.plot(
        [mark.x_m for mark in recording.landmarks],
        [mark.y_m for mark in recording.landmarks],
        "*",
        ms=11,
        color="#f2c14e",
        mec=INK,
        mew=0.7,
        ls="none",
        label="landmark",
    )
    for mark in recording.landmarks:
        axes.annotate(
            str(mark.subject),
            (mark.x_m, mark.y_m),
            xytext=(5, 4),
            textcoords="offset points",
            fontsize=8,
            color=INK,
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(f"Robot {recording.robot}, bearings only", loc="left", color=INK)
    axes.legend(frameon=False, fontsize=8)
    _decorate(axes)


def _draw_error(
    axes: Axes, t_s: Floats, error: Floats, std: Floats, both_sides: bool = False
) -> None:
    lower = -2 * std if both_sides else np.zeros_like(std)
    axes.fill_between(t_s, lower, 2 * std, color=FAINT, alpha=0.35, lw=0, label="2 sigma claimed")
    axes.plot(t_s, error, color=COLOURS[1], lw=0.9, label="error")
    axes.legend(frameon=False, fontsize=8, loc="upper right")
    _decorate(axes)


def _decorate(axes: Axes) -> None:
    axes.grid(color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK)
