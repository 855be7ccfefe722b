"""Whatever breaks, the robots stop by themselves and say why; the operator can always stop them.

Every test drives the demo fleet on a straight and breaks one thing. Standstill is judged on truth.
"""

import pytest

from config.can.odrive import AxisError
from config.faults import Fault
from groundstation.lockstep import AT_REST
from onboard.estimate import relative_ukf
from onboard.estimate.relative_model import Lower
from tests.hil.clean import standing
from tests.hil.fleets import driving, powered_up, shipped, straight

DEMO = straight("demo", 60.0)
FOLLOWERS = ("r2", "r3")


def test_a_killed_leader_stops_every_follower_within_a_second() -> None:
    with driving(DEMO, broken=["r1"]) as lockstep:
        lockstep.stations["r1"].running = False
        assert lockstep.run_until(lambda: all(standing(lockstep, n) for n in FOLLOWERS), 1.0)
        assert lockstep.run_until(lambda: lockstep.at_rest, 1.0)
        assert "leader r1: no message for 0.2" in lockstep.statuses["r2"].reason
        assert "r2 stopped: leader r1: no message" in lockstep.statuses["r3"].reason


def test_the_drives_own_watchdog_stops_a_robot_whose_process_is_killed() -> None:
    with driving(DEMO, broken=["r1"]) as lockstep:
        lockstep.stations["r1"].running = False
        assert lockstep.run_until(lambda: standing(lockstep, "r1"), 1.5)
        assert lockstep.simulation.robots["r1"].drive.axis.active_errors & (
            AxisError.WATCHDOG_TIMER_EXPIRED
        )


def test_an_encoder_that_contradicts_the_steering_drive_stops_the_robot() -> None:
    with driving(DEMO, broken=["r2"]) as lockstep:
        lockstep.simulation.inject(Fault(robot="r2", device="encoder", kind="wrong", value=0.3))
        assert lockstep.run_until(lambda: standing(lockstep, "r2"), 1.5)
        assert "steering drive and encoder disagree" in lockstep.statuses["r2"].reason


@pytest.mark.parametrize(
    ("device", "kind", "reason", "state"),
    [
        ("bearing", "off", "bearing", "STANDBY"),
        ("encoder", "off", "steering encoder: no angle for", "STANDBY"),
        ("drive", "undervolt", "DC_BUS_UNDER_VOLTAGE", "FAULT"),
        ("drive", "disarm", "drive: left closed-loop control", "FAULT"),
        ("steering", "mute", "steering: no", "FAULT"),
        ("drive", "restart", "drive: no", "FAULT"),
        ("drive", "nan", "encoder estimate not finite", "FAULT"),
        ("steering", "nan", "encoder estimate not finite", "FAULT"),
    ],
)
def test_a_broken_device_stops_its_robot_and_those_behind(
    device: str, kind: str, reason: str, state: str
) -> None:
    with driving(DEMO, broken=["r2"]) as lockstep:
        lockstep.simulation.inject(Fault(robot="r2", device=device, kind=kind))
        assert lockstep.run_until(lambda: all(standing(lockstep, n) for n in FOLLOWERS), 2.5)
        assert lockstep.run_until(
            lambda: all(lockstep.statuses[n].state in AT_REST for n in FOLLOWERS), 3.0
        )
        assert lockstep.statuses["r2"].state == state
        assert reason in lockstep.statuses["r2"].reason
        assert "r2" in lockstep.statuses["r3"].reason


def test_a_lost_bus_is_a_fault_and_the_watchdog_does_the_stopping() -> None:
    with driving(DEMO, broken=["r2"]) as lockstep:
        lockstep.stations["r2"].host_bus.shutdown()
        assert lockstep.run_until(lambda: standing(lockstep, "r2"), 1.5)
        assert lockstep.statuses["r2"].state == "FAULT"
        assert "CAN bus lost: receiving failed" in lockstep.statuses["r2"].reason
        assert lockstep.run_until(lambda: standing(lockstep, "r3"), 1.0)


def test_a_late_loop_stops_the_robot() -> None:
    with driving(DEMO) as lockstep:
        lockstep.stations["r2"].late_s = 0.2
        lockstep.tick()
        lockstep.stations["r2"].late_s = 0.0
        assert lockstep.run_until(lambda: standing(lockstep, "r2"), 1.0)
        assert "control loop 0.200 s late" in lockstep.statuses["r2"].reason


