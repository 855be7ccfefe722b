"""Was a run as its row demands? Collisions and standstill by truth, states and reasons as told."""

from typing import NamedTuple

import msgspec

from config.failsafe import Failsafe
from onboard.safety.failsafe import Action, escalated
from tests.campaign.expectations import SLACK_S, Row, Shows
from tests.campaign.reasons import ROWS, trigger_of
from tests.campaign.scenario import Phase
from tests.campaign.witness import Fate, Outcome

COLLISION_M = 0.15
STANDSTILL_S = 1.0
GIVEN_UP = "stop by lockstep"
"""What a robot says that the operator has stopped."""
OFF_PLACE_M = 0.3
"""A follower that may drive on stays that near to its place."""

_OF_A_DRIVE = ("drive_heartbeat_lost", "drive_estimate_stale", "drive_error")


class Verdict(NamedTuple):
    """`trigger` is the first reason's, `due_s` when the stop was due at the latest."""

    trigger: str
    due_s: float | None
    problems: list[str]


def judge(
    outcome: Outcome, row: Row, phase: Phase, device: str, table: Failsafe, chain: list[str]
) -> Verdict:
    """One run; `chain` is the faulty robot and all behind it."""
    fate = _speaker(outcome, chain[0])
    trigger = trigger_of(fate.reason) if fate.reason else ""
    problems = []
    if outcome.min_distance_m < COLLISION_M:
        problems.append(f"collision: {outcome.min_distance_m:.2f} m")
    if fate.state == "RUNNING" and row.may_drive:
        if phase is not Phase.ARMING and outcome.off_place_m > OFF_PLACE_M:
            problems.append(f"drives on {outcome.off_place_m:.2f} m off its place")
        return Verdict("", None, problems + _others(outcome, chain[:0], phase))
    due_s = _due_s(row, fate, table)
    problems += [
        *_first_reason(trigger, fate, row, device, due_s),
        *_end(trigger, fate, row, table),
    ]
    problems += _still_moving(outcome, chain, due_s)
    problems += _others(outcome, chain, phase)
    return Verdict(trigger, due_s, problems)


def _speaker(outcome: Outcome, name: str) -> Fate:
    """Whose reason counts: where the operator gave up for another robot's sake, that one's."""
    fate = outcome.robots[name]
    if fate.reason != GIVEN_UP:
        return fate
    told = [f for f in outcome.robots.values() if f.reason and f.reason != GIVEN_UP]
    first = min(told, key=lambda each: each.gave_up_s or 0.0, default=fate)
    return msgspec.structs.replace(fate, reason=first.reason)


def _due_s(row: Row, fate: Fate, table: Failsafe) -> float:
    """The latest of the row's triggers; where it may drive on, the stop is due when it begins."""
    if row.may_drive and fate.gave_up_s is not None:
        return fate.gave_up_s
    began_s = 0.0
    if row.shows is not Shows.AT_ONCE and fate.started_s is not None:
        began_s = fate.started_s
    return began_s + due_after_s(row, table)


def due_after_s(row: Row, table: Failsafe) -> float:
    """From the moment in which a fault can be noticed until the stop is due, at the latest."""
    lasts_s = max((getattr(table, name).after_s for name in row.triggers), default=0.0)
    return row.latency_s + lasts_s + SLACK_S


def _first_reason(trigger: str, fate: Fate, row: Row, device: str, due_s: float) -> list[str]:
    if not fate.reason or fate.gave_up_s is None:
        return ["does not stop"]
    problems = []
    if trigger not in row.triggers:
        problems.append(f"first reason is: {fate.reason}")
    elif _blames_another(trigger, device, fate.reason):
        problems.append(f"blames another device: {fate.reason}")
    if fate.gave_up_s > due_s:
        problems.append(f"stops after {fate.gave_up_s:.2f} s, due after {due_s:.2f} s")
    return problems


def _blames_another(trigger: str, device: str, reason: str) -> bool:
    return trigger in _OF_A_DRIVE and device != "bus" and not reason.startswith(f"{device}: ")


def _end(trigger: str, fate: Fate, row: Row, table: Failsafe) -> list[str]:
    ends = row.ends or (end_state(trigger, table),)
    return [] if fate.state in ends else [f"ends in {fate.state}, not {' or '.join(ends)}"]


def end_state(trigger: str, table: Failsafe) -> str:
    """Where the failsafe table's action for a trigger ends."""
    if trigger not in ROWS:
        return "STANDBY"
    action = Action[escalated(getattr(table, trigger), 0.0).upper()]
    if action is Action.ESTOP:
        return "ESTOP"
    return "FAULT" if action is Action.IDLE or ROWS[trigger].fault else "STANDBY"


def _still_moving(outcome: Outcome, chain: list[str], due_s: float) -> list[str]:
    problems = []
    for name in chain:
        moved_s = outcome.robots[name].moved_s
        if moved_s is not None and moved_s > due_s + STANDSTILL_S:
            problems.append(f"{name} moves {moved_s - due_s:.2f} s after the stop was due")
    return problems


def _others(outcome: Outcome, chain: list[str], phase: Phase) -> list[str]:
    """Those behind stop without a fault of their own, those ahead drive on."""
    problems = []
    for name, fate in outcome.robots.items():
        if name in chain[:1]:
            continue
        wanted = {"STANDBY"} if name in chain else {"RUNNING"}
        if phase is Phase.ARMING:
            wanted |= {"STANDBY"}
        if chain and fate.state not in wanted:
            problems.append(f"{name} ends in {fate.state}: {fate.reason}")
        if not chain and fate.state in ("FAULT", "ESTOP"):
            problems.append(f"{name} ends in {fate.state}: {fate.reason}")
    return problems
