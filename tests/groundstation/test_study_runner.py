"""A Monte-Carlo study: resumable, and the same whatever the workers."""

import io
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rich.console import Console

from groundstation.errors import GroundError
from groundstation.study.runner import Job, run_jobs
from groundstation.study.store import Manifest, Store, open_folder

CELLS, SEEDS = ["even", "odd"], range(1, 4)
MANIFEST = Manifest("test", "settings", "code")


class Drawn(msgspec.Struct, frozen=True):
    """A result that depends on its job alone."""

    value: float


def draw(job: Job) -> Drawn:
    """A module's function, so that spawned processes can import it."""
    return Drawn(float(np.random.default_rng([job.seed, len(job.cell)]).standard_normal()))


def run(
    folder: Path, work: Callable[[Job], Drawn] = draw, workers: int = 1
) -> dict[str, list[Drawn]]:
    console = Console(file=io.StringIO())
    return run_jobs(work, CELLS, SEEDS, Store(folder, Drawn), console, workers)


def test_two_workers_give_what_one_gives(tmp_path: Path) -> None:
    alone, together = run(tmp_path / "1"), run(tmp_path / "2", workers=2)
    assert alone == together
    assert alone["even"] == [draw(Job("even", seed)) for seed in SEEDS]


def test_an_interrupted_study_goes_on_where_it_was(tmp_path: Path) -> None:
    calls: list[Job] = []

    def interrupted(job: Job) -> Drawn:
        if len(calls) == 2:
            raise KeyboardInterrupt
        calls.append(job)
        return draw(job)

    def counted(job: Job) -> Drawn:
        calls.append(job)
        return draw(job)

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "a", interrupted)
    assert run(tmp_path / "a", counted) == run(tmp_path / "b")
    assert len(calls) == len(set(calls)) == len(CELLS) * len(SEEDS)


def test_a_line_half_written_is_computed_again(tmp_path: Path) -> None:
    whole = run(tmp_path)
    path = tmp_path / "cells" / "odd.jsonl"
    lines = path.read_bytes()
    path.write_bytes(lines[:-7])
    assert run(tmp_path) == whole
    assert path.read_bytes() == lines


def test_a_spoiled_line_is_named(tmp_path: Path) -> None:
    run(tmp_path)
    path = tmp_path / "cells" / "odd.jsonl"
    path.write_bytes(b'1 {"value": "much"}\n' + path.read_bytes())
    with pytest.raises(GroundError, match=r"odd\.jsonl:1: not a result of this study"):
        run(tmp_path)


def test_more_seeds_use_the_ones_that_are_there(tmp_path: Path) -> None:
    few = run(tmp_path)
    asked: list[Job] = []

    def noted(job: Job) -> Drawn:
        asked.append(job)
        return draw(job)

    console = Console(file=io.StringIO())
    more = run_jobs(noted, CELLS, range(1, 5), Store(tmp_path, Drawn), console, workers=1)
    assert [job.seed for job in asked] == [4, 4]
    assert {cell: results[:3] for cell, results in more.items()} == few


def test_a_used_folder_wants_resume(tmp_path: Path) -> None:
    open_folder(tmp_path / "study", MANIFEST, resume=False)
    with pytest.raises(GroundError, match=r"not empty.*--resume"):
        open_folder(tmp_path / "study", MANIFEST, resume=False)
    open_folder(tmp_path / "study", MANIFEST, resume=True)


def test_results_of_other_code_are_not_mixed_in(tmp_path: Path) -> None:
    open_folder(tmp_path / "study", MANIFEST, resume=False)
    with pytest.raises(GroundError, match="another code"):
        open_folder(tmp_path / "study", Manifest("test", "settings", "new"), resume=True)


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("keep")
    with pytest.raises(GroundError, match="holds no study"):
        open_folder(tmp_path, MANIFEST, resume=True)