def test_an_emergency_stop_is_on_the_bus_within_one_cycle_and_is_latched() -> None:
    with driving(DEMO, broken=["r1", "r2", "r3"]) as lockstep:
        lockstep.estop()
        lockstep.tick()
        lockstep.tick()
        for simulated in lockstep.simulation.robots.values():
            assert simulated.drive.axis.active_errors & AxisError.ESTOP_REQUESTED
        assert lockstep.run_until(
            lambda: all(standing(lockstep, name) for name in lockstep.stations), 1.5
        )
        lockstep.run_for(1.0)
        for name, status in lockstep.statuses.items():
            assert status.state == "ESTOP"
            assert "emergency stop by lockstep" in status.reason
            for command in ("arm", "start", "stop"):
                assert not lockstep.command(name, command).accepted


def test_a_reset_after_an_emergency_stop_lets_the_fleet_drive_again() -> None:
    with driving(DEMO) as lockstep:
        lockstep.estop()
        lockstep.run_for(0.2)
        reply = lockstep.command("r1", "reset")
        assert not reply.accepted
        assert "still being sent" in reply.reason
        lockstep.run_for(2.0)
        assert all(lockstep.command(name, "reset").accepted for name in lockstep.stations)
        lockstep.start_mission()
        lockstep.run_for(1.0)
        assert not standing(lockstep, "r3")


def test_the_operator_can_stop_the_whole_chain_by_stopping_its_head() -> None:
    with driving(DEMO) as lockstep:
        assert lockstep.command("r1", "stop").accepted
        assert lockstep.run_until(lambda: lockstep.at_rest, 2.0)
        assert lockstep.statuses["r1"].reason == "stop by lockstep"
        assert lockstep.statuses["r3"].reason == "r2 stopped: r1 stopped: stop by lockstep"


def test_a_healthy_run_blocks_and_loses_no_frame() -> None:
    with driving(DEMO, for_s=5.0) as lockstep:
        for status in lockstep.statuses.values():
            assert status.blocked_frames == 0
            assert status.bus.send_failures == 0
            assert status.bus.error_frames == 0
            assert status.state == "RUNNING"


def test_a_robot_is_not_armed_before_its_checks_pass() -> None:
    with powered_up(shipped("demo"), 1) as lockstep:
        lockstep.simulation.inject(Fault(robot="r2", device="bearing", kind="off"))
        lockstep.run_for(1.0)
        reply = lockstep.command("r2", "arm")
        assert not reply.accepted
        assert "bearing sensor" in reply.reason
        assert not lockstep.command("r1", "start").accepted


def test_a_leader_that_is_carried_back_is_told_so_and_drives_again() -> None:
    """Carried away it is lost, cannot arm, and says what to do; at its start it can be told so."""
    with powered_up(DEMO) as lockstep:
        statuses = lockstep.statuses
        assert lockstep.run_until(lambda: len(statuses) == 3 and statuses["r1"].ready, 5.0)
        vehicle = lockstep.simulation.robots["r1"].vehicle
        start = (vehicle.x_m, vehicle.y_m, vehicle.heading_rad)
        vehicle.x_m, vehicle.y_m, vehicle.heading_rad = 5.0, -6.0, 2.0
        assert lockstep.run_until(lambda: not lockstep.statuses["r1"].ready, 20.0)
        told = lockstep.command("r1", "arm")
        assert not told.accepted
        assert "echelon at-start" in told.reason
        vehicle.x_m, vehicle.y_m, vehicle.heading_rad = start
        assert lockstep.command("r1", "at_start").accepted
        assert lockstep.run_until(lambda: lockstep.statuses["r1"].ready, 2.0)
        lockstep.start_mission()
        lockstep.run_for(1.0)
        assert not standing(lockstep, "r3")
        refused = lockstep.command("r1", "at_start")
        assert not refused.accepted
        assert "possible in STANDBY only, not in RUNNING" in refused.reason


def test_a_filter_that_breaks_down_stops_its_robot_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(matrix: object) -> Lower:
        raise ArithmeticError("covariance is not positive definite: pivot 2 is -1.0")

    with driving(DEMO) as lockstep:
        with monkeypatch.context() as patched:
            patched.setattr(relative_ukf, "cholesky4", broken)
            lockstep.run_for(0.01)
        assert lockstep.run_until(lambda: standing(lockstep, "r2"), 1.0)
        assert lockstep.statuses["r2"].reason.startswith("lost r1: covariance is not positive")
        assert lockstep.run_until(lambda: lockstep.statuses["r2"].state == "STANDBY", 2.0)
