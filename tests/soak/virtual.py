"""Hours of virtual time in lockstep: the fleet drives in circles while faults come and go."""

import gc
import math
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from config.faults import Fault
from config.fleet import Fleet
from config.messages import CommandReply
from groundstation.formation_tree import start_order
from groundstation.lockstep import AT_REST, Lockstep
from tests.hil.fleets import carry_back
from tests.soak.operator import Operator, View
from tests.soak.samples import Sample

STEP_S = 0.1
MINUTE_S = 60.0
MEAN_INTERVAL_S = 15.0
STANDING_MPS = 0.02
REST_S = 2.5
"""After so long in a state without power a robot has to stand; it coasts for 0.7 s from 1 m/s."""
SETTLED_S = 8.0
"""After a start or a disturbance the formation is judged again from then on."""
FAR_M = 8.0
CLOCK_STEP_S = 1.0
PAGE_MB = resource.getpagesize() / 2**20


class _Ending(NamedTuple):
    t_s: float
    undo: Callable[[], None]


class VirtualField:
    """The lockstep fleet as the soak's operator sees it."""

    def __init__(self, lockstep: Lockstep) -> None:
        self.lockstep = lockstep
        self._order = start_order(lockstep.fleet)
        self._endings: list[_Ending] = []

    def now_s(self) -> float:
        """Virtual time."""
        return self.lockstep.now_s

    def views(self) -> Mapping[str, View]:
        """Every robot by its last status, followers first."""
        statuses = self.lockstep.statuses
        return {
            name: View(statuses[name].state, statuses[name].ready)
            if name in statuses
            else View("", False)
            for name in self._order
        }

    def wait(self, reached: Callable[[], bool], limit_s: float) -> bool:
        """Tick until the condition holds."""
        return self.lockstep.run_until(reached, limit_s)

    def command(self, robot: str, name: str) -> CommandReply:
        """Send a command and tick until it is answered."""
        return self.lockstep.command(robot, name)

    def inject(self, fault: Fault) -> None:
        """Hand a fault to the emulated hardware."""
        self.lockstep.simulation.inject(fault)

    def by_hand(self, robot: str, what: str, for_s: float) -> None:
        """Emergency stop, stop, a process that hangs, or a wall clock that is set."""
        lockstep, station = self.lockstep, self.lockstep.stations[robot]
        if what == "estop":
            lockstep.estop()
        elif what == "stop":
            lockstep.command(robot, "stop")
        elif what == "pause":
            station.running = False
            self._later(for_s, lambda: setattr(station, "running", True))
        else:
            station.clock_step_s = CLOCK_STEP_S
            self._later(for_s, lambda: setattr(station, "clock_step_s", 0.0))

    def bring_back(self) -> None:
        """Carry the robots to their start poses, and tell them so."""
        carry_back(self.lockstep)

    def end_what_is_over(self) -> None:
        """Let hanging processes go on and clocks return."""
        for ending in [each for each in self._endings if each.t_s <= self.lockstep.now_s]:
            ending.undo()
            self._endings.remove(ending)

    def _later(self, for_s: float, undo: Callable[[], None]) -> None:
        self._endings.append(_Ending(self.lockstep.now_s + for_s, undo))


class Watch:
    """Judges on truth, every 0.1 s: spacing, leader's pose, and robots that move without leave."""

    def __init__(self, lockstep: Lockstep) -> None:
        self._lockstep = lockstep
        self._rest_s: dict[str, float] = {}
        self.nearest_m = math.inf
        self.moving_at_rest = 0
        self.spacing: list[float] = []
        self.running_steps = 0

    def look(self, operator: Operator) -> None:
        """One look."""
        now_s, fleet = self._lockstep.now_s, self._lockstep.fleet
        truth = {name: robot.truth for name, robot in self._lockstep.simulation.robots.items()}
        for name, status in self._lockstep.statuses.items():
            if status.state not in AT_REST or not self._lockstep.stations[name].running:
                self._rest_s[name] = now_s
            elif now_s - self._rest_s.setdefault(name, now_s) > REST_S:
                self.moving_at_rest += abs(truth[name].speed_mps) > STANDING_MPS
        since_s = operator.driving_since_s
        self.running_steps += since_s is not None
        for name, robot in fleet.robots.items():
            if robot.leader is None or robot.offset is None:
                continue
            leader = truth[robot.leader]
            gap_m = math.hypot(leader.x_m - truth[name].x_m, leader.y_m - truth[name].y_m)
            self.nearest_m = min(self.nearest_m, gap_m)
            settled_s = max(operator.disturbed_s, since_s or math.inf) + SETTLED_S
            if now_s > settled_s:
                self.spacing.append(gap_m - math.hypot(robot.offset.x_m, robot.offset.y_m))


