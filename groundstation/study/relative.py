"""`echelon study relative`: the follower's filter on a long straight, judged against truth.

Core alone. With two markers and mutual bearings the range must be good, and claimed honestly; with
one marker it is unobservable, and the robot has to say so and keep away from its leader.
"""

import math
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec
from rich.console import Console
from rich.table import Table

from groundstation.study.runner import Job, run_jobs
from groundstation.study.store import Store
from groundstation.study.straight_leg import (
    SPEED_MPS,
    START_RANGE_FRACTION,
    Leg,
    LegResult,
    drive_leg,
)

SCALE_ERRORS = (0.01, 0.02)
RANGE_RMS_LIMIT_M = 0.012
CLAIM_FACTOR = 1.5
COLLISION_M = 0.15
COVERED_LEAST = 0.95


class Case(NamedTuple):
    """What the follower sees."""

    markers: int
    mutual: bool
    seconds: float

    @property
    def observable(self) -> bool:
        """Whether the markers tell the range."""
        return self.markers > 1


class Row(msgspec.Struct, frozen=True):
    """All runs of one scale error.

    `range_rms_m` and `claimed_std_m` are over the last 10 s of driving; `covered` is the least
    share of a run's time in which three deviations cover the error.
    """

    range_rms_m: float
    claimed_std_m: float
    claimed_over_true: float
    covered: float
    min_range_m: float
    max_range_m: float
    nis_mean: float | None
    reported: int
    stopped: int
    first_report_s: float | None
    problems: list[str]


class Report(msgspec.Struct, frozen=True):
    """What the command prints; `scale_errors` by error, then by signs."""

    study: str
    mode: str
    seeds: int
    markers: int
    mutual: bool
    seconds: float
    speed_mps: float
    start_range_fraction: float
    range_rms_limit_m: float
    collision_m: float
    scale_errors: dict[str, dict[str, Row]]
    ok: bool


def study_relative(case: Case, seeds: int, console: Console, workers: int | None = None) -> Report:
    """Drive `seeds` runs per scale error and choice of signs on `workers` processes."""
    legs = {
        f"{error:g}-{'opposite' if opposite else 'random'}": Leg(
            error, opposite, case.markers, case.mutual, case.seconds
        )
        for error in SCALE_ERRORS
        for opposite in (True, False)
    }
    with tempfile.TemporaryDirectory(prefix="echelon-study-") as folder:
        store = Store(Path(folder), LegResult)
        work = partial(_work, legs)
        found = run_jobs(work, list(legs), range(1, seeds + 1), store, console, workers)
    rows = {cell: judge(case, results) for cell, results in found.items()}
    return Report(
        study="relative",
        mode="core alone",
        seeds=seeds,
        markers=case.markers,
        mutual=case.mutual,
        seconds=case.seconds,
        speed_mps=SPEED_MPS,
        start_range_fraction=START_RANGE_FRACTION,
        range_rms_limit_m=RANGE_RMS_LIMIT_M,
        collision_m=COLLISION_M,
        scale_errors={
            f"{error:g}": {signs: rows[f"{error:g}-{signs}"] for signs in ("opposite", "random")}
            for error in SCALE_ERRORS
        },
        ok=not any(row.problems for row in rows.values()),
    )


def judge(case: Case, results: Sequence[LegResult]) -> Row:
    """Figures of several runs, and which bars they miss."""
    true_m = math.sqrt(_mean([run.tail_squared_m2 for run in results]))
    claimed_m = math.sqrt(_mean([run.tail_variance_m2 for run in results]))
    nis = [run.nis_mean for run in results if run.nis_mean is not None]
    reports = [run.reported_s for run in results if run.reported_s is not None]
    row = Row(
        range_rms_m=true_m,
        claimed_std_m=claimed_m,
        claimed_over_true=claimed_m / true_m,
        covered=min(run.covered for run in results),
        min_range_m=min(run.min_range_m for run in results),
        max_range_m=max(run.max_range_m for run in results),
        nis_mean=_mean(nis) if nis else None,
        reported=len(reports),
        stopped=sum(run.stopped_s is not None for run in results),
        first_report_s=max(reports) if reports else None,
        problems=[],
    )
    return msgspec.structs.replace(row, problems=_problems(case, row, len(results)))


def _problems(case: Case, row: Row, runs: int) -> list[str]:
    problems = []
    if row.min_range_m < COLLISION_M:
        problems.append(f"range down to {row.min_range_m:.3f} m, limit {COLLISION_M} m")
    if not case.observable:
        if row.reported < runs:
            problems.append(f"only {row.reported} of {runs} runs report the range as uncertain")
        if row.covered < COVERED_LEAST:
            problems.append(f"three deviations cover {row.covered:.3f}, limit {COVERED_LEAST}")
        return problems
    if row.range_rms_m > RANGE_RMS_LIMIT_M:
        problems.append(f"range error {row.range_rms_m:.4f} m RMS, limit {RANGE_RMS_LIMIT_M} m")
    if not 1 / CLAIM_FACTOR <= row.claimed_over_true <= CLAIM_FACTOR:
        problems.append(
            f"claims {row.claimed_over_true:.2f} of the true deviation, limit a factor of "
            f"{CLAIM_FACTOR} either way"
        )
    if row.stopped:
        problems.append(f"{row.stopped} runs stopped although the range is observable")
    return problems


def print_relative(console: Console, report: Report) -> None:
    """The table for people."""
    seen = f"{report.markers} marker(s), {'with' if report.mutual else 'no'} mutual bearings"
    table = Table(
        title=f"relative filter, {report.seconds:.0f} s straight at {report.speed_mps:.0f} m/s, "
        f"{seen}; {report.seeds} seeds, {report.mode}"
    )
    for column in (
        "scale error",
        "RMS m",
        "claimed",
        "covered",
        "least m",
        "NIS",
        "told",
        "stopped",
    ):
        table.add_column(column, no_wrap=True)
    problems = []
    for error, by_signs in report.scale_errors.items():
        for signs, row in by_signs.items():
            name = f"{float(error):.0%} {signs}"
            table.add_row(
                name,
                f"{row.range_rms_m:.4f}",
                f"x {row.claimed_over_true:.2f}",
                f"{row.covered:.3f}",
                f"{row.min_range_m:.3f}",
                "-" if row.nis_mean is None else f"{row.nis_mean:.3f}",
                str(row.reported),
                str(row.stopped),
            )
            problems += [f"{name}: {problem}" for problem in row.problems]
    console.print(table)
    for problem in problems:
        console.print(problem, style="red")


def _work(legs: dict[str, Leg], job: Job) -> LegResult:
    return drive_leg(legs[job.cell], job.seed)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
