"""`echelon study localiser`: a localiser on the paper's scenario against the bound, core alone.

Plant and filter have the same noise; section 10 of the mathematics has the same figures from a
prototype. The bound is the Riccati recursion along the same true paths.
"""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Literal

import msgspec
from rich.console import Console
from rich.table import Table

from groundstation.errors import GroundError
from groundstation.study.bound_cells import BOUND_CELLS, BoundResult, run_bound
from groundstation.study.leader_cells import (
    JUDGED_FROM_S,
    KINDS,
    LeaderCell,
    LeaderResult,
    run_leader,
)
from groundstation.study.runner import run_jobs
from groundstation.study.store import Store

Kind = Literal["gaussian", "particle"]

MAX_RATIO = 1.10
NEES_RANGE = (3.6, 4.4)
JUDGED_COUNTS = (2, 3, 4)
"""Numbers of landmarks that the bars are for."""

FILTERS = {kind: name for name, kind in KINDS.items()}


class Row(msgspec.Struct, frozen=True):
    """Pooled over all runs from 0.5 s on; `nees` has 4 states, so 4 where the filter is honest."""

    rmse_m: float
    bound_m: float
    ratio: float
    nees: float
    problems: list[str]


class Report(msgspec.Struct, frozen=True):
    """What the command prints; `landmarks` by their number."""

    study: str
    mode: str
    kind: str
    seeds: int
    judged_from_s: float
    ratio_limit: float
    nees_limits: tuple[float, float]
    landmarks: dict[str, Row]
    ok: bool


def kind_of(text: str) -> Kind:
    """Raises GroundError for anything but "gaussian" and "particle"."""
    match text:
        case "gaussian" | "particle":
            return text
    raise GroundError(f"--kind {text!r}: choose gaussian or particle")


def study_localiser(
    kind: Kind,
    counts: Sequence[int],
    seeds: int,
    console: Console,
    workers: int | None = None,
) -> Report:
    """Run `seeds` missions per number of landmarks; the bars judge the gaussian kind alone."""
    cells = {count: LeaderCell(FILTERS[kind], count).name for count in counts}
    bounds = {count: BOUND_CELLS[count] for count in counts}
    wanted = range(1, seeds + 1)
    with tempfile.TemporaryDirectory(prefix="echelon-study-") as folder:
        runs = Store(Path(folder) / "runs", LeaderResult)
        bound = Store(Path(folder) / "bounds", BoundResult)
        found = run_jobs(run_leader, list(cells.values()), wanted, runs, console, workers)
        least = run_jobs(run_bound, list(bounds.values()), wanted, bound, console, workers)
    rows = {
        str(count): judge(count, kind, found[cells[count]], least[bounds[count]])
        for count in counts
    }
    return Report(
        study="localiser",
        mode="core alone",
        kind=kind,
        seeds=seeds,
        judged_from_s=JUDGED_FROM_S,
        ratio_limit=MAX_RATIO,
        nees_limits=NEES_RANGE,
        landmarks=rows,
        ok=not any(row.problems for row in rows.values()),
    )


def judge(
    count: int, kind: Kind, runs: Sequence[LeaderResult], bounds: Sequence[BoundResult]
) -> Row:
    """Figures of all runs with `count` landmarks, and which bars they miss."""
    rmse_m = math.sqrt(fmean(run.position_mse_m2 for run in runs))
    bound_m = math.sqrt(fmean(bound.position_mse_m2 for bound in bounds))
    row = Row(rmse_m, bound_m, rmse_m / bound_m, fmean(run.nees for run in runs), [])
    if kind == "gaussian" and count in JUDGED_COUNTS:
        row.problems.extend(_missed(row))
    return row


def _missed(row: Row) -> list[str]:
    low, high = NEES_RANGE
    missed = []
    if not row.ratio <= MAX_RATIO:
        missed.append(f"RMSE is {row.ratio:.3f} of the bound, limit {MAX_RATIO}")
    if not low <= row.nees <= high:
        missed.append(f"NEES is {row.nees:.2f}, limits {low} and {high}")
    return missed


def print_localiser(console: Console, report: Report) -> None:
    """The report as a table."""
    table = Table(
        title=f"{report.kind} localiser, paper scenario, {report.seeds} seeds ({report.mode})"
    )
    for column in ("landmarks", "RMSE m", "bound m", "ratio", "NEES (4)", ""):
        table.add_column(column, justify="left" if not column else "right")
    for count, row in report.landmarks.items():
        table.add_row(
            count,
            f"{row.rmse_m:.4f}",
            f"{row.bound_m:.4f}",
            f"{row.ratio:.3f}",
            f"{row.nees:.2f}",
            "; ".join(row.problems),
        )
    console.print(table)
