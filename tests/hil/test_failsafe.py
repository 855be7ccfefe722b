"""The failsafe table on emulated hardware: what the fleet file says is what the robots do."""

from typing import Any

import pytest

from config.failsafe import Failsafe
from config.faults import Fault
from config.fleet import Arming, Fleet
from groundstation.lockstep import Lockstep
from tests.hil.clean import standing
from tests.hil.fleets import driving, powered_up, straight

DEMO = straight("demo", 60.0)


def with_rows(**rows: dict[str, Any]) -> Fleet:
    """The demo fleet with other rows in every robot's table."""
    table = Failsafe.model_validate(rows)
    robots = {
        name: robot.model_copy(update={"failsafe": table}) for name, robot in DEMO.robots.items()
    }
    return DEMO.model_copy(update={"robots": robots})


def with_arming(arming: Arming) -> Fleet:
    robots = {
        name: robot.model_copy(update={"arming": arming}) for name, robot in DEMO.robots.items()
    }
    return DEMO.model_copy(update={"robots": robots})


def distance_m(lockstep: Lockstep, one: str, other: str) -> float:
    a, b = (lockstep.simulation.robots[name].truth for name in (one, other))
    return float(((a.x_m - b.x_m) ** 2 + (a.y_m - b.y_m) ** 2) ** 0.5)


def test_a_warm_drive_slows_the_leader_down_and_its_followers_stay_in_place() -> None:
    with driving(with_rows(temperature_high={"limit_degc": 35.0, "then": None})) as lockstep:
        lockstep.simulation.inject(Fault(robot="r1", device="drive", kind="overheat", value=5.0))
        lockstep.run_for(5.0)
        speed_mps = lockstep.simulation.robots["r1"].truth.speed_mps
        assert speed_mps == pytest.approx(0.5, abs=0.03)
        assert {status.state for status in lockstep.statuses.values()} == {"RUNNING"}
        assert distance_m(lockstep, "r1", "r2") == pytest.approx(0.45, abs=0.05)


def test_a_follower_told_to_hold_distance_falls_back_to_twice_its_place() -> None:
    rows: dict[str, Any] = {"range_deviation": {"limit_fraction": 1e-4}}
    with driving(with_rows(**rows), for_s=10.0) as lockstep:
        assert distance_m(lockstep, "r1", "r2") == pytest.approx(0.9, abs=0.15)
        assert lockstep.statuses["r2"].state == "RUNNING"


def test_a_row_escalates_from_a_warning_to_a_stop() -> None:
    row = {
        "after_s": 0.2,
        "action": "warn",
        "then": {"after_s": 1.0, "action": "stop"},
    }
    with driving(with_rows(ground_lost=row)) as lockstep:
        lockstep.ground = False
        lockstep.run_for(1.1)
        assert lockstep.statuses["r1"].state == "RUNNING"
        assert lockstep.run_until(lambda: standing(lockstep, "r1"), 1.0)
        assert "ground station: no heartbeat" in lockstep.statuses["r1"].reason


def test_a_clock_that_steps_stops_its_robot_with_that_reason_first() -> None:
    with driving(with_rows()) as lockstep:
        lockstep.stations["r1"].clock_step_s = 5.0
        assert lockstep.run_until(lambda: standing(lockstep, "r1"), 1.0)
        assert lockstep.statuses["r1"].reason == "wall clock stepped by +5.000 s, limit 0.050 s"


def test_a_process_that_is_being_ended_ramps_down_and_ends() -> None:
    with driving(DEMO) as lockstep:
        station = lockstep.stations["r3"]
        station.ending = True
        assert lockstep.run_until(lambda: station.robot.finished, 2.0)
        assert standing(lockstep, "r3")
        assert lockstep.statuses["r3"].reason == "the onboard process is being stopped"


def test_a_lost_adapter_comes_back_but_motion_does_not_without_the_operator() -> None:
    with driving(DEMO, broken=["r2"]) as lockstep:
        fault = Fault(robot="r2", device="bus", kind="adapter_lost", for_s=1.0)
        lockstep.simulation.inject(fault)
        assert lockstep.run_until(lambda: standing(lockstep, "r2"), 1.5)
        lockstep.run_for(3.0)
        status = lockstep.statuses["r2"]
        assert (status.state, status.bus.state, status.bus.reopened) == ("FAULT", "active", 1)
        assert "CAN bus lost" in status.reason
        assert standing(lockstep, "r2")
        assert not lockstep.command("r2", "start").accepted
        assert lockstep.command("r2", "reset").accepted
        lockstep.run_for(1.0)
        assert lockstep.statuses["r2"].state == "STANDBY"


def test_a_check_is_overridden_only_where_the_fleet_file_allows_and_it_is_recorded() -> None:
    too_fast = Arming(min_sensor_rate_fraction=1.0, max_bus_load=0.05)
    recorded: list[bytes] = []
    with powered_up(with_arming(too_fast), 1) as lockstep:
        lockstep.run_for(3.0)
        reply = lockstep.command("r1", "arm", ["bus_load"])
        assert not reply.accepted
        assert "check bus_load may not be overridden here" in reply.reason
    allowed = too_fast.model_copy(update={"allow_override": ["bus_load", "sensor_rate"]})

    def record(key: str, body: bytes, _t_ns: int) -> None:
        if key.endswith("r1/event"):
            recorded.append(body)

    with powered_up(with_arming(allowed), 1, record) as lockstep:
        lockstep.run_for(3.0)
        reply = lockstep.command("r1", "arm")
        assert not reply.accepted
        assert "limit 5%" in reply.reason
        assert "[check bus_load]" in reply.reason
        assert lockstep.command("r1", "arm", ["bus_load", "sensor_rate"]).accepted
        assert lockstep.run_until(lambda: lockstep.statuses["r1"].state == "ARMED", 1.0)
        assert lockstep.command("r1", "start").accepted
        assert lockstep.command("r1", "stop").accepted
        lockstep.run_for(2.0)
        assert not lockstep.command("r1", "arm").accepted
    events = b"\n".join(recorded).decode()
    assert "check bus_load overridden by lockstep to arm: CAN bus: load" in events
