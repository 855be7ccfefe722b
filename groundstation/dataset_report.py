"""What `echelon dataset` reports, its bars, and the same as a table for people."""

from collections.abc import Callable
from typing import Literal

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from groundstation.dataset_follow import FollowScore
from groundstation.dataset_score import RobotScore

MAX_POSITION_RMS_M = 0.30
MAX_MEAN_POSITION_RMS_M = 0.20
NEES_MEDIAN = (1.0, 6.0)
MIN_TRUSTED_SHARE = 0.95


class DataSetReport(msgspec.Struct, frozen=True, kw_only=True):
    """Robots by their numbers; `why` names value and limit of every bar that was not met."""

    verdict: Literal["pass", "fail"]
    why: list[str]
    data_set: str
    mode: Literal["lockstep", "processes"]
    start: Literal["known", "unknown"]
    mean_position_rms_m: float
    robots: dict[str, RobotScore]
    follow: FollowScore | None = None
    results: str


def misses(robots: dict[str, RobotScore]) -> list[str]:
    """Every bar that the robots miss, with value and limit."""
    why: list[str] = []
    for name, score in robots.items():
        if score.position_rms_m > MAX_POSITION_RMS_M:
            why.append(
                f"robot {name}: position error {score.position_rms_m:.3f} m RMS, limit "
                f"{MAX_POSITION_RMS_M:.2f} m"
            )
        if not NEES_MEDIAN[0] <= score.nees_median <= NEES_MEDIAN[1]:
            why.append(
                f"robot {name}: median NEES {score.nees_median:.2f}, limits {NEES_MEDIAN[0]:g} to "
                f"{NEES_MEDIAN[1]:g}"
            )
        if score.trusted_share < MIN_TRUSTED_SHARE:
            why.append(
                f"robot {name}: trusts a pose in {score.trusted_share:.0%} of the time, limit "
                f"{MIN_TRUSTED_SHARE:.0%}"
            )
    if (mean_m := mean_position_rms_m(robots)) > MAX_MEAN_POSITION_RMS_M:
        why.append(
            f"position error {mean_m:.3f} m RMS in the mean over {len(robots)} robots, limit "
            f"{MAX_MEAN_POSITION_RMS_M:.2f} m"
        )
    return why


def mean_position_rms_m(robots: dict[str, RobotScore]) -> float:
    """Mean over the robots of their RMS position errors."""
    return sum(score.position_rms_m for score in robots.values()) / len(robots)


def to_json(report: DataSetReport) -> str:
    """Indented JSON with a newline at the end."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2).decode() + "\n"


def print_report(console: Console, report: DataSetReport) -> None:
    """Verdict, one column per robot, and what was missed."""
    table = Table(
        title=f"{report.data_set}, {report.start} start, {report.mode}", title_justify="left"
    )
    table.add_column("robot")
    for name in report.robots:
        table.add_column(name, justify="right")
    for what, shown in _ROWS:
        table.add_row(escape(what), *(shown(score) for score in report.robots.values()))
    console.print(table)
    if report.follow is not None:
        console.print(report.follow.in_words(), highlight=False, markup=False, soft_wrap=True)
    for reason in report.why:
        console.print(f"- {reason}", highlight=False, markup=False, soft_wrap=True)
    colour = "green" if report.verdict == "pass" else "red"
    console.print(f"mean position RMS {report.mean_position_rms_m:.3f} m")
    console.print(f"verdict: [bold {colour}]{report.verdict}[/]")


_ROWS: tuple[tuple[str, Callable[[RobotScore], str]], ...] = (
    ("position RMS [m]", lambda score: f"{score.position_rms_m:.3f}"),
    ("position median [m]", lambda score: f"{score.position_median_m:.3f}"),
    ("position max [m]", lambda score: f"{score.position_max_m:.3f}"),
    ("heading RMS [rad]", lambda score: f"{score.heading_rms_rad:.4f}"),
    ("NEES median (2.4)", lambda score: f"{score.nees_median:.2f}"),
    ("in 95 % ellipse", lambda score: f"{score.coverage:.0%}"),
    ("landmark bearings", lambda score: str(score.bearings_used)),
    ("judged [s]", lambda score: f"{score.judged_from_s:.0f}-{score.seconds:.0f}"),
    ("trusted from [s]", lambda score: _seconds(score.trusted_from_s)),
    ("bearings rejected", lambda score: str(score.bearings_rejected)),
    ("trusted share", lambda score: f"{score.trusted_share:.0%}"),
    ("times real time", lambda score: f"{score.times_real_time:.0f}"),
)


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.1f}"
