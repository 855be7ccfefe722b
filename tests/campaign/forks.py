"""Runs that share a beginning: each goes on in a copy of the process, so that none sees another."""

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection, wait
from typing import NamedTuple


class Job(NamedTuple):
    """What to do in a copy of the process as it is when the job is taken; gives JSON."""

    key: str
    work: Callable[[], bytes]


class ForkFailed(Exception):
    """A copy has ended without a result."""


def in_forks(jobs: Iterable[Job], at_once: int = 2) -> Iterator[tuple[str, bytes]]:
    """Results in the order in which they come. Raises ForkFailed."""
    context = multiprocessing.get_context("fork")
    running: dict[Connection, str] = {}
    source = iter(jobs)
    job = next(source, None)
    while job is not None or running:
        while job is not None and len(running) < at_once:
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(target=_send, args=(job.work, theirs), daemon=True)
            process.start()
            theirs.close()
            running[ours] = job.key
            job = next(source, None)
        for ready in wait(list(running)):
            assert isinstance(ready, Connection), "only pipes are waited for"
            key = running.pop(ready)
            try:
                yield key, ready.recv_bytes()
            except EOFError:
                raise ForkFailed(f"{key}: its process ended without a result") from None
            finally:
                ready.close()


def _send(work: Callable[[], bytes], connection: Connection) -> None:
    connection.send_bytes(work())
    connection.close()
