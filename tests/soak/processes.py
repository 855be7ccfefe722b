"""Minutes of real processes: the same operator, the same faults, and what the processes cost."""

import math
import os
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from config.faults import Fault
from config.fleet import Fleet
from config.messages import CommandReply, FaultOrder
from tests.processes.bench import Bench
from tests.soak.operator import Operator, View
from tests.soak.samples import Sample

STEP_S = 0.1
MINUTE_S = 60.0
MEAN_INTERVAL_S = 20.0
ESTOP_LIMIT_S = 1.0
TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class RealField:
    """The bench as the soak's operator sees it."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.restarts = 0

    def now_s(self) -> float:
        """Monotonic time."""
        return time.monotonic()

    def views(self) -> Mapping[str, View]:
        """Every robot by its last status, followers first."""
        views = {}
        for name in self.bench.robots:
            status = self.bench.status(name)
            views[name] = View("", False) if status is None else View(status.state, status.ready)
        return views

    def wait(self, reached: Callable[[], bool], limit_s: float) -> bool:
        """Poll until the condition holds."""
        return self.bench.wait_until(reached, limit_s)

    def command(self, robot: str, name: str) -> CommandReply:
        """Send a command."""
        return self.bench.command(robot, name)

    def inject(self, fault: Fault) -> None:
        """Order a fault of the emulated hardware, as `echelon fault` does."""
        order = FaultOrder(
            device=fault.device,
            kind=fault.kind,
            for_s=fault.for_s,
            value=fault.value,
            operator="soak",
        )
        self.bench.link.order_fault(fault.robot, order)

    def by_hand(self, robot: str, what: str, for_s: float) -> None:
        """Emergency stop, or a stop; processes are broken by `make kills`."""
        if what == "estop":
            self.bench.link.estop(ESTOP_LIMIT_S)
        else:
            self.bench.command(robot, "stop")

    def bring_back(self) -> None:
        """The emulated hardware and the robots start anew at their places."""
        self.restarts += 1
        self.bench.restart()


class RealSoak:
    """A soak of real processes; `minute` lets the next minute pass and returns its figures."""

    def __init__(self, fleet: Fleet, seed: int, session: int) -> None:
        self._session = session
        self.bench = Bench(fleet).__enter__()
        self.field = RealField(self.bench)
        self.operator = Operator(
            self.field, np.random.default_rng([seed, session]), MEAN_INTERVAL_S
        )
        self._before: Counter[str] = Counter()
        self._grown: dict[str, float] = {}

    def close(self) -> None:
        """End every process."""
        self.bench.__exit__(None, None, None)

    def minute(self, from_s: float, seconds: float = MINUTE_S) -> Sample:
        """Let a minute pass."""
        began_s, steps, driving = time.monotonic(), 0, 0
        cpu_s, restarts = self._cpu_s(), self.field.restarts
        while time.monotonic() < began_s + seconds:
            self.bench.watch(STEP_S)
            self.operator.step()
            steps += 1
            driving += self.operator.driving_since_s is not None
        passed_s = time.monotonic() - began_s
        figures = {"driving_share": driving / max(1, steps)}
        for name, used_s in self._cpu_s().items():
            figures[f"{name} cpu_ms_per_s"] = 1e3 * (used_s - cpu_s.get(name, used_s)) / passed_s
            figures |= {f"{name} {key}": value for key, value in self._process(name).items()}
        told, session = self._told(passed_s), self._session + 1000 * self.field.restarts
        if self.field.restarts > restarts:  # figures of two processes do not mix
            figures, told = {"restarts": float(self.field.restarts - restarts)}, self._done()
        return Sample(session, from_s + passed_s, figures | told)

    def _cpu_s(self) -> dict[str, float]:
        used = {}
        for name in ("sim", *self.bench.robots):
            fields = Path(f"/proc/{self.bench.pid(name)}/stat").read_text().rpartition(")")[2]
            words = fields.split()
            used[name] = (int(words[11]) + int(words[12])) / TICKS_PER_S
        return used

    def _process(self, name: str) -> dict[str, float]:
        """Memory, open files and threads of one process."""
        folder = Path(f"/proc/{self.bench.pid(name)}")
        status = dict(
            line.split(":", 1)
            for line in (folder / "status").read_text().splitlines()
            if ":" in line
        )
        return {
            "rss_mb": int(status["VmRSS"].split()[0]) / 1024,
            "threads": float(status["Threads"]),
            "files": float(len(list((folder / "fd").iterdir()))),
        }

    def _done(self) -> dict[str, float]:
        """What the operator has done since the last minute."""
        return {name: self._grown.get(name, 0.0) for name in self.operator.done}

    def _told(self, passed_s: float) -> dict[str, float]:
        """What the robots say of their loops and buses."""
        now: Counter[str] = Counter(self.operator.done)
        figures: dict[str, float] = {}
        for name in self.bench.robots:
            status = self.bench.status(name)
            if status is None:
                continue
            now[f"{name} cycles"] = status.loop.cycles
            now["overruns"] += status.loop.overruns
            now["blocked"] += status.blocked_frames
            now["send_failures"] += status.bus.send_failures
            figures[f"{name} p50_ms"] = status.loop.p50_ms
            figures[f"{name} late_p99_ms"] = status.loop.late_p99_ms
        grown = {name: float(now[name] - self._before[name]) for name in now}
        self._before, self._grown = now, grown
        for name in self.bench.robots:
            figures[f"{name} cycles_per_s"] = grown.pop(f"{name} cycles", math.nan) / passed_s
        return figures | grown
