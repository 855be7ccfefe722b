"""Starting the real commands and finding the processes that belong to one run."""

import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from config.fleet import Acceptance, Fleet, Segment
from config.loader import dump_effective, load_fleet, shipped_fleet_path

BIN = Path(sys.executable).parent
DEADLINE_S = 60.0


def wait_for(condition: Callable[[], bool], limit_s: float = DEADLINE_S) -> None:
    """Let other processes run until the condition holds."""
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "condition not met in time"
        select.select([], [], [], 0.01)


def short_demo(folder: Path, duration_s: float) -> Path:
    """A file with the demo fleet on a shorter mission, judged from 2 s before its end."""
    fleet = load_fleet(shipped_fleet_path("demo")).fleet
    segment = Segment(duration_s=duration_s, speed_mps=1.0, fork_rate_radps=-0.2618)
    mission = fleet.mission.model_copy(
        update={"segments": [segment], "acceptance": Acceptance(from_s=duration_s - 2.0)}
    )
    return write_fleet(folder, fleet.model_copy(update={"mission": mission}))


def write_fleet(folder: Path, fleet: Fleet) -> Path:
    """The fleet as a file."""
    path = folder / f"{fleet.name}.yaml"
    path.write_text(dump_effective(fleet), encoding="utf-8")
    return path


class Demo:
    """A running `echelon demo --json`."""

    def __init__(self, fleet: Path, out: Path) -> None:
        self.out = out
        self._told, self._answer = out.with_suffix(".stderr"), out.with_suffix(".stdout")
        command = [str(BIN / "echelon"), "demo", "--json", "--ground", "tcp/127.0.0.1:0"]
        with self._told.open("w") as told, self._answer.open("w") as answer:
            self.process = subprocess.Popen(
                [*command, "--fleet", str(fleet), "--out", str(out)], stdout=answer, stderr=told
            )

    def tells(self, text: str) -> bool:
        """Whether it has said so on standard error."""
        return text in self._told.read_text()

    def mission_time_s(self) -> float:
        """The latest mission time that it has told; 0 before the first."""
        told = re.findall(r"mission ([0-9.]+) of", self._told.read_text())
        return float(told[-1]) if told else 0.0

    def finish(self) -> tuple[int, str]:
        """Exit code and standard output."""
        return self.process.wait(DEADLINE_S), self._answer.read_text()

    def pids(self, *words: str) -> list[int]:
        """Processes of this run whose command line holds all the words."""
        return processes_with(str(self.out), *words)

    def kill(self, *words: str) -> None:
        """SIGKILL the one process of this run whose command line holds all the words."""
        (pid,) = self.pids(*words)
        os.kill(pid, signal.SIGKILL)


@contextmanager
def demo(fleet: Path, out: Path) -> Iterator[Demo]:
    """A demo that is ended, with all its processes, when the test is over."""
    running = Demo(fleet, out)
    try:
        yield running
    finally:
        running.process.kill()
        running.process.wait(DEADLINE_S)


def processes_with(*words: str) -> list[int]:
    """Ids of processes whose command line holds all the words."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            arguments = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if all(word in arguments for word in words):
            found.append(int(entry.name))
    return found


def run_command(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run one of the console scripts to its end."""
    return subprocess.run(
        [str(BIN / arguments[0]), *arguments[1:]],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
        **options,
    )
