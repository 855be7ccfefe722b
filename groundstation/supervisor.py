"""Starts, watches and ends the processes of a demo, so that none is ever left running.

Every child has a session of its own, writes to a log file, and is killed by the kernel when the
thread that started it dies: use one supervisor from the main thread.
"""

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from config.closing import Closing

TERM_PATIENCE_S = 2.0
POLL_S = 0.005
TAIL_LINES = 4
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)


class Ended(NamedTuple):
    """A process that has ended: `code` is its exit code, negative for the signal that ended it."""

    name: str
    code: int
    log: Path
    last_lines: list[str]

    @property
    def cause(self) -> str:
        """Exit code or signal name, in words."""
        if self.code >= 0:
            return f"exit code {self.code}"
        try:
            return f"signal {signal.Signals(-self.code).name}"
        except ValueError:
            return f"signal {-self.code}"

    def __str__(self) -> str:
        text = f"process {self.name} ended by itself: {self.cause}"
        if not self.last_lines:
            return f"{text}; {self.log} is empty"
        return f"{text}; last lines of {self.log}: {' | '.join(self.last_lines)}"


@dataclass(frozen=True, slots=True)
class _Child:
    name: str
    process: subprocess.Popen[bytes]
    log: Path


class Supervisor(Closing):
    """The processes of one demo. Leaving its `with` block ends all of them."""

    def __init__(self, log_folder: Path) -> None:
        self._log_folder = log_folder
        self._children: list[_Child] = []

    def start(self, name: str, command: Sequence[str]) -> None:
        """Start a process; its output goes to `<name>.log` in the log folder.

        Raises OSError when the command cannot be started.
        """
        log, parent = self._log_folder / f"{name}.log", os.getpid()
        with log.open("wb") as output:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=lambda: _die_with(parent),
            )
        self._children.append(_Child(name, process, log))

    def ended(self) -> list[Ended]:
        """Processes that have ended by themselves, in the order in which they were started."""
        return [
            Ended(child.name, child.process.returncode, child.log, _tail(child.log))
            for child in self._children
            if child.process.poll() is not None
        ]

    def close(self) -> None:
        """End every process: TERM, and KILL for whatever is left of it after 2 s."""
        try:
            for child in self._children:
                _signal(child, signal.SIGTERM)
            deadline = time.monotonic() + TERM_PATIENCE_S
            while self._running() and time.monotonic() < deadline:
                time.sleep(POLL_S)
        finally:
            for child in self._children:
                _signal(child, signal.SIGKILL)
            for child in self._children:
                child.process.wait()
            self._children.clear()

    def _running(self) -> bool:
        return any(child.process.poll() is None for child in self._children)


def _die_with(parent: int) -> None:
    """Runs in the child before its program: be killed when the supervisor dies."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _signal(child: _Child, number: signal.Signals) -> None:
    """Signal a child and what it started: its process group bears its own number."""
    try:
        os.killpg(child.process.pid, number)
    except ProcessLookupError:
        return


def _tail(log: Path) -> list[str]:
    text = log.read_text(encoding="utf-8", errors="replace")
    return [line for line in text.splitlines() if line.strip()][-TAIL_LINES:]
