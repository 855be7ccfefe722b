"""Runs the cells of a Monte-Carlo study on all cores, keeping every result as it comes.

A result depends on its cell and seed alone, so neither the number of workers nor their order shows.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import closing
from typing import NamedTuple, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from groundstation.study.store import Store

R = TypeVar("R")
PLAIN_LINES = 10


class Job(NamedTuple):
    """One seed of one cell."""

    cell: str
    seed: int


def run_jobs(
    work: Callable[[Job], R],
    cells: Sequence[str],
    seeds: Sequence[int],
    store: Store[R],
    console: Console,
    workers: int | None = None,
) -> dict[str, list[R]]:
    """All results per cell in order of seeds; those that the store has are not computed again.

    `work` is a module's function: processes are spawned and import it. With one worker it runs
    in this process. KeyboardInterrupt leaves the finished results in the store.
    """
    done = {cell: store.read(cell) for cell in cells}
    missing = [Job(cell, seed) for seed in seeds for cell in cells if seed not in done[cell]]
    total = len(cells) * len(seeds)
    results = _results(work, missing, workers or os.cpu_count() or 1)
    with _Told(console, total, total - len(missing)) as tell, closing(results):
        for job, result in results:
            store.add(job.cell, job.seed, result)
            tell()
    finished = {cell: store.read(cell) for cell in cells}
    return {cell: [finished[cell][seed] for seed in seeds] for cell in cells}


def _results(
    work: Callable[[Job], R], jobs: Sequence[Job], workers: int
) -> Generator[tuple[Job, R], None, None]:
    if workers == 1 or len(jobs) < 2:
        yield from ((job, work(job)) for job in jobs)
        return
    with ProcessPoolExecutor(
        min(workers, len(jobs)), multiprocessing.get_context("spawn"), _live_for_the_parent
    ) as pool:
        futures: dict[Future[R], Job] = {pool.submit(work, job): job for job in jobs}
        try:
            yield from ((futures[future], future.result()) for future in as_completed(futures))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _live_for_the_parent() -> None:
    """Ctrl-C reaches the whole process group; only the parent answers it. Its death ends us."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker was started by a parent"

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class _Told:
    """A progress bar on a terminal, else a line after every tenth of the jobs."""

    def __init__(self, console: Console, total: int, done: int) -> None:
        self._console, self._total, self._done = console, total, done
        self._bar = Progress(
            TextColumn("runs"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("runs", total=total, completed=done)

    def __enter__(self) -> Callable[[], None]:
        if self._done:
            self._say(f"{self._done} of {self._total} runs are there already")
        self._bar.start()
        return self._tell

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def _tell(self) -> None:
        before, self._done = self._done, self._done + 1
        self._bar.update(self._task, completed=self._done)
        step = max(1, self._total // PLAIN_LINES)
        if not self._console.is_terminal and before // step != self._done // step:
            self._say(f"{self._done} of {self._total} runs")

    def _say(self, text: str) -> None:
        self._console.print(text, highlight=False, soft_wrap=True)
