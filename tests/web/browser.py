"""A real browser and real processes of a fleet, for the tests of the page and its pictures."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, sync_playwright

from config.fleet import Fleet
from config.loader import load_fleet, shipped_fleet_path
from groundstation.rehearsal import rehearsal
from tests.processes.running import BIN, wait_for, write_fleet

# Names resolve to nothing: a request to another machine would fail, and be told as a failure.
ARGUMENTS = ["--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1", "--disable-gpu"]
PATIENCE_MS = 20_000
PATIENT_S = 2.0
PATIENT_RATE_HZ = 20.0
"""Of the bearing sensor, whose silence is judged in periods."""
PATIENT_ROWS = (
    "drive_heartbeat_lost",
    "drive_estimate_stale",
    "encoder_stale",
    "bearings_stale",
    "leader_stale",
    "loop_overrun",
    "safety_node_lost",
    "watchdog_trip",
)
TICK_HZ = os.sysconf("SC_CLK_TCK")


@contextmanager
def chromium() -> Iterator[Browser]:
    """Debian's Chromium without a window; `make browser` installs it."""
    path = shutil.which("chromium")
    if path is None:
        pytest.fail("no chromium on this machine: run `make browser` (as root), or install it")
    sandbox = [] if os.getuid() else ["--no-sandbox"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*ARGUMENTS, *sandbox])
        yield browser
        browser.close()


class Watched:
    """A page of which everything is noted that should not happen."""

    def __init__(self, page: Page, url: str) -> None:
        self.page, self.url = page, url
        self.errors: list[str] = []
        self.foreign: list[str] = []
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("request", self._request)
        page.goto(url)

    def _console(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            self.errors.append(message.text)

    def _request(self, request: Request) -> None:
        if not request.url.startswith((self.url.partition("#")[0], "data:", "blob:")):
            self.foreign.append(request.url)

    def number(self, expression: str) -> float:
        """The value of a JavaScript expression."""
        return float(self.page.evaluate(expression))

    def text(self, selector: str) -> str:
        """Text of an element."""
        return self.page.locator(selector).inner_text()

    def says(self, selector: str, text: str) -> None:
        """Wait until an element holds the text."""
        self.page.locator(selector).filter(has_text=text).first.wait_for(timeout=PATIENCE_MS)

    def hold(self, selector: str) -> None:
        """Hold a button until it acts."""
        self.page.locator(f"{selector}:not(:disabled)").click(delay=1000, timeout=PATIENCE_MS)


class Processes:
    """Processes of one fleet in its own folder for sockets, ended together."""

    def __init__(self, fleet: Fleet, folder: Path) -> None:
        fleet = patient(fleet).model_copy(update={"ground": "tcp/127.0.0.1:0"})
        self.fleet = rehearsal(fleet, folder).fleet
        self._folder, self._path = folder, write_fleet(folder, self.fleet)
        self._running: list[subprocess.Popen[bytes]] = []

    def start(self, *command: str, log: str) -> subprocess.Popen[bytes]:
        """Start a process; what it says goes to a file."""
        with (self._folder / log).open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        self._running.append(process)
        return process

    def monitor(self, port: int = 0) -> tuple[subprocess.Popen[bytes], str]:
        """Start `echelon monitor`; also returns the page's address."""
        command = (str(BIN / "echelon"), "monitor", "--fleet", str(self._path), "--port", str(port))
        process = self.start(*command, log="monitor.log")
        told = self._folder / "monitor.log"
        wait_for(lambda: "page: " in told.read_text() or process.poll() is not None)
        found = re.search(r"page: (\S+)", told.read_text())
        assert found is not None, told.read_text()
        return process, found[1]

    def hardware(self) -> None:
        """Start the simulated hardware and wait for its buses."""
        self.start(*self._python("sim_hw"), log="sim.log")
        sockets = [Path(robot.can.channel) for robot in self.fleet.robots.values()]
        wait_for(lambda: all(socket.exists() for socket in sockets))

    def robots(self) -> None:
        """Start every robot."""
        for name in self.fleet.robots:
            self.start(*self._python("onboard"), "--robot", name, log=f"{name}.log")

    def up(self, name: str) -> bool:
        """Whether a robot's process says that it is up."""
        return " up on " in (self._folder / f"{name}.log").read_text()

    def _python(self, module: str) -> list[str]:
        return [sys.executable, "-m", module, "--fleet", str(self._path)]

    def end(self) -> None:
        """End everything."""
        for process in reversed(self._running):
            process.send_signal(signal.SIGTERM)
        for process in self._running:
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def patient(fleet: Fleet) -> Fleet:
    """The fleet with long timeouts and no priority: a browser shares this machine's two cores."""
    robots = {}
    for name, robot in fleet.robots.items():
        rows = {
            row: getattr(robot.failsafe, row).model_copy(update={"after_s": PATIENT_S})
            for row in PATIENT_ROWS
        }
        failsafe = robot.failsafe.model_copy(update=rows)
        loop = robot.loop.model_copy(update={"realtime_priority": 0})
        sensor = robot.bearing_sensor.model_copy(update={"rate_hz": PATIENT_RATE_HZ})
        changes = {"failsafe": failsafe, "loop": loop, "bearing_sensor": sensor}
        robots[name] = robot.model_copy(update=changes)
    simulation = fleet.simulation.model_copy(
        update={"watchdog_s": PATIENT_S, "realtime_priority": 0}
    )
    return fleet.model_copy(update={"robots": robots, "simulation": simulation})


@contextmanager
def processes(folder: Path, fleet: Fleet | None = None) -> Iterator[Processes]:
    """Processes of the demo fleet or another one, ended at the end of the block."""
    made = Processes(fleet or load_fleet(shipped_fleet_path("demo")).fleet, folder)
    with ExitStack() as stack:
        stack.callback(made.end)
        yield made


def cpu_s(pid: int) -> float:
    """Processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK_HZ
