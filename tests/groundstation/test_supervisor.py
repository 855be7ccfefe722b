"""No process is left running, however a demo ends, and an early death is told at once."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from groundstation import supervisor as supervisor_module
from groundstation.supervisor import Supervisor

pytestmark = pytest.mark.process

SLEEPER = "import time; print('up', flush=True); time.sleep(60)"
DEAF = f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {SLEEPER}"
PARENT = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {SLEEPER!r}]).wait()"
ORPHANER = """
import pathlib, sys, time
from groundstation.supervisor import Supervisor
supervisor = Supervisor(pathlib.Path(sys.argv[1]))
supervisor.start("child", [sys.executable, "-c", sys.argv[2]])
time.sleep(60)
"""


def _python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


def _wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline, f"no {what} within 10 s"
        time.sleep(0.005)


def _up(log: Path) -> Callable[[], bool]:
    return lambda: log.exists() and "up" in log.read_text()


def _sleepers(log: Path) -> list[int]:
    """Processes whose output goes to the log file: the child and all that it started."""
    found = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            with suppress(OSError):
                if (process / "fd/1").readlink() == log:
                    found.append(int(process.name))
    return found


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[Supervisor]:
    with Supervisor(tmp_path) as running:
        yield running


def test_processes_end_with_the_block(tmp_path: Path) -> None:
    with Supervisor(tmp_path) as running:
        running.start("one", _python(SLEEPER))
        running.start("two", _python(SLEEPER))
        _wait_for(_up(tmp_path / "two.log"), "second process")
        assert running.ended() == []
    assert _sleepers(tmp_path / "one.log") + _sleepers(tmp_path / "two.log") == []


def test_processes_end_when_the_block_raises(tmp_path: Path) -> None:
    def interrupted() -> None:
        with Supervisor(tmp_path) as running:
            running.start("one", _python(SLEEPER))
            _wait_for(_up(tmp_path / "one.log"), "process")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert _sleepers(tmp_path / "one.log") == []


def test_a_process_that_ignores_term_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor_module, "TERM_PATIENCE_S", 0.2)
    with Supervisor(tmp_path) as running:
        running.start("deaf", _python(DEAF))
        _wait_for(_up(tmp_path / "deaf.log"), "process")
        began = time.monotonic()
    assert 0.2 <= time.monotonic() - began < 2.0
    assert _sleepers(tmp_path / "deaf.log") == []


def test_what_a_process_started_ends_too(supervisor: Supervisor, tmp_path: Path) -> None:
    supervisor.start("parent", _python(PARENT))
    _wait_for(_up(tmp_path / "parent.log"), "grandchild")
    assert len(_sleepers(tmp_path / "parent.log")) == 2
    supervisor.close()
    _wait_for(lambda: _sleepers(tmp_path / "parent.log") == [], "end of the grandchild")


def test_a_crash_is_told_with_exit_code_and_last_lines(
    supervisor: Supervisor, tmp_path: Path
) -> None:
    supervisor.start("r2", _python("import sys; print('no bus', file=sys.stderr); sys.exit(3)"))
    _wait_for(lambda: bool(supervisor.ended()), "notice of the crash")
    (ended,) = supervisor.ended()
    assert (ended.name, ended.code, ended.last_lines) == ("r2", 3, ["no bus"])
    assert str(ended) == (
        f"process r2 ended by itself: exit code 3; last lines of {tmp_path / 'r2.log'}: no bus"
    )


def test_a_killed_process_is_told_with_the_signals_name(
    supervisor: Supervisor, tmp_path: Path
) -> None:
    supervisor.start("sim", _python(SLEEPER))
    _wait_for(_up(tmp_path / "sim.log"), "process")
    os.kill(_sleepers(tmp_path / "sim.log")[0], signal.SIGKILL)
    _wait_for(lambda: bool(supervisor.ended()), "notice of the kill")
    assert supervisor.ended()[0].cause == "signal SIGKILL"


def test_nothing_is_left_when_the_supervisor_itself_is_killed(tmp_path: Path) -> None:
    with subprocess.Popen([*_python(ORPHANER), str(tmp_path), SLEEPER]) as process:
        try:
            _wait_for(_up(tmp_path / "child.log"), "child")
            assert len(_sleepers(tmp_path / "child.log")) == 1
        finally:
            process.kill()
    _wait_for(lambda: _sleepers(tmp_path / "child.log") == [], "end of the child")
