"""The map of a planned mission: paths, landmarks, and where too little is seen or driven."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from config.fleet import Fleet
from groundstation.figures import COLOURS, DPI, INK
from groundstation.study.mission_check import MissionCheck
from groundstation.study.mission_findings import MissionFinding
from groundstation.study.planned_paths import PlannedPath

WARNING, ERROR = "#f0a202", "#d7263d"
LISTED = 6
LONGEST = 110
LEAST_POINTS = 2


def draw_mission(fleet: Fleet, check: MissionCheck, path: Path) -> None:
    """Write the map; stretches with findings are coloured, the worst findings listed below."""
    figure = Figure(figsize=(8.5, 8.5), layout="constrained")
    axes: Axes = figure.add_subplot()
    axes.grid(color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)
    axes.set_aspect("equal", adjustable="datalim")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(f"Fleet {fleet.name}: planned mission (core alone)", loc="left", color=INK)
    for number, (name, way) in enumerate(check.paths.items()):
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(way.x_m, way.y_m, color=colour, lw=1.2, label=name, zorder=3)
        axes.plot(way.x_m[0], way.y_m[0], "o", ms=6, mfc="white", mec=colour, mew=1.5, zorder=5)
    for finding in reversed(check.report.findings):
        _mark(axes, check.paths[finding.robot], finding)
    for mark in fleet.landmarks:
        axes.plot(mark.x_m, mark.y_m, "*", ms=13, color="#f2c14e", mec=INK, mew=0.7)
        axes.annotate(
            str(mark.id), (mark.x_m, mark.y_m), (6, 6), textcoords="offset points", color=INK
        )
    axes.plot([], [], color=WARNING, lw=5, alpha=0.6, label="warning")
    axes.plot([], [], color=ERROR, lw=5, alpha=0.6, label="error")
    axes.legend(loc="upper right", frameon=False)
    figure.supxlabel(_listed(check), x=0.02, ha="left", fontsize=8, color=INK)
    figure.savefig(path, dpi=DPI)


def _mark(axes: Axes, way: PlannedPath, finding: MissionFinding) -> None:
    first, last = np.searchsorted(way.time_s, [finding.from_s - 1e-6, finding.to_s + 1e-6])
    stretch = slice(int(first), max(int(last), int(first) + LEAST_POINTS))
    axes.plot(
        way.x_m[stretch],
        way.y_m[stretch],
        color=ERROR if finding.severity == "error" else WARNING,
        lw=7,
        alpha=0.5,
        solid_capstyle="round",
        zorder=2,
    )


def _listed(check: MissionCheck) -> str:
    """Worst figures of every robot, then the first findings, one per line."""
    lines = [f"{name}: {robot.weakest}" for name, robot in check.report.robots.items()]
    texts = [str(finding).split("; ")[0] for finding in check.report.findings]
    lines += [text if len(text) <= LONGEST else f"{text[:LONGEST]}..." for text in texts[:LISTED]]
    if len(texts) > LISTED:
        lines.append(f"and {len(texts) - LISTED} more")
    return "\n".join(lines)
