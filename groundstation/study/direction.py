"""`echelon study direction`: the paper's only number, a direction-angle error of 0.0217 rad.

Core alone; see `direction_run` for what is driven.
"""

import tempfile
from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table

from groundstation.study.direction_run import (
    ODOMETRY_NOISE,
    OUTPUT_STD_RAD,
    SETTLED_S,
    DirectionResult,
    Variant,
    drive_direction,
)
from groundstation.study.runner import Job, run_jobs
from groundstation.study.store import Store

PAPER_MAX_RAD = 0.0217
MEANING = {
    Variant.PAPER: "paper's filter: P_L, P_N = 0.03 I, s(0) known, exact odometry",
    Variant.PAPER_LITERAL_P: "the same from P = 1.13 I",
    Variant.PAPER_FORK_RATE: "paper's filter, d eta/dt taken for the yaw rate (erratum)",
    Variant.DEFAULT: f"default filter, {ODOMETRY_NOISE:.0%} odometry noise",
    Variant.DEFAULT_EXACT_ODOMETRY: "default filter, exact odometry",
    Variant.DEFAULT_EXACT_BEARINGS: f"default filter, {ODOMETRY_NOISE:.0%}, exact bearings",
}


class VariantRow(msgspec.Struct, frozen=True):
    """Largest |alpha error| [rad] of any seed: whole run, and from `settled_from_s` on; and RMS."""

    meaning: str
    max_error_rad: float
    max_settled_rad: float
    rms_settled_rad: float
    claimed_std_rad: float
    seeds_above: int


class DirectionReport(msgspec.Struct, frozen=True):
    """What the command prints. `ok`: variant `paper` meets the bar in every seed, all run long."""

    study: str
    mode: str
    seeds: int
    limit_rad: float
    bearing_std_rad: float
    settled_from_s: float
    variants: dict[str, VariantRow]
    default_is_limited_by: str
    ok: bool


def study_direction(seeds: int, console: Console, workers: int | None = None) -> DirectionReport:
    """Drive `seeds` missions per variant on `workers` processes."""
    with tempfile.TemporaryDirectory(prefix="echelon-study-") as folder:
        store = Store(Path(folder), DirectionResult)
        found = run_jobs(_work, list(Variant), range(1, seeds + 1), store, console, workers)
    rows = {variant: _row(variant, found[variant]) for variant in Variant}
    return DirectionReport(
        study="direction",
        mode="core alone",
        seeds=seeds,
        limit_rad=PAPER_MAX_RAD,
        bearing_std_rad=OUTPUT_STD_RAD,
        settled_from_s=SETTLED_S,
        variants={variant.value: row for variant, row in rows.items()},
        default_is_limited_by=_limit(rows),
        ok=rows[Variant.PAPER].seeds_above == 0,
    )


def print_direction(console: Console, report: DirectionReport) -> None:
    """The table for people."""
    table = Table(
        title=f"|alpha error|, paper scenario, bar {report.limit_rad} rad; "
        f"{report.seeds} seeds, {report.mode}"
    )
    for column in ("filter", "max rad", "settled max", "settled RMS", "claimed", "seeds above"):
        table.add_column(column)
    for row in report.variants.values():
        figures = (
            row.max_error_rad,
            row.max_settled_rad,
            row.rms_settled_rad,
            row.claimed_std_rad,
        )
        table.add_row(row.meaning, *(f"{value:.4f}" for value in figures), str(row.seeds_above))
    console.print(table)
    console.print(report.default_is_limited_by)


def _row(variant: Variant, runs: list[DirectionResult]) -> VariantRow:
    squares = [run.settled_rms_rad**2 for run in runs]
    claims = [run.claimed_std_rad**2 for run in runs]
    return VariantRow(
        meaning=MEANING[variant],
        max_error_rad=max(run.from_start_rad for run in runs),
        max_settled_rad=max(run.settled_rad for run in runs),
        rms_settled_rad=(sum(squares) / len(runs)) ** 0.5,
        claimed_std_rad=(sum(claims) / len(runs)) ** 0.5,
        seeds_above=sum(run.from_start_rad > PAPER_MAX_RAD for run in runs),
    )


def _limit(rows: dict[Variant, VariantRow]) -> str:
    """What the default's error shrinks with: its odometry or its bearings."""
    whole = rows[Variant.DEFAULT].rms_settled_rad
    odometry = rows[Variant.DEFAULT_EXACT_ODOMETRY].rms_settled_rad
    bearings = rows[Variant.DEFAULT_EXACT_BEARINGS].rms_settled_rad
    what = "the bearings' noise" if bearings < odometry else "the odometry's noise"
    return (
        f"the default filter is limited by {what} (it trusts its model less than the paper's, so "
        f"that real robots may differ from it): RMS {whole:.4f} rad, with exact odometry "
        f"{odometry:.4f}, with exact bearings {bearings:.4f}"
    )


def _work(job: Job) -> DirectionResult:
    return drive_direction(Variant(job.cell), job.seed)
