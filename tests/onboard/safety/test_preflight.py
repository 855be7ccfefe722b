"""What keeps a robot from arming is named, with value, limit and the check to override."""

from dataclasses import replace
from typing import Any, get_args

import pytest

from config.fleet import Arming, CheckName, Robot
from config.loader import load_fleet, shipped_fleet_path
from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.safety.observations import DriveSeen, LeaderSeen, SafetyNodeSeen
from onboard.safety.preflight.checklist import CHECKS, not_ready, refused_overrides
from tests.onboard.safety.looks import IDLE, READY, TRIPPED


@pytest.fixture(name="robot", scope="module")
def _robot() -> Robot:
    robot = load_fleet(shipped_fleet_path("hardware")).fleet.robots["r2"]
    return robot.model_copy(update={"arming": Arming(require_realtime=True)})


def test_a_robot_in_order_is_ready(robot: Robot) -> None:
    assert not_ready(READY, robot) == []
    assert not_ready(replace(READY, leader=None), robot) == []


@pytest.mark.parametrize(
    ("change", "check", "reason"),
    [
        ({"bus_state": BusState.PASSIVE, "bus_reason": "alone"}, "bus", "CAN bus passive: alone"),
        (
            {"bus_load": 0.71},
            "bus_load",
            "CAN bus: load 71%, limit 70%: raise the bit rate (500000 bit/s) or lower the "
            "sensor's rate",
        ),
        (
            {"drive": DriveSeen(MotorState.OFFLINE, "no heartbeat yet", None, None)},
            "drives",
            "drive: drive is offline, no heartbeat yet",
        ),
        (
            {"steering": TRIPPED},
            "drives",
            "steering: errors DRV_FAULT; remove the cause, then reset",
        ),
        (
            {"drive": replace(IDLE, firmware="firmware 0.5.6, not 0.6")},
            "firmware",
            "drive: firmware 0.5.6, not 0.6",
        ),
        ({"drive": replace(IDLE, supply_v=20.0)}, "supply", "drive: supply 20.0 V, limit 21.0 V"),
        (
            {"steering": replace(IDLE, temperature_degc=75.0)},
            "supply",
            "steering: 75 degC, limit 70 degC",
        ),
        (
            {"safety_node": SafetyNodeSeen(0.1, button=False, latched=False, power=False)},
            "safety_node",
            "safety node: the motor supply is off",
        ),
        (
            {"safety_node": SafetyNodeSeen(0.5, button=False, latched=False, power=True)},
            "safety_node",
            "safety node: no status for 0.50 s, limit 0.35 s",
        ),
        (
            {"encoder_problem": "steering encoder: angle not referenced"},
            "steering_encoder",
            "steering encoder: angle not referenced",
        ),
        (
            {"steering_rad": -0.71},
            "steering_reference",
            "steering encoder: angle -0.710 rad, limit 0.700 rad: turn the fork back, or "
            "reference the encoder anew",
        ),
        ({"bearing_age_s": None}, "bearing_sensor", "bearing sensor: no usable bearing yet"),
        (
            {"bearing_rate_hz": 49.0},
            "sensor_rate",
            "bearing sensor: 49 looks per s, limit 50 (bearing_sensor.rate_hz is 100)",
        ),
        (
            {"leader": LeaderSeen("r1", 0.5, "STANDBY")},
            "leader",
            "leader r1: no message for 0.50 s, limit 0.20 s",
        ),
        (
            {"leader": LeaderSeen("r1", 0.01, "STANDBY", offset_s=-0.06)},
            "clock_offset",
            "clock: messages of r1 are -0.060 s old on arrival, limit 0.050 s: synchronise the "
            "wall clocks (chrony), look at the network",
        ),
        ({"free_disk_mb": 99.0}, "disk", "disk: 99 MB free for the black box, limit 100 MB"),
        (
            {"realtime": False},
            "realtime",
            "control loop: no real-time priority, 50 asked for (loop.realtime_priority): see "
            "docs/transport.md, permission for SCHED_FIFO",
        ),
    ],
)
def test_each_check_has_its_sentence(
    robot: Robot, change: dict[str, Any], check: str, reason: str
) -> None:
    (blocker,) = not_ready(replace(READY, **change), robot)
    assert blocker == (check, reason)
    assert str(blocker) == f"{reason} [check {check}]"


@pytest.mark.parametrize(
    "change",
    [
        {"bus_load": 0.7},
        {"steering_rad": 0.69},
        {"bearing_rate_hz": 50.0},
        {"bearing_rate_hz": None},
        {"leader": LeaderSeen("r1", 0.2, "STANDBY", offset_s=0.05)},
        {"free_disk_mb": 100.0},
        {"drive": replace(IDLE, supply_v=21.0, temperature_degc=70.0)},
    ],
)
def test_at_its_limit_a_check_passes(robot: Robot, change: dict[str, Any]) -> None:
    assert not_ready(replace(READY, **change), robot) == []


def test_without_being_required_real_time_priority_is_no_condition(robot: Robot) -> None:
    relaxed = robot.model_copy(update={"arming": Arming()})
    assert not_ready(replace(READY, realtime=False), relaxed) == []


def test_all_reasons_are_given_at_once_and_the_estimates_last(robot: Robot) -> None:
    seen = replace(READY, bus_state=BusState.LOST, steering=TRIPPED, bearing_age_s=None)
    found = [each.check for each in not_ready(seen, robot, ["range not settled"])]
    assert found == ["bus", "drives", "bearing_sensor", "estimate"]


def test_the_fleet_file_knows_every_check_by_name() -> None:
    assert [*CHECKS, "estimate"] == list(get_args(CheckName))


def test_only_what_the_fleet_file_allows_may_be_overridden(robot: Robot) -> None:
    allowed = robot.model_copy(update={"arming": Arming(allow_override=["disk", "realtime"])})
    assert refused_overrides(["disk"], allowed) is None
    assert refused_overrides([], robot) is None
    assert refused_overrides(["bus"], allowed) == (
        "check bus may not be overridden here (arming.allow_override: disk, realtime)"
    )
    assert "no check 'busload' to override" in str(refused_overrides(["busload"], allowed))
    assert "allow_override: none" in str(refused_overrides(["disk"], robot))
