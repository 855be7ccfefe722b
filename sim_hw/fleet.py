"""All simulated robots of a fleet, moved together in steps of one millisecond."""

import heapq
import math
from collections.abc import Collection
from typing import NamedTuple

from numpy.random import SeedSequence

from config.can.database import CanDatabase
from config.faults import HEALTHY, Fault, FaultScript, kind_of, problems
from config.fleet import Fleet
from sim_hw.robot import SimulatedRobot

STEP_S = 0.001
MOVING_MPS = 0.02

_TOLERANCE_STEPS = 1e-6


class FaultRefused(ValueError):
    """A fault that no device of the fleet can have; the text says why and what is known."""


class _Change(NamedTuple):
    """A fault that begins or ends at `t_s`; `number` is that of its injection."""

    t_s: float
    number: int
    begins: bool
    fault: Fault


class SimulatedFleet:
    """The robots of a fleet, or those in `names`, standing at their start poses at `t0_s`.

    A robot's random streams depend on `seed` and its place in the fleet, not on `names`. Raises
    KeyError for a name that is not in the fleet.
    """

    def __init__(
        self,
        fleet: Fleet,
        seed: int,
        t0_s: float,
        database: CanDatabase,
        names: Collection[str] | None = None,
    ) -> None:
        wanted = set(fleet.robots if names is None else names)
        if unknown := wanted - fleet.robots.keys():
            raise KeyError(f"no robot {sorted(unknown)} in fleet {fleet.name}")
        self._t0_s = t0_s
        self._changes: list[_Change] = []
        self._injections = 0
        self._latest: dict[tuple[str, str, str], int] = {}
        self._script: FaultScript | None = None
        self._notes: list[str] = []
        self._steps = 0
        seeds = SeedSequence(seed).spawn(len(fleet.robots))
        self.robots: dict[str, SimulatedRobot] = {
            name: SimulatedRobot(
                config, fleet.simulation, fleet.landmarks, database, t0_s, robot_seed
            )
            for (name, config), robot_seed in zip(fleet.robots.items(), seeds, strict=True)
            if name in wanted
        }
        self._sights = [
            (robot, [other.marked for other in self.robots.values() if other is not robot])
            for robot in self.robots.values()
        ]

    @property
    def t_s(self) -> float:
        """Time of the last step."""
        return self._t0_s + self._steps * STEP_S

    def inject(self, fault: Fault, t_s: float | None = None) -> None:
        """Let a fault begin at `t_s` (None: now) and end after its `for_s`; `at_s` is not read.

        The kind `ok` ends all faults of the device, at once. Raises FaultRefused.
        """
        if refusals := [text for _, text in problems(fault, self.robots)]:
            raise FaultRefused("; ".join(refusals))
        if fault.kind == HEALTHY:
            self.clear(fault.robot, fault.device)
            return
        self._injections += 1
        begin_s = self.t_s if t_s is None else t_s
        heapq.heappush(self._changes, _Change(begin_s, self._injections, True, fault))
        if fault.for_s is not None:
            end_s = begin_s + fault.for_s
            heapq.heappush(self._changes, _Change(end_s, self._injections, False, fault))
        self._apply_changes()

    def clear(self, robot: str, device: str) -> None:
        """End every fault of a device now, and forget those that are still to come."""
        self._changes = [
            change
            for change in self._changes
            if (change.fault.robot, change.fault.device) != (robot, device)
        ]
        heapq.heapify(self._changes)
        for kind in self.robots[robot].active_faults(device):
            self.robots[robot].end_fault(device, kind)
            self._notes.append(f"{robot} {device}: {kind} ends")

    def play(self, script: FaultScript) -> None:
        """Inject scripted faults as their times come. Raises FaultRefused."""
        if refusals := [t for f in script.faults for _, t in problems(f, self.robots)]:
            raise FaultRefused("; ".join(refusals))
        if script.clock == "power":
            self._start_script(script, self._t0_s)
        else:
            self._script = script

    def take_notes(self) -> list[str]:
        """Sentences on the faults that have begun and ended since the last call."""
        notes, self._notes = self._notes, []
        return notes

    def _start_script(self, script: FaultScript, zero_s: float) -> None:
        for fault in script.faults:
            self.inject(fault, zero_s + fault.at_s)

    def _apply_changes(self) -> None:
        """Begin and end what is due; a fault that a newer one has replaced does not end it."""
        while self._changes and self._changes[0].t_s <= self.t_s + STEP_S * _TOLERANCE_STEPS:
            _, number, begins, fault = heapq.heappop(self._changes)
            key = fault.robot, fault.device, fault.kind
            robot = self.robots[fault.robot]
            if begins:
                self._latest[key] = number
                robot.begin_fault(fault.device, fault.kind, fault.value)
            elif self._latest.get(key) == number:
                robot.end_fault(fault.device, fault.kind)
            else:
                continue
            self._notes.append(" ".join(key[:2]) + _told(fault, begins))

    def _watch_for_motion(self, script: FaultScript) -> None:
        if any(abs(robot.vehicle.speed_mps) > MOVING_MPS for robot in self.robots.values()):
            self._script = None
            self._start_script(script, self.t_s)

    def advance(self, t_s: float) -> None:
        """Step everything on to the last whole step at or before `t_s`."""
        target = math.floor((t_s - self._t0_s) / STEP_S + _TOLERANCE_STEPS)
        while self._steps < target:
            self._steps += 1
            now_s = self.t_s
            for robot, _ in self._sights:
                robot.move(now_s)
            if self._script is not None:
                self._watch_for_motion(self._script)
            if self._changes:
                self._apply_changes()
            for robot, others in self._sights:
                robot.run_devices(others)


def _told(fault: Fault, begins: bool) -> str:
    if not begins:
        return f": {fault.kind} ends"
    row = kind_of(fault.device, fault.kind)
    value = row.default if fault.value is None else fault.value
    amount = f" {value:g}{'' if row.unit == '1' else ' ' + row.unit}" if row.unit else ""
    duration = "" if fault.for_s is None else f" for {fault.for_s:g} s"
    return f": {fault.kind}{amount}{duration}"
