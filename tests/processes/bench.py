"""A fleet of real processes on emulated hardware, with this process as its ground station."""

import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from config.closing import Closing
from config.fleet import Fleet
from config.messages import CommandReply, Status, Truth
from groundstation.fleet_link import FleetLink
from groundstation.formation_tree import start_order
from groundstation.rehearsal import rehearsal
from groundstation.supervisor import Supervisor
from tests.processes.running import processes_with, write_fleet

UP_LIMIT_S = 60.0
CHANGE_LIMIT_S = 3.0
STANDING_MPS = 0.02
KEPT_S = 30.0


class Bench(Closing):
    """Simulated hardware and one process per robot. Leaving it ends all of them.

    `truth` keeps what the simulated hardware says of every robot: (time, speed), the last 30 s.
    """

    def __init__(self, fleet: Fleet) -> None:
        self._stack = ExitStack()
        self._folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="ech-")))
        shipped = fleet.model_copy(update={"ground": "tcp/127.0.0.1:0"})
        self.fleet = rehearsal(shipped, self._folder).fleet
        self.path = write_fleet(self._folder, self.fleet)
        self.robots = start_order(self.fleet)
        self.truth: dict[str, list[tuple[float, float]]] = {name: [] for name in self.robots}

    def __enter__(self) -> Self:
        self.link = self._stack.enter_context(FleetLink.as_ground_station(self.fleet))
        self.supervisor = self._stack.enter_context(Supervisor(self._folder))
        self._start_all()
        return self

    def restart(self) -> None:
        """End every process and start anew."""
        self.supervisor.close()
        self._start_all()

    def _start_all(self) -> None:
        self.wait(lambda: "sim" not in self.link.view.alive, "no simulated hardware yet")
        self.start("sim")
        self.wait(lambda: "sim" in self.link.view.alive, "simulated hardware up")
        for name in self.robots:
            self.start(name)

    def close(self) -> None:
        """End everything."""
        self._stack.close()

    def start(self, name: str) -> None:
        """Start the process of a robot, or "sim"."""
        common = ["--fleet", str(self.path)]
        if name == "sim":
            self.supervisor.start(name, [sys.executable, "-m", "sim_hw", *common])
        else:
            self.supervisor.start(name, [sys.executable, "-m", "onboard", *common, "--robot", name])

    def log(self, name: str) -> str:
        """What a process has said."""
        return (self._folder / f"{name}.log").read_text()

    def poll(self) -> None:
        """Take in what was heard."""
        for _, _, _, message in self.link.poll():
            if isinstance(message, Truth):
                track = self.truth[message.robot]
                track.append((message.t_ns * 1e-9, message.speed_mps))
                if track[-1][0] - track[0][0] > KEPT_S:
                    del track[: len(track) // 2]

    def wait(self, reached: Callable[[], bool], what: str, limit_s: float = UP_LIMIT_S) -> None:
        """Poll until the condition holds; AssertionError where it does not within the limit."""
        assert self.wait_until(reached, limit_s), f"not within {limit_s:g} s: {what}: {self.told()}"

    def wait_until(self, reached: Callable[[], bool], limit_s: float) -> bool:
        """Poll until the condition holds; False where it does not within the limit."""
        deadline_s = time.monotonic() + limit_s
        while True:
            self.poll()
            if reached():
                return True
            if time.monotonic() > deadline_s:
                return False
            time.sleep(0.002)

    def watch(self, seconds: float) -> None:
        """Poll for so long."""
        self.wait_until(lambda: False, seconds)

    def status(self, name: str) -> Status | None:
        """A robot's last status."""
        return self.link.view.status(name)

    def state(self, name: str) -> str:
        """A robot's last state, empty before the first."""
        return self.link.view.state(name)

    def told(self) -> dict[str, str]:
        """What every robot says last, and what it is not ready for."""
        return {
            name: "silent"
            if status is None
            else "; ".join((f"{status.state} {status.reason}", *status.not_ready))
            for name in self.robots
            for status in [self.status(name)]
        }

    def command(self, name: str, command: str) -> CommandReply:
        """Send one command to one robot."""
        return self.link.command(command, [name])[name]

    def drive(self) -> None:
        """Arm and start all, followers first; again where a busy machine stops one of them."""
        deadline_s = time.monotonic() + UP_LIMIT_S
        while not self._try_to_drive():
            assert time.monotonic() < deadline_s, f"not driving: {self.told()}"
            self.reset()

    def _try_to_drive(self) -> bool:
        self.wait(lambda: self._all(lambda status: status.ready), "all ready")
        return self._order("arm", "ARMED") and self._order("start", "RUNNING")

    def _order(self, command: str, state: str) -> bool:
        if not all(self.command(name, command).accepted for name in self.robots):
            return False
        return self.wait_until(lambda: self.all_in(state), CHANGE_LIMIT_S)

    def reset(self) -> None:
        """Stop and reset every robot until all are in STANDBY."""

        def at_rest() -> bool:
            for name in self.robots:
                if self.state(name) in ("ESTOP", "FAULT"):
                    self.command(name, "reset")
                elif self.state(name) in ("ARMING", "ARMED", "RUNNING"):
                    self.command(name, "stop")
            return self.all_in("STANDBY")

        self.wait(at_rest, "all in STANDBY")

    def all_in(self, state: str) -> bool:
        """Every robot says that it is in this state."""
        return self._all(lambda status: status.state == state)

    def _all(self, holds: Callable[..., bool]) -> bool:
        statuses = [self.status(name) for name in self.robots]
        return all(status is not None and holds(status) for status in statuses)

    def pid(self, name: str) -> int:
        """Process of a robot, or of "sim"."""
        words = ("-m sim_hw",) if name == "sim" else (f"--robot {name}",)
        (pid,) = processes_with(str(self.path), *words)
        return pid

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to one process."""
        os.kill(self.pid(name), number)

    def left_running(self) -> list[int]:
        """Processes of this bench that are there."""
        return processes_with(str(self.path))

    def moving_until_s(self, name: str, since_s: float) -> float:
        """For how long after a moment [s, monotonic] a robot has truly moved."""
        moving = [t for t, speed in self.truth[name] if t > since_s and abs(speed) > STANDING_MPS]
        return moving[-1] - since_s if moving else 0.0


def percentile(values: Sequence[float], share: float) -> float:
    """The value that this share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