class VirtualSoak:
    """A soak of one session; `minute` runs the next minute and returns its figures."""

    def __init__(self, fleet: Fleet, seed: int, session: int, from_s: float) -> None:
        self._published: Counter[str] = Counter()
        self._lockstep = Lockstep(fleet, seed + session, self._count)
        self._session, self._from_s = session, from_s
        self._field = VirtualField(self._lockstep)
        rng = np.random.default_rng([seed, session])
        self.operator = Operator(self._field, rng, MEAN_INTERVAL_S)
        self._began_s = self._lockstep.now_s
        self._minutes = 0
        self._before: Counter[str] = Counter()

    def close(self) -> None:
        """Leave the buses."""
        self._lockstep.__exit__(None, None, None)

    def minute(self, seconds: float = MINUTE_S) -> Sample:
        """Run on for a minute and measure."""
        watch = Watch(self._lockstep)
        cpu_s = time.process_time()
        began_s, self._minutes = self._lockstep.now_s, self._minutes + 1
        while self._lockstep.now_s < began_s + seconds:
            self._lockstep.run_for(STEP_S)
            self._field.end_what_is_over()
            self.operator.step()
            watch.look(self.operator)
            self._return_strays()
        passed_s = self._lockstep.now_s - began_s
        cpu_s = time.process_time() - cpu_s
        figures = {"cpu_ms_per_s": 1e3 * cpu_s / passed_s} | _memory() | self._counted(passed_s)
        figures |= {
            "driving_share": watch.running_steps * STEP_S / passed_s,
            "nearest_m": watch.nearest_m,
            "moving_at_rest": float(watch.moving_at_rest),
        }
        if watch.spacing:
            figures["spacing_rms_m"] = float(np.sqrt(np.mean(np.square(watch.spacing))))
        return Sample(self._session, self._from_s + self._lockstep.now_s - self._began_s, figures)

    def _return_strays(self) -> None:
        """The circle moves with every new start; where it has gone too far, begin at the start."""
        robots = self._lockstep.simulation.robots.values()
        at_rest = all(abs(robot.truth.speed_mps) < STANDING_MPS for robot in robots)
        if at_rest and any(math.hypot(r.truth.x_m, r.truth.y_m) > FAR_M for r in robots):
            self._field.bring_back()
            self.operator.done["carried from afar"] += 1

    def _count(self, key: str, body: bytes, _wall_ns: int) -> None:
        self._published[key.rpartition("/")[2]] += 1

    def _counted(self, passed_s: float) -> dict[str, float]:
        """What robots, port and operator counted in this minute, and how time has run."""
        now: Counter[str] = Counter(self.operator.done)
        late_s = 0.0
        for name, status in self._lockstep.statuses.items():
            now["blocked"] += status.blocked_frames
            now["send_failures"] += status.bus.send_failures
            now["error_frames"] += status.bus.error_frames
            now["received"] += status.bus.received
            now["reopened"] += status.bus.reopened
            if self._lockstep.stations[name].running:
                late_s = max(late_s, self._lockstep.now_s - status.t_ns * 1e-9)
        now["published"] += self._published.total()
        grown, self._before = now - self._before, now
        figures = {name: float(count) for name, count in grown.items()}
        received_per_s = figures.pop("received", 0.0) / passed_s
        published_per_s = figures.pop("published", 0.0) / passed_s
        defaults = {"blocked": 0.0, "send_failures": 0.0, "error_frames": 0.0}
        return (
            defaults
            | figures
            | {
                "received_per_s": received_per_s,
                "published_per_s": published_per_s,
                "status_age_s": late_s,
            }
        )


def _memory() -> dict[str, float]:
    """Resident memory, and what Python itself has allocated after a collection."""
    gc.collect()
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB
    return {
        "rss_mb": resident,
        "blocks": float(sys.getallocatedblocks()),
        "objects": float(len(gc.get_objects())),
        "files": float(len(list(Path("/proc/self/fd").iterdir()))),
    }
