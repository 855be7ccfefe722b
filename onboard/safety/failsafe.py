"""The failsafe table at work: which triggers stand, for how long, and what that asks for.

The rows are the fleet file's `failsafe` section, the triggers are in `onboard.safety.triggers`.
The emergency stop is no row: nobody can configure it away.
"""

from enum import IntEnum
from typing import NamedTuple

from config import failsafe
from onboard.safety.observations import Observations, SafetyNodeSeen
from onboard.safety.states import Event
from onboard.safety.triggers import TRIGGERS, Trigger

_ROUNDING_S = 1e-6
QUIET_S = 1.0
"""A trigger that comes and goes is told of once per so long."""


class Action(IntEnum):
    """What to do, in order of severity. FAULT_STOP is a stop that ends in FAULT."""

    NONE = 0
    WARN = 1
    SLOW = 2
    HOLD_DISTANCE = 3
    STOP = 4
    FAULT_STOP = 5
    IDLE = 6
    ESTOP = 7


EVENT_OF: dict[Action, Event] = {
    Action.STOP: Event.CONTROLLED_STOP,
    Action.FAULT_STOP: Event.FAULT_STOP,
    Action.IDLE: Event.IDLE_DRIVES,
    Action.ESTOP: Event.ESTOP,
}
"""The state machine's event for every action that changes the state."""


class Verdict(NamedTuple):
    """An action, the observation behind it, naming value and limit, and the trigger's name."""

    action: Action
    reason: str
    trigger: str = ""


NOTHING = Verdict(Action.NONE, "")


class Judgement(NamedTuple):
    """The most severe verdict, what else restrains the robot, and what to tell people."""

    worst: Verdict
    slow: bool
    hold_distance: bool
    news: tuple[Verdict, ...]


class FailsafeTable:
    """Counts for how long each trigger has stood; of equally severe ones the first row speaks."""

    def __init__(self, table: failsafe.Failsafe) -> None:
        self._table = table
        self._since_s: dict[str, float] = {}
        self._told: dict[str, tuple[Action, float]] = {}

    def judge(self, seen: Observations, now_s: float, powered: bool) -> Judgement:
        """One cycle. Without power only the emergency stop counts, and nobody is warned."""
        worst = _estop(seen) or NOTHING
        if not powered:
            self._since_s.clear()
            return Judgement(worst, slow=False, hold_distance=False, news=())
        verdicts = [v for row in TRIGGERS if (v := self._verdict(row, seen, now_s)) is not None]
        for verdict in verdicts:
            if verdict.action > worst.action:
                worst = verdict
        actions = {verdict.action for verdict in verdicts}
        return Judgement(
            worst,
            slow=Action.SLOW in actions,
            hold_distance=Action.HOLD_DISTANCE in actions,
            news=tuple(verdict for verdict in verdicts if self._is_news(verdict, now_s)),
        )

    def _verdict(self, row: Trigger, seen: Observations, now_s: float) -> Verdict | None:
        reason = row.check(seen, self._table)
        if reason is None:
            self._since_s.pop(row.name, None)
            return None
        stood_s = now_s - self._since_s.setdefault(row.name, now_s)
        reaction = getattr(self._table, row.name)
        if row.lasting:
            stood_s -= reaction.after_s
        if stood_s < -_ROUNDING_S:
            return None
        return Verdict(_action(escalated(reaction, stood_s), row.fault), reason, row.name)

    def _is_news(self, verdict: Verdict, now_s: float) -> bool:
        """Only what does not change the state: a change of state is an event of its own."""
        if verdict.action not in (Action.WARN, Action.SLOW, Action.HOLD_DISTANCE):
            return False
        action, t_s = self._told.get(verdict.trigger, (Action.NONE, 0.0))
        self._told[verdict.trigger] = (verdict.action, now_s)
        return action is not verdict.action or now_s - t_s > QUIET_S


def escalated(reaction: failsafe.Reaction | failsafe.Halting, stood_s: float) -> failsafe.Action:
    """The action that is due when the trigger's first one has been due for `stood_s`."""
    action, step = reaction.action, reaction.then
    while step is not None and stood_s >= step.after_s - _ROUNDING_S:
        stood_s -= step.after_s
        action, step = step.action, step.then
    return action


def _action(name: failsafe.Action, fault: bool) -> Action:
    return Action.FAULT_STOP if fault and name == "stop" else Action[name.upper()]


def _estop(seen: Observations) -> Verdict | None:
    if seen.estop_by is not None:
        return Verdict(Action.ESTOP, f"emergency stop by {seen.estop_by}")
    if seen.safety_node is not None and (cause := _pressed(seen.safety_node)):
        return Verdict(Action.ESTOP, f"emergency stop by the safety node: {cause}")
    return None


def _pressed(node: SafetyNodeSeen) -> str | None:
    if node.button:
        return "its button is pressed"
    return "it is latched" if node.latched else None
