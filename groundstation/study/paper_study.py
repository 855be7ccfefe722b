"""`echelon study paper`: runs what is missing, then writes figures and tables into one folder."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from rich.console import Console

from config.loader import dump_effective
from groundstation.errors import GroundError
from groundstation.lockstep import LockstepFailed
from groundstation.study.bound_cells import BOUND_CELLS, BoundResult, run_bound
from groundstation.study.figure4 import draw_figure4
from groundstation.study.figure5 import LockstepRun, draw_figure5, run_in_lockstep
from groundstation.study.formation_cells import (
    FORMATION_CELLS,
    FormationCell,
    FormationResult,
    run_formation,
)
from groundstation.study.leader_cells import (
    COUNTS,
    FILTERS,
    LeaderCell,
    LeaderResult,
    run_leader,
)
from groundstation.study.runner import run_jobs
from groundstation.study.scenario import paper_fleet
from groundstation.study.store import Manifest, Store, code_fingerprint, open_folder
from groundstation.study.table import (
    Figure4,
    Figure5,
    LeaderRow,
    LockstepRow,
    PaperTable,
    follower_rows,
    leader_row,
    to_json,
    to_markdown,
)

LOCKSTEP_SEED = 1
NUMBERS_FROM = (
    "onboard/model/*.py",
    "onboard/estimate/*.py",
    "onboard/control/*.py",
    "groundstation/study/*_cells.py",
    "groundstation/study/bound.py",
    "groundstation/study/formation.py",
    "groundstation/study/scenario.py",
)


@dataclass(frozen=True, slots=True)
class Options:
    """How to run the study: `only` "figure4" or "figure5", or both. `console` hears of progress."""

    seeds: int
    out: Path
    only: str | None
    resume: bool
    console: Console
    workers: int | None = None


def run_paper(options: Options) -> PaperTable:
    """Run the study; table and figures are in the folder when this returns.

    Raises GroundError when the folder cannot be used or the lockstep run fails.
    """
    settings = hashlib.sha256(dump_effective(paper_fleet()).encode()).hexdigest()[:16]
    open_folder(
        options.out, Manifest("paper", settings, code_fingerprint(NUMBERS_FROM)), options.resume
    )
    table = PaperTable(options.seeds)
    if options.only != "figure5":
        table = _with_figure4(options, table)
    if options.only != "figure4":
        table = _with_figure5(options, table)
    (options.out / "table.json").write_bytes(to_json(table))
    (options.out / "table.md").write_text(to_markdown(table), encoding="utf-8")
    return table


def _with_figure4(options: Options, table: PaperTable) -> PaperTable:
    options.console.print("figure 4, leader, core alone", highlight=False)
    seeds = range(1, options.seeds + 1)
    cells = [LeaderCell(kind, count) for kind in FILTERS for count in COUNTS]
    store = Store(options.out, LeaderResult)
    found = run_jobs(
        run_leader, [cell.name for cell in cells], seeds, store, options.console, options.workers
    )
    names = list(BOUND_CELLS.values())
    limits = Store(options.out, BoundResult)
    bounds = run_jobs(run_bound, names, seeds, limits, options.console, options.workers)
    rows: dict[str, dict[str, LeaderRow]] = {}
    files: list[Path] = []
    for kind, description in FILTERS.items():
        results = {count: found[LeaderCell(kind, count).name] for count in COUNTS}
        rows[kind] = {
            str(count): leader_row(results[count], bounds[BOUND_CELLS[count]]) for count in COUNTS
        }
        curves = {count: bounds[BOUND_CELLS[count]] for count in COUNTS}
        title = f"Figure 4, leader: {description} (core alone)"
        name = f"figure4-{kind}"
        files += draw_figure4(title, results, curves, seeds, options.out, name)
    figure = Figure4("core alone", rows)
    return msgspec.structs.replace(table, figure4=figure, files=[*table.files, *_names(files)])


def _with_figure5(options: Options, table: PaperTable) -> PaperTable:
    options.console.print("figure 5, formation, core alone", highlight=False)
    store = Store(options.out, FormationResult)
    found = run_jobs(
        run_formation,
        [cell.name for cell in FORMATION_CELLS],
        range(1, options.seeds + 1),
        store,
        options.console,
        options.workers,
    )
    options.console.print(f"figure 5, in lockstep, seed {LOCKSTEP_SEED}", highlight=False)
    try:
        shown = run_in_lockstep(paper_fleet(), LOCKSTEP_SEED)
    except LockstepFailed as failure:
        raise GroundError(f"the lockstep run of figure 5 failed: {failure}") from failure
    ours = found[FormationCell("ours", "scaled").name]
    files = draw_figure5(shown, ours, LOCKSTEP_SEED, options.out, "figure5")
    rows = {cell.described: follower_rows(found[cell.name]) for cell in FORMATION_CELLS}
    figure = Figure5(rows, LOCKSTEP_SEED, _lockstep_rows(shown))
    return msgspec.structs.replace(table, figure5=figure, files=[*table.files, *_names(files)])


def _lockstep_rows(shown: LockstepRun) -> dict[str, LockstepRow]:
    formation, maxima = shown.formation(LOCKSTEP_SEED), shown.heading_maxima()
    return {
        name: LockstepRow(
            formation[name].position_rms_m,
            formation[name].range_rms_m,
            formation[name].bearing_rms_rad,
            maxima[name].after_switching_rad,
            maxima[name].overall_rad,
        )
        for name in maxima
    }


def _names(files: Sequence[Path]) -> list[str]:
    return [str(path) for path in files]
