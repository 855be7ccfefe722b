"""Failsafe and checks before arming: each silence and complaint has its action and sentence."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.fleet import Failsafe
from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.safety.failsafe import EVENT_OF, Action, evaluate
from onboard.safety.observations import DriveSeen, LeaderSeen, Observations
from onboard.safety.preflight.checklist import CHECKS, not_ready
from onboard.safety.states import State

LIMITS = Failsafe()
ACTIVE = DriveSeen(MotorState.ACTIVE, "in closed-loop control", 0.1, 0.01)
IDLE = replace(ACTIVE, state=MotorState.IDLE, reason="idle")
TRIPPED = replace(ACTIVE, state=MotorState.FAULT, reason="errors WATCHDOG_TIMER_EXPIRED")
GOOD = Observations(
    state=State.RUNNING,
    leader=LeaderSeen("r1", 0.01, "RUNNING"),
    bearing_age_s=0.02,
    bearing_problem=None,
    estimate_problem=None,
    drive=ACTIVE,
    steering=ACTIVE,
    encoder_age_s=0.01,
    encoder_problem=None,
    bus_state=BusState.ACTIVE,
    bus_reason="open",
    loop_late_s=0.0,
    estop_by=None,
)
READY = replace(GOOD, state=State.STANDBY, drive=IDLE, steering=IDLE)


def test_nothing_happens_while_all_is_well() -> None:
    assert evaluate(GOOD, LIMITS).action is Action.NONE


@pytest.mark.parametrize(
    ("change", "action", "reason"),
    [
        (
            {"leader": LeaderSeen("r1", 0.21, "RUNNING")},
            Action.CONTROLLED_STOP,
            "leader r1: no message for 0.21 s, limit 0.20 s",
        ),
        (
            {"leader": LeaderSeen("r1", None, None)},
            Action.CONTROLLED_STOP,
            "leader r1: no message yet",
        ),
        (
            {"leader": LeaderSeen("r1", 0.01, "FAULT")},
            Action.CONTROLLED_STOP,
            "leader r1 is in state FAULT",
        ),
        (
            {"bearing_age_s": 0.302},
            Action.CONTROLLED_STOP,
            "bearing sensor: no usable bearing for 0.31 s, limit 0.30 s",
        ),
        (
            {"bearing_problem": "bearing sensor: state FAULT"},
            Action.CONTROLLED_STOP,
            "bearing sensor: state FAULT",
        ),
        (
            {"encoder_age_s": 0.06},
            Action.CONTROLLED_STOP,
            "steering encoder: no angle for 0.06 s, limit 0.05 s",
        ),
        (
            {"encoder_problem": "steering encoder: magnet fault"},
            Action.CONTROLLED_STOP,
            "steering encoder: magnet fault",
        ),
        ({"drive": TRIPPED}, Action.FAULT_STOP, "drive: errors WATCHDOG_TIMER_EXPIRED"),
        ({"steering": TRIPPED}, Action.FAULT_STOP, "steering: errors WATCHDOG_TIMER_EXPIRED"),
        (
            {"drive": replace(ACTIVE, heartbeat_age_s=0.36)},
            Action.FAULT_STOP,
            "drive: no heartbeat for 0.36 s, limit 0.35 s",
        ),
        (
            {"steering": replace(ACTIVE, estimate_age_s=0.06)},
            Action.FAULT_STOP,
            "steering: no encoder estimate for 0.06 s, limit 0.05 s",
        ),
        (
            {"loop_late_s": 0.051},
            Action.CONTROLLED_STOP,
            "control loop 0.051 s late, limit 0.050 s",
        ),
        (
            {"bus_state": BusState.PASSIVE, "bus_reason": "nobody answers"},
            Action.CONTROLLED_STOP,
            "CAN bus passive: nobody answers",
        ),
        (
            {"bus_state": BusState.LOST, "bus_reason": "Network is down"},
            Action.SILENT,
            "CAN bus lost: Network is down",
        ),
        ({"bus_state": BusState.BUS_OFF}, Action.SILENT, "CAN bus bus-off: open"),
        ({"estop_by": "anna"}, Action.ESTOP, "emergency stop by anna"),
    ],
)
def test_each_trigger_has_its_action_and_its_sentence(
    change: dict[str, Any], action: Action, reason: str
) -> None:
    assert evaluate(replace(GOOD, **change), LIMITS) == (action, reason)


@pytest.mark.parametrize(
    "change",
    [
        {"leader": LeaderSeen("r1", 0.2, "RUNNING")},
        {"bearing_age_s": 0.3},
        {"encoder_age_s": 0.05},
        {"drive": replace(ACTIVE, heartbeat_age_s=0.35, estimate_age_s=0.05)},
        {"loop_late_s": 0.05},
    ],
)
def test_at_its_limit_a_value_is_still_good(change: dict[str, Any]) -> None:
    assert evaluate(replace(GOOD, **change), LIMITS).action is Action.NONE


def test_an_age_that_is_not_a_number_counts_as_too_old() -> None:
    assert evaluate(replace(GOOD, encoder_age_s=math.nan), LIMITS).action is not Action.NONE


def test_a_robot_without_a_leader_needs_none() -> None:
    assert evaluate(replace(GOOD, leader=None), LIMITS).action is Action.NONE
    assert not_ready(replace(READY, leader=None), LIMITS) == []


@pytest.mark.parametrize("own", [State.ARMING, State.ARMED])
def test_before_the_start_a_leader_may_still_be_in_standby(own: State) -> None:
    seen = replace(GOOD, state=own, leader=LeaderSeen("r1", 0.01, "STANDBY"))
    assert evaluate(seen, LIMITS).action is Action.NONE
    assert evaluate(replace(seen, state=State.RUNNING), LIMITS).action is Action.CONTROLLED_STOP


@given(limit_s=st.floats(0.05, 2.0), excess_s=st.floats(1e-3, 1.0))
def test_the_fleet_file_sets_the_limit(limit_s: float, excess_s: float) -> None:
    limits = Failsafe(leader_timeout_s=limit_s)
    inside = replace(GOOD, leader=LeaderSeen("r1", limit_s, "RUNNING"))
    outside = replace(GOOD, leader=LeaderSeen("r1", limit_s + excess_s, "RUNNING"))
    assert evaluate(inside, limits).action is Action.NONE
    assert evaluate(outside, limits).action is Action.CONTROLLED_STOP


def test_the_most_severe_of_several_wins() -> None:
    seen = replace(GOOD, encoder_age_s=1.0)
    assert evaluate(seen, LIMITS).action is Action.CONTROLLED_STOP
    seen = replace(seen, drive=TRIPPED)
    assert evaluate(seen, LIMITS).action is Action.FAULT_STOP
    seen = replace(seen, bus_state=BusState.LOST)
    assert evaluate(seen, LIMITS).action is Action.SILENT
    seen = replace(seen, estop_by="anna")
    assert evaluate(seen, LIMITS).action is Action.ESTOP


def test_every_action_has_an_event() -> None:
    assert set(EVENT_OF) == set(Action) - {Action.NONE}


def test_a_robot_in_order_is_ready() -> None:
    assert not_ready(READY, LIMITS) == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"bus_state": BusState.PASSIVE, "bus_reason": "alone"}, "CAN bus passive: alone"),
        (
            {"drive": DriveSeen(MotorState.OFFLINE, "no heartbeat yet", None, None)},
            "drive: drive is offline, no heartbeat yet",
        ),
        (
            {"steering": TRIPPED},
            "steering: errors WATCHDOG_TIMER_EXPIRED; remove the cause, then reset",
        ),
        (
            {"encoder_problem": "steering encoder: angle not referenced"},
            "steering encoder: angle not referenced",
        ),
        ({"bearing_age_s": None}, "bearing sensor: no usable bearing yet"),
        (
            {"leader": LeaderSeen("r1", 0.5, "STANDBY")},
            "leader r1: no message for 0.50 s, limit 0.20 s",
        ),
    ],
)
def test_what_keeps_a_robot_from_arming_is_named(change: dict[str, Any], reason: str) -> None:
    assert not_ready(replace(READY, **change), LIMITS) == [reason]


def test_all_reasons_are_given_at_once() -> None:
    nothing = DriveSeen(MotorState.OFFLINE, "no heartbeat yet", None, None)
    seen = replace(
        READY,
        bus_state=BusState.LOST,
        drive=nothing,
        steering=nothing,
        encoder_age_s=None,
        bearing_age_s=None,
        leader=LeaderSeen("r1", None, None),
    )
    assert len(not_ready(seen, LIMITS)) == len(CHECKS)


def test_of_equally_severe_ones_the_first_check_speaks() -> None:
    seen = replace(GOOD, drive=TRIPPED, steering=replace(TRIPPED, reason="second"))
    assert evaluate(seen, LIMITS).reason == "drive: errors WATCHDOG_TIMER_EXPIRED"
