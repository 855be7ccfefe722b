"""The failsafe table: each trigger has its action, its time and its sentence; rows escalate."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.failsafe import Failsafe, Reaction
from onboard.canbus.port import BusState
from onboard.safety.failsafe import EVENT_OF, Action, FailsafeTable, Judgement, escalated
from onboard.safety.observations import (
    EstimateSeen,
    LeaderSeen,
    Observations,
    Response,
    SafetyNodeSeen,
)
from onboard.safety.states import State
from onboard.safety.triggers import TRIGGERS
from tests.onboard.safety.looks import ACTIVE, EXPIRED, GOOD, TRIPPED

PERIOD_S = 0.01


def table(**rows: dict[str, Any]) -> Failsafe:
    return Failsafe.model_validate(rows)


ALL = table(ground_lost={"after_s": 0.5}, battery_low={"limit_v": 21.0})
WARN, SLOW, HOLD, STOP = Action.WARN, Action.SLOW, Action.HOLD_DISTANCE, Action.STOP
FAULT_STOP, IDLE = Action.FAULT_STOP, Action.IDLE


def judge(seen: Observations, limits: Failsafe = ALL, *, lasting_s: float = 0.0) -> Judgement:
    """What the table says after the look has been the same for so long."""
    failsafe = FailsafeTable(limits)
    for tick in range(round(lasting_s / PERIOD_S)):
        failsafe.judge(seen, tick * PERIOD_S, powered=True)
    return failsafe.judge(seen, round(lasting_s / PERIOD_S) * PERIOD_S, powered=True)


def first_action(limits: Failsafe, change: dict[str, Any], until_s: float) -> list[float]:
    """When, after the change, the worst action becomes another."""
    failsafe, seen = FailsafeTable(limits), replace(GOOD, **change)
    times, last = [], Action.NONE
    for tick in range(round(until_s / PERIOD_S) + 1):
        action = failsafe.judge(seen, tick * PERIOD_S, powered=True).worst.action
        if action is not last:
            times.append(round(tick * PERIOD_S, 3))
        last = action
    return times


def estimate(**problems: Any) -> dict[str, Any]:
    return {"estimate": replace(EstimateSeen(), **problems)}


ROWS: list[tuple[str, dict[str, Any], float, Action, str]] = [
    (
        "leader_stale",
        {"leader": LeaderSeen("r1", 0.21, "RUNNING")},
        0.0,
        STOP,
        "leader r1: no message for 0.21 s, limit 0.20 s",
    ),
    (
        "leader_stale",
        {"leader": LeaderSeen("r1", None, None)},
        0.0,
        STOP,
        "leader r1: no message yet",
    ),
    (
        "leader_unfit",
        {"leader": LeaderSeen("r1", 0.01, "FAULT")},
        0.0,
        STOP,
        "leader r1 is in state FAULT",
    ),
    (
        "leader_unfit",
        {"leader": LeaderSeen("r1", 0.01, "RUNNING", "does not know its own motion")},
        0.0,
        STOP,
        "leader r1 does not know its own motion",
    ),
    (
        "bearings_stale",
        {"bearing_age_s": 0.302},
        0.0,
        STOP,
        "bearing sensor: no usable bearing for 0.31 s, limit 0.30 s",
    ),
    (
        "bearings_repeat",
        {"bearings_repeat_s": 0.31},
        0.0,
        STOP,
        "bearing sensor: the very same bearings for 0.31 s, limit 0.30 s",
    ),
    ("bearing_sensor_lost", {"bearing_problem": "state FAULT"}, 0.0, STOP, "state FAULT"),
    (
        "mutual_bearing_lost",
        estimate(mutual_age_s=1.01),
        0.0,
        WARN,
        "leader r1: no bearing to this robot for 1.01 s, limit 1.00 s",
    ),
    ("distance_low", estimate(too_near="0.1 m, limit 0.2 m"), 0.0, STOP, "0.1 m, limit 0.2 m"),
    ("range_deviation", estimate(range_uncertain="range uncertain"), 0.0, HOLD, "range uncertain"),
    ("nis_alarm", estimate(nis="mean NIS 2.0, limit 1.5"), 0.0, STOP, "mean NIS 2.0, limit 1.5"),
    ("estimator_reset", estimate(lost="lost r1"), 0.0, STOP, "lost r1"),
    ("unobservable", estimate(unobservable="one landmark"), 0.0, STOP, "one landmark"),
    (
        "encoder_stale",
        {"encoder_age_s": 0.06},
        0.0,
        STOP,
        "steering encoder: no angle for 0.06 s, limit 0.05 s",
    ),
    ("encoder_error", {"encoder_problem": "magnet fault"}, 0.0, STOP, "magnet fault"),
    (
        "steering_disagreement",
        {"disagreement_rad": -0.16},
        0.0,
        STOP,
        "steering drive and encoder disagree by 0.160 rad, limit 0.150 rad",
    ),
    (
        "drive_response",
        {"speed_response": Response(1.3, 0.9, 1.0)},
        0.1,
        FAULT_STOP,
        "drive: the wheel turns at 1.30 m/s, asked for were 0.90 to 1.00 m/s, "
        "limit 0.20 m/s beyond",
    ),
    (
        "steering_response",
        {"steering_response": Response(-0.11, 0.0, 0.1)},
        0.1,
        STOP,
        "steering: the fork is at -0.110 rad, asked for were 0.000 to 0.100 rad, "
        "limit 0.100 rad beyond",
    ),
    (
        "drive_heartbeat_lost",
        {"drive": replace(ACTIVE, heartbeat_age_s=0.36)},
        0.0,
        FAULT_STOP,
        "drive: no heartbeat for 0.36 s, limit 0.35 s",
    ),
    (
        "drive_estimate_stale",
        {"steering": replace(ACTIVE, estimate_age_s=0.06)},
        0.0,
        FAULT_STOP,
        "steering: no encoder estimate for 0.06 s, limit 0.05 s",
    ),
    ("drive_error", {"drive": TRIPPED}, 0.0, FAULT_STOP, "drive: errors DRV_FAULT"),
    (
        "watchdog_trip",
        {"steering": EXPIRED},
        0.0,
        FAULT_STOP,
        "steering: errors WATCHDOG_TIMER_EXPIRED",
    ),
    (
        "bus_passive",
        {"bus_state": BusState.PASSIVE, "bus_reason": "nobody answers"},
        0.0,
        STOP,
        "CAN bus passive: nobody answers",
    ),
    (
        "bus_off",
        {"bus_state": BusState.LOST, "bus_reason": "Network is down"},
        0.0,
        IDLE,
        "CAN bus lost: Network is down",
    ),
    ("bus_off", {"bus_state": BusState.BUS_OFF}, 0.0, IDLE, "CAN bus bus-off: open"),
    (
        "send_queue_full",
        {"frames_dropped": 3},
        0.1,
        STOP,
        "CAN bus: 3 frames of one cycle could not be sent, queue full",
    ),
    (
        "loop_overrun",
        {"loop_late_s": 0.051},
        0.0,
        STOP,
        "control loop 0.051 s late, limit 0.050 s",
    ),
    (
        "clock_step",
        {"clock_step_s": -0.06},
        0.05,
        STOP,
        "wall clock stepped by -0.060 s, limit 0.050 s",
    ),
    (
        "ground_lost",
        {"ground_age_s": math.inf},
        0.0,
        STOP,
        "ground station: no heartbeat for inf s, limit 0.50 s",
    ),
    (
        "battery_low",
        {"drive": replace(ACTIVE, supply_v=20.9)},
        2.0,
        WARN,
        "drive: supply 20.9 V, limit 21.0 V",
    ),
    (
        "temperature_high",
        {"steering": replace(ACTIVE, temperature_degc=71.0)},
        1.0,
        SLOW,
        "steering: 71 degC, limit 70 degC",
    ),
    (
        "safety_node_lost",
        {"safety_node": SafetyNodeSeen(0.36, button=False, latched=False, power=True)},
        0.0,
        STOP,
        "safety node: no status for 0.36 s, limit 0.35 s",
    ),
    (
        "power_off",
        {"safety_node": SafetyNodeSeen(0.1, button=False, latched=False, power=False)},
        0.0,
        IDLE,
        "safety node: the motor supply is off",
    ),
    ("process_ending", {"ending": True}, 0.0, STOP, "the onboard process is being stopped"),
]


def test_nothing_happens_while_all_is_well() -> None:
    assert judge(GOOD).worst.action is Action.NONE


@pytest.mark.parametrize(("trigger", "change", "after_s", "action", "reason"), ROWS)
def test_each_trigger_has_its_action_its_time_and_its_sentence(
    trigger: str, change: dict[str, Any], after_s: float, action: Action, reason: str
) -> None:
    seen = replace(GOOD, **change)
    assert judge(seen, lasting_s=after_s).worst == (action, reason, trigger)
    if after_s:
        assert judge(seen, lasting_s=after_s - PERIOD_S).worst.action is Action.NONE


def test_every_row_of_the_fleet_files_section_is_a_trigger_and_is_tested() -> None:
    settings = {"slow_factor", "spacing_factor"}
    rows = [row.name for row in TRIGGERS]
    assert len(set(rows)) == len(rows)
    assert set(rows) == set(Failsafe.model_fields) - settings
    assert {trigger for trigger, *_ in ROWS} == set(rows)


@pytest.mark.parametrize(
    "change",
    [
        {"leader": LeaderSeen("r1", 0.2, "RUNNING")},
        {"bearing_age_s": 0.3},
        {"encoder_age_s": 0.05},
        {"drive": replace(ACTIVE, heartbeat_age_s=0.35, estimate_age_s=0.05)},
        {"drive": replace(ACTIVE, supply_v=21.0, temperature_degc=70.0)},
        {"loop_late_s": 0.05},
        {"clock_step_s": 0.05},
        {"ground_age_s": 0.5},
        {"disagreement_rad": 0.15},
        {"disagreement_rad": math.nan},
        {"speed_response": Response(1.2, 1.0, 1.0)},
        {"steering_response": Response(-0.1, 0.0, 0.1)},
        {"bearings_repeat_s": 0.3},
        estimate(mutual_age_s=1.0),
        {"safety_node": SafetyNodeSeen(0.35, button=False, latched=False, power=True)},
    ],
)
def test_at_its_limit_a_value_is_still_good(change: dict[str, Any]) -> None:
    assert judge(replace(GOOD, **change), lasting_s=5.0).worst.action is Action.NONE


def test_an_age_that_is_not_a_number_counts_as_too_old() -> None:
    assert judge(replace(GOOD, encoder_age_s=math.nan)).worst.action is STOP


def test_what_a_robot_does_not_have_cannot_fail() -> None:
    seen = replace(GOOD, leader=None, estimate=EstimateSeen(), ground_age_s=math.inf)
    assert judge(seen, Failsafe(), lasting_s=5.0).worst.action is Action.NONE


@pytest.mark.parametrize("own", [State.ARMING, State.ARMED])
def test_before_the_start_a_leader_may_still_be_in_standby(own: State) -> None:
    seen = replace(GOOD, state=own, leader=LeaderSeen("r1", 0.01, "STANDBY"))
    assert judge(seen).worst.action is Action.NONE
    assert judge(replace(seen, state=State.RUNNING)).worst.action is STOP


@given(limit_s=st.floats(0.05, 2.0), excess_s=st.floats(1e-3, 1.0))
def test_the_fleet_file_sets_the_limit(limit_s: float, excess_s: float) -> None:
    limits = table(leader_stale={"after_s": limit_s})
    inside = replace(GOOD, leader=LeaderSeen("r1", limit_s, "RUNNING"))
    outside = replace(GOOD, leader=LeaderSeen("r1", limit_s + excess_s, "RUNNING"))
    assert judge(inside, limits).worst.action is Action.NONE
    assert judge(outside, limits).worst.action is STOP


@pytest.mark.parametrize(
    ("name", "action"),
    [
        ("warn", WARN),
        ("slow", SLOW),
        ("hold_distance", HOLD),
        ("stop", STOP),
        ("idle", IDLE),
        ("estop", Action.ESTOP),
    ],
)
def test_the_fleet_file_sets_the_action(name: str, action: Action) -> None:
    judged = judge(replace(GOOD, bearing_age_s=1.0), table(bearings_stale={"action": name}))
    assert judged.worst.action is action
    assert judged.slow == (action is SLOW)
    assert judged.hold_distance == (action is HOLD)


def test_a_row_escalates_step_by_step() -> None:
    limits = table(
        bearing_sensor_lost={
            "after_s": 0.1,
            "action": "warn",
            "then": {
                "after_s": 0.2,
                "action": "hold_distance",
                "then": {"after_s": 0.5, "action": "stop"},
            },
        }
    )
    change = {"bearing_problem": "blind"}
    assert first_action(limits, change, 1.0) == [0.1, 0.3, 0.8]


def test_a_silences_escalation_counts_from_its_limit() -> None:
    limits = table(leader_stale={"action": "slow", "then": {"after_s": 0.3, "action": "stop"}})
    change = {"leader": LeaderSeen("r1", 0.25, "RUNNING")}
    assert first_action(limits, change, 1.0) == [0.0, 0.3]


def test_a_condition_that_goes_away_begins_anew() -> None:
    failsafe = FailsafeTable(ALL)
    bad = replace(GOOD, frames_dropped=1)
    assert failsafe.judge(bad, 0.0, powered=True).worst.action is Action.NONE
    assert failsafe.judge(bad, 0.09, powered=True).worst.action is Action.NONE
    failsafe.judge(GOOD, 0.1, powered=True)
    assert failsafe.judge(bad, 0.11, powered=True).worst.action is Action.NONE
    assert failsafe.judge(bad, 0.22, powered=True).worst.action is STOP


@given(st.floats(0.0, 10.0))
def test_a_row_without_escalation_keeps_its_action(stood_s: float) -> None:
    assert escalated(Reaction(after_s=0.0, action="slow"), stood_s) == "slow"


def test_the_most_severe_of_several_wins_and_the_restraints_add_up() -> None:
    seen = replace(GOOD, **estimate(range_uncertain="uncertain", mutual_age_s=5.0))
    judged = judge(seen)
    assert (judged.worst.action, judged.slow, judged.hold_distance) == (HOLD, False, True)
    hot = replace(ACTIVE, temperature_degc=90.0)
    judged = judge(replace(seen, drive=hot), lasting_s=1.0)
    assert (judged.slow, judged.hold_distance) == (True, True)
    seen = replace(seen, encoder_age_s=1.0)
    assert judge(seen).worst.action is STOP
    seen = replace(seen, drive=TRIPPED)
    assert judge(seen).worst.action is FAULT_STOP
    seen = replace(seen, bus_state=BusState.LOST)
    assert judge(seen).worst.action is IDLE
    assert judge(replace(seen, estop_by="anna")).worst == (
        Action.ESTOP,
        "emergency stop by anna",
        "",
    )


def test_every_action_that_changes_the_state_has_an_event() -> None:
    assert set(EVENT_OF) == {action for action in Action if action >= STOP}


def test_of_equally_severe_ones_the_cause_speaks_before_the_consequence() -> None:
    seen = replace(GOOD, drive=EXPIRED, steering=replace(TRIPPED, heartbeat_age_s=1.0))
    assert judge(seen).worst.trigger == "drive_heartbeat_lost"
    seen = replace(GOOD, drive=EXPIRED, steering=TRIPPED)
    assert judge(seen).worst.trigger == "watchdog_trip"


@pytest.mark.parametrize(
    ("node", "reason"),
    [
        ((0.1, True, False, True), "its button is pressed"),
        ((0.1, False, True, True), "it is latched"),
    ],
)
def test_the_safety_nodes_button_is_an_emergency_stop_even_without_power(
    node: tuple[float, bool, bool, bool], reason: str
) -> None:
    seen = replace(GOOD, safety_node=SafetyNodeSeen(*node))
    for powered in (True, False):
        worst = FailsafeTable(ALL).judge(seen, 0.0, powered=powered).worst
        assert worst == (Action.ESTOP, f"emergency stop by the safety node: {reason}", "")


def test_without_power_only_the_emergency_stop_counts() -> None:
    failsafe = FailsafeTable(ALL)
    assert failsafe.judge(replace(GOOD, drive=TRIPPED), 0.0, powered=False).worst.action is (
        Action.NONE
    )
    worst = failsafe.judge(replace(GOOD, estop_by="anna"), 0.0, powered=False).worst
    assert worst.action is Action.ESTOP


def test_a_warning_is_told_once_and_again_after_a_pause() -> None:
    failsafe = FailsafeTable(ALL)
    bad = replace(GOOD, **estimate(range_uncertain="uncertain"))

    def told(seen: Observations, now_s: float) -> list[str]:
        return [each.trigger for each in failsafe.judge(seen, now_s, powered=True).news]

    assert told(bad, 0.0) == ["range_deviation"]
    assert told(bad, 0.01) == []
    told(GOOD, 0.02)
    assert told(bad, 0.5) == []
    told(GOOD, 0.51)
    assert told(bad, 2.0) == ["range_deviation"]
