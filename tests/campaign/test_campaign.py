"""A small part of the fault campaign, and that its rows are complete.

The runs are those that broke a bar before the safety code noticed what they break.
"""

import msgspec
import pytest

from config.failsafe import Failsafe
from config.faults import DEVICES, kinds_of
from onboard.safety.triggers import TRIGGERS
from tests.campaign import double, single
from tests.campaign.expectations import EXPECTED, Row, expected
from tests.campaign.reasons import trigger_of
from tests.campaign.scenario import Phase, Role
from tests.campaign.verdict import judge
from tests.campaign.witness import Fate, Outcome

SAMPLED = [
    (Role.FOLLOWER, Phase.STRAIGHT, ["drive/jammed", "drive/wrong", "bearing/garbage", "bus/loss"]),
    (Role.LEADER, Phase.TURNING, ["encoder/stuck", "bearing/stuck", "drive/mute", "bus/unplugged"]),
]


@pytest.mark.parametrize(("role", "phase", "faults"), SAMPLED)
def test_what_breaks_stops_the_robot_in_time_with_its_reason(
    role: Role, phase: Phase, faults: list[str]
) -> None:
    cases = [case for case in single.matrix() if case[:2] == (role, phase)]
    chosen = {case.key: case for case in cases if f"{case.device}/{case.kind}" in faults}
    assert len(chosen) == len(faults)
    for key, body in single.run(chosen.values(), seed=1, at_once=1):
        outcome = msgspec.json.decode(body, type=Outcome)
        assert single.verdict_of(chosen[key], outcome).problems == [], key


def test_every_fault_of_every_device_has_a_row_and_every_row_a_known_trigger() -> None:
    assert {device: set(rows) for device, rows in EXPECTED.items()} == {
        device: set(kinds_of(device)) for device in DEVICES
    }
    names = {row.name for row in TRIGGERS}
    for case in single.matrix():
        row = expected(*case)
        assert set(row.triggers) <= names
        assert row.triggers or row.may_drive


ROW = Row(("encoder_stale",), 0.01)
GOOD = Fate("STANDBY", "steering encoder: no angle for 0.06 s, limit 0.05 s", 0.05, None, 0.3)
AHEAD, BEHIND = Fate("RUNNING", moved_s=1.0), Fate("STANDBY", "r2 stopped: ...", 0.3, None, 0.4)


def problems(fate: Fate, nearest_m: float = 0.4, row: Row = ROW, behind: Fate = BEHIND) -> str:
    outcome = Outcome(nearest_m, 0.0, 1.0, {"r1": AHEAD, "r2": fate, "r3": behind})
    verdict = judge(outcome, row, Phase.STRAIGHT, "encoder", Failsafe(), ["r2", "r3"])
    return "; ".join(verdict.problems)


def test_the_judge_passes_a_run_that_is_as_its_row_demands() -> None:
    assert problems(GOOD) == ""


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({"moved_s": 1.09}, "r2 moves 1.01 s after the stop was due"),
        ({"state": "FAULT"}, "ends in FAULT, not STANDBY"),
        ({"reason": "bearings fit worse than"}, "first reason is: bearings fit worse"),
        ({"gave_up_s": 0.09}, "stops after 0.09 s, due after 0.08 s"),
        ({"state": "RUNNING", "reason": "", "gave_up_s": None}, "does not stop"),
    ],
)
def test_the_judge_finds_what_is_not(changed: dict[str, object], found: str) -> None:
    assert found in problems(msgspec.structs.replace(GOOD, **changed))


def test_the_judge_finds_a_collision_and_a_robot_behind_that_drives_on() -> None:
    assert "collision: 0.14 m" in problems(GOOD, nearest_m=0.14)
    assert "r3 moves" in problems(GOOD, behind=msgspec.structs.replace(BEHIND, moved_s=1.2))
    assert "r3 ends in FAULT" in problems(
        GOOD, behind=msgspec.structs.replace(BEHIND, state="FAULT")
    )


def test_reasons_are_told_apart() -> None:
    assert trigger_of("drive: no heartbeat for 0.36 s, limit 0.35 s") == "drive_heartbeat_lost"
    assert trigger_of("steering: state IDLE, errors WATCHDOG_TIMER_EXPIRED") == "watchdog_trip"
    assert trigger_of("refuses to start: CAN bus: load 90% [check bus_load]") == "check bus_load"
    assert trigger_of("something else") == "something else"


def test_a_seed_stands_for_the_same_pair_of_faults_again() -> None:
    assert double.drawn(17) == double.drawn(17) != double.drawn(17 + len(double.BLOCKS))
    assert {pair.role for pair in double.pairs(range(1, 20))} == set(Role)
