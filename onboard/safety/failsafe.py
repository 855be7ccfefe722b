"""From ages and health to the most severe action that they ask for, with its reason.

Limits come from the fleet file's `failsafe` section. The checks are for a robot whose drives are
powered, or about to be (ARMING to STOPPING); what keeps a robot from arming is in `preflight`.
"""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from config.fleet import Failsafe
from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.canbus.silence import silence
from onboard.safety.observations import DriveSeen, Observations
from onboard.safety.states import Event, State


class Action(IntEnum):
    """What to do, in order of severity. SILENT: the bus is gone, nothing can be sent."""

    NONE = 0
    CONTROLLED_STOP = 1
    FAULT_STOP = 2
    SILENT = 3
    ESTOP = 4


EVENT_OF: dict[Action, Event] = {
    Action.CONTROLLED_STOP: Event.CONTROLLED_STOP,
    Action.FAULT_STOP: Event.FAULT_STOP,
    Action.SILENT: Event.BUS_LOST,
    Action.ESTOP: Event.ESTOP,
}
"""The state machine's event for every action but NONE."""


class Verdict(NamedTuple):
    """An action and the observation behind it, naming value and limit."""

    action: Action
    reason: str


NOTHING = Verdict(Action.NONE, "")
_LEADER_STATES_TO_FOLLOW = (State.ARMING, State.ARMED, State.RUNNING, State.STOPPING)


def _estop(seen: Observations, _limits: Failsafe) -> Verdict:
    if seen.estop_by is None:
        return NOTHING
    return Verdict(Action.ESTOP, f"emergency stop by {seen.estop_by}")


def _bus(seen: Observations, _limits: Failsafe) -> Verdict:
    if seen.bus_state is BusState.ACTIVE:
        return NOTHING
    action = Action.CONTROLLED_STOP if seen.bus_state is BusState.PASSIVE else Action.SILENT
    return Verdict(action, f"CAN bus {seen.bus_state}: {seen.bus_reason}")


def _drive(seen: Observations, limits: Failsafe) -> Verdict:
    return _motor("drive", seen.drive, limits)


def _steering(seen: Observations, limits: Failsafe) -> Verdict:
    return _motor("steering", seen.steering, limits)


def _motor(name: str, motor: DriveSeen, limits: Failsafe) -> Verdict:
    problem = (
        _motor_fault(name, motor)
        or silence(name, "heartbeat", motor.heartbeat_age_s, limits.drive_heartbeat_timeout_s)
        or silence(name, "encoder estimate", motor.estimate_age_s, limits.encoder_timeout_s)
    )
    return Verdict(Action.FAULT_STOP, problem) if problem else NOTHING


def _motor_fault(name: str, motor: DriveSeen) -> str | None:
    if motor.state is MotorState.FAULT:
        return f"{name}: {motor.reason}"
    return (
        f"{name}: drive is offline, {motor.reason}" if motor.state is MotorState.OFFLINE else None
    )


def _encoder(seen: Observations, limits: Failsafe) -> Verdict:
    problem = seen.encoder_problem or silence(
        "steering encoder", "angle", seen.encoder_age_s, limits.encoder_timeout_s
    )
    return Verdict(Action.CONTROLLED_STOP, problem) if problem else NOTHING


def _leader_silent(seen: Observations, limits: Failsafe) -> Verdict:
    if seen.leader is None:
        return NOTHING
    name = f"leader {seen.leader.name}"
    problem = silence(name, "message", seen.leader.age_s, limits.leader_timeout_s)
    if problem is None and seen.leader.problem is not None:
        problem = f"{name} {seen.leader.problem}"
    return Verdict(Action.CONTROLLED_STOP, problem) if problem else NOTHING


def _leader_state(seen: Observations, _limits: Failsafe) -> Verdict:
    leader = seen.leader
    if leader is None or leader.state is None or seen.state is not State.RUNNING:
        return NOTHING
    if leader.state in _LEADER_STATES_TO_FOLLOW:
        return NOTHING
    return Verdict(Action.CONTROLLED_STOP, f"leader {leader.name} is in state {leader.state}")


def _bearings(seen: Observations, limits: Failsafe) -> Verdict:
    problem = seen.bearing_problem or silence(
        "bearing sensor", "usable bearing", seen.bearing_age_s, limits.bearing_timeout_s
    )
    return Verdict(Action.CONTROLLED_STOP, problem) if problem else NOTHING


def _estimate(seen: Observations, _limits: Failsafe) -> Verdict:
    problem = seen.estimate_problem
    return Verdict(Action.CONTROLLED_STOP, problem) if problem else NOTHING


def _loop(seen: Observations, limits: Failsafe) -> Verdict:
    if seen.loop_late_s <= limits.loop_late_s:
        return NOTHING
    return Verdict(
        Action.CONTROLLED_STOP,
        f"control loop {seen.loop_late_s:.3f} s late, limit {limits.loop_late_s:.3f} s",
    )


CHECKS: tuple[Callable[[Observations, Failsafe], Verdict], ...] = (
    _estop,
    _bus,
    _drive,
    _steering,
    _encoder,
    _leader_silent,
    _leader_state,
    _bearings,
    _estimate,
    _loop,
)


def evaluate(seen: Observations, limits: Failsafe) -> Verdict:
    """The most severe verdict; of equally severe ones, that of the first check."""
    worst = NOTHING
    for check in CHECKS:
        verdict = check(seen, limits)
        if verdict.action > worst.action:
            worst = verdict
    return worst
