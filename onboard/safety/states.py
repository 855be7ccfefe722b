"""The robot's state machine: named events, one table, and a reason with every change.

It decides, others act: the robot's step looks at the state and arms, drives, ramps down or is
silent. FAULT and ESTOP are latched. No state but ARMED leads to RUNNING.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


class State(StrEnum):
    """What the robot is doing; the names are those of the status message."""

    STANDBY = "STANDBY"
    ARMING = "ARMING"
    ARMED = "ARMED"
    RUNNING = "RUNNING"
    STOPPING = "STOPPING"
    FAULT = "FAULT"
    ESTOP = "ESTOP"


class Event(StrEnum):
    """What can happen to the robot. ARM, START, STOP, RESET and ESTOP may be an operator's."""

    ARM = "ARM"
    DRIVES_ACTIVE = "DRIVES_ACTIVE"
    START = "START"
    STOP = "STOP"
    MISSION_ENDED = "MISSION_ENDED"
    CONTROLLED_STOP = "CONTROLLED_STOP"
    FAULT_STOP = "FAULT_STOP"
    STOPPED = "STOPPED"
    STOP_OVERDUE = "STOP_OVERDUE"
    IDLE_DRIVES = "IDLE_DRIVES"
    ESTOP = "ESTOP"
    RESET = "RESET"


class Rule(NamedTuple):
    """Where one event leads from one state.

    `guarded` events are refused while something blocks them (checks for arming, causes that still
    stand). `after_fault` is the target instead of `target` where a fault caused the stop.
    """

    target: State
    guarded: bool = False
    after_fault: State | None = None

    @property
    def targets(self) -> tuple[State, ...]:
        """Every state that the rule can lead to."""
        return (self.target,) if self.after_fault is None else (self.target, self.after_fault)


_STOPS = dict.fromkeys((Event.STOP, Event.CONTROLLED_STOP, Event.FAULT_STOP), Rule(State.STOPPING))
_POWERED = {Event.IDLE_DRIVES: Rule(State.FAULT), Event.ESTOP: Rule(State.ESTOP)}
_RESET = {Event.RESET: Rule(State.STANDBY, guarded=True)}

TABLE: dict[State, dict[Event, Rule]] = {
    State.STANDBY: {
        Event.ARM: Rule(State.ARMING, guarded=True),
        Event.ESTOP: Rule(State.ESTOP),
        **_RESET,
    },
    State.ARMING: {Event.DRIVES_ACTIVE: Rule(State.ARMED), **_STOPS, **_POWERED},
    State.ARMED: {Event.START: Rule(State.RUNNING, guarded=True), **_STOPS, **_POWERED},
    State.RUNNING: {Event.MISSION_ENDED: Rule(State.STOPPING), **_STOPS, **_POWERED},
    State.STOPPING: {
        Event.FAULT_STOP: Rule(State.STOPPING),
        Event.STOPPED: Rule(State.STANDBY, after_fault=State.FAULT),
        Event.STOP_OVERDUE: Rule(State.FAULT),
        **_POWERED,
    },
    State.FAULT: {Event.ESTOP: Rule(State.ESTOP), **_RESET},
    State.ESTOP: _RESET,
}
"""Every event that a state obeys; all others are refused. RESET in STANDBY clears the drives."""


@dataclass(frozen=True, slots=True)
class Transition:
    """A change that took place; `source` and `target` are the same where only the reason changed.

    For STOPPED the reason is that of the stop, so that it stays readable afterwards.
    """

    source: State
    target: State
    event: Event
    reason: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """An event that changed nothing, and why."""

    state: State
    event: Event
    reason: str


class StateMachine:
    """The current state, the reason for it, and whether a stop under way is a fault's."""

    def __init__(self) -> None:
        self.state = State.STANDBY
        self.reason = "started"
        self._stopping_for_fault = False

    def handle(
        self, event: Event, reason: str, blockers: Sequence[str] = ()
    ) -> Transition | Refusal:
        """Take one event.

        `blockers` are what speaks against a guarded event now: failed checks before ARM and
        START, causes that still stand before RESET. Other events ignore them.
        """
        rule = TABLE[self.state].get(event)
        if rule is None:
            return self._refuse(event, f"{event} is not possible in {self.state} ({self.reason})")
        if rule.guarded and blockers:
            return self._refuse(event, "; ".join(blockers))
        if self.state is State.STOPPING and event is Event.FAULT_STOP and self._stopping_for_fault:
            return self._refuse(event, f"already stopping for a fault ({self.reason})")
        return self._change(event, rule, reason)

    def _refuse(self, event: Event, reason: str) -> Refusal:
        return Refusal(self.state, event, reason)

    def _change(self, event: Event, rule: Rule, reason: str) -> Transition:
        source, target = self.state, rule.target
        if rule.after_fault is not None and self._stopping_for_fault:
            target = rule.after_fault
        self.state = target
        self.reason = self.reason if event is Event.STOPPED else reason
        self._stopping_for_fault = target is State.STOPPING and event is Event.FAULT_STOP
        return Transition(source, target, event, self.reason)
