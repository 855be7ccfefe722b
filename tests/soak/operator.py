"""The operator of a soak: starts the fleet, breaks things, recovers, and starts it again.

It works by commands alone and never waits for a person; the field it stands in is virtual or real.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from numpy.random import Generator

from config.faults import KINDS, Fault
from config.messages import CommandReply

POWERED = frozenset({"ARMING", "ARMED", "RUNNING", "STOPPING"})
LATCHED = frozenset({"FAULT", "ESTOP"})
RETRY_S = 0.5
CLEAR_S = 3.0
"""A robot in STANDBY whose drives kept an error is reset again this often."""
STUCK_S = 20.0
"""Robots that are not ready for so long after a stop are carried back to where they started."""
CHANGE_LIMIT_S = 3.0
LEAST_FAULT_S, MOST_FAULT_S = 0.05, 3.0
BY_HAND = ("estop", "stop", "pause", "clock")
BY_HAND_SHARE = 0.15


class View(NamedTuple):
    """What the operator knows of one robot."""

    state: str
    ready: bool


class Field(Protocol):
    """Where the fleet drives."""

    def now_s(self) -> float:
        """Time of the run."""
        ...

    def views(self) -> Mapping[str, View]:
        """Every robot, followers first."""
        ...

    def wait(self, reached: Callable[[], bool], limit_s: float) -> bool:
        """Let time pass until the condition holds; False where it does not within the limit."""
        ...

    def command(self, robot: str, name: str) -> CommandReply:
        """Send one operator's command."""
        ...

    def inject(self, fault: Fault) -> None:
        """Break something."""
        ...

    def by_hand(self, robot: str, what: str, for_s: float) -> None:
        """One of BY_HAND."""
        ...

    def bring_back(self) -> None:
        """Carry every robot to its start."""
        ...


class Operator:
    """Call `step` every 0.1 s. `done` counts what was done, `driving_since_s` says since when."""

    def __init__(self, field: Field, rng: Generator, mean_interval_s: float) -> None:
        self.done: Counter[str] = Counter()
        self.driving_since_s: float | None = None
        self.disturbed_s = -math.inf
        self._field, self._rng, self._mean_s = field, rng, mean_interval_s
        self._halted_s = field.now_s()
        self._next_try_s = self._next_clear_s = self._next_event_s = 0.0

    def step(self) -> None:
        """Break something when its time has come; recover where a robot has stopped."""
        now_s, views = self._field.now_s(), self._field.views()
        if self.driving_since_s is None:
            if now_s >= self._next_try_s:
                self._next_try_s = now_s + RETRY_S
                self._recover(now_s, views)
        elif any(view.state != "RUNNING" for view in views.values()):
            self._halt(views)
        elif now_s >= self._next_event_s:
            self._disturb(now_s, list(views))

    def _halt(self, views: Mapping[str, View]) -> None:
        """One robot has stopped: so must all, since a leader does not hear of its followers."""
        self.done["stops"] += self.driving_since_s is not None
        self.driving_since_s = None
        for name, view in views.items():
            if view.state in POWERED:
                self._field.command(name, "stop")
        self._halted_s = self._field.now_s()

    def _recover(self, now_s: float, views: Mapping[str, View]) -> None:
        again = now_s >= self._next_clear_s
        if again:
            self._next_clear_s = now_s + CLEAR_S
        for name, view in views.items():
            if view.state in LATCHED or (again and view == ("STANDBY", False)):
                self.done["resets"] += self._field.command(name, "reset").accepted
        if any(view.state in POWERED for view in views.values()):
            self._halt(views)
        elif all(view == ("STANDBY", True) for view in views.values()):
            self._start()
        elif now_s - self._halted_s > STUCK_S:
            self._field.bring_back()
            self.done["carried back"] += 1
            self._halted_s = self._field.now_s()

    def _start(self) -> None:
        if self._order("arm", "ARMED") and self._order("start", "RUNNING"):
            self.done["starts"] += 1
            self.driving_since_s = self._field.now_s()
            self._plan(self.driving_since_s)

    def _order(self, command: str, state: str) -> bool:
        for name in self._field.views():
            if not self._field.command(name, command).accepted:
                self.done[f"{command} refused"] += 1
                return False
        return self._field.wait(
            lambda: all(view.state == state for view in self._field.views().values()),
            CHANGE_LIMIT_S,
        )

    def _plan(self, now_s: float) -> None:
        self._next_event_s = now_s + 1.0 + self._rng.exponential(self._mean_s)

    def _disturb(self, now_s: float, robots: list[str]) -> None:
        self.disturbed_s = now_s
        self._plan(now_s)
        robot = robots[self._rng.integers(len(robots))]
        for_s = round(float(self._rng.uniform(LEAST_FAULT_S, MOST_FAULT_S)), 2)
        if self._rng.random() < BY_HAND_SHARE:
            what = BY_HAND[self._rng.integers(len(BY_HAND))]
            self.done[what] += 1
            self._field.by_hand(robot, what, for_s)
            return
        kind = KINDS[self._rng.integers(len(KINDS))]
        device = kind.devices[self._rng.integers(len(kind.devices))]
        self.done["faults"] += 1
        self._field.inject(
            Fault(
                robot=robot,
                device=device,
                kind=kind.name,
                for_s=None if kind.once else for_s,
            )
        )
