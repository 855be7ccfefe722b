"""The ODrive driver against hand-written frames: arming, driving, faults, reset."""

import math
import struct
from collections.abc import Callable

import pytest

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import ControlMode
from config.fleet import Failsafe
from onboard.canbus.drive.driver import MotorDriver, MotorState
from onboard.canbus.drive.odrive import OdriveAxis
from onboard.canbus.drive.odrive_frames import DriveLimits
from tests.onboard.canbus.fakes import (
    ACTIVE_HEARTBEAT,
    IDLE_HEARTBEAT,
    WATCHDOG_HEARTBEAT,
    FakeDrive,
)

DRIVE, STEERING = 2, 1
REV_PER_M, REV_PER_RAD = 4.0, 8.0
SET_STATE, SET_VEL, SET_POS, ESTOP, CLEAR = 0x07, 0x0D, 0x0C, 0x02, 0x18
PERIOD_S = 0.01


class Bench:
    """A driver and a fake drive at 100 Hz of virtual time."""

    def __init__(self, database: CanDatabase, node: int, limits: DriveLimits | None = None) -> None:
        is_drive = node == DRIVE
        mode = ControlMode.VELOCITY_CONTROL if is_drive else ControlMode.POSITION_CONTROL
        self.axis = OdriveAxis(
            database.axis(node), mode, REV_PER_M if is_drive else REV_PER_RAD, Failsafe(), limits
        )
        self.drive = FakeDrive(node)
        self.now_s = 0.0

    @property
    def state(self) -> MotorState:
        return self.axis.feedback.state

    @property
    def reason(self) -> str:
        return self.axis.feedback.reason

    def cycle(self, command: float | None = None) -> dict[int, bytes]:
        """One cycle; returns what the driver sent, by command number."""
        self.now_s = round(self.now_s + PERIOD_S, 6)
        for frame in self.drive.frames(self.now_s):
            self.axis.on_frame(frame)
        if command is not None:
            self.axis.command(command)
        sent = self.axis.tick(self.now_s)
        assert all(frame.can_id >> 5 == self.drive.node for frame in sent)
        return {frame.can_id & 0x1F: frame.data for frame in sent}

    def run(self, duration_s: float) -> list[dict[int, bytes]]:
        return [self.cycle() for _ in range(round(duration_s / PERIOD_S))]

    def until(self, state: MotorState, within_s: float) -> None:
        for _ in range(round(within_s / PERIOD_S)):
            self.cycle()
            if self.state is state:
                return
        raise AssertionError(f"still {self.state.name} ({self.reason}) after {within_s} s")

    def activate(self) -> None:
        self.until(MotorState.IDLE, 0.2)
        if self.drive.node == STEERING:
            assert self.axis.align(0.0) is None
        assert self.axis.arm() is None
        self.cycle()
        self.drive.heartbeat = ACTIVE_HEARTBEAT
        self.until(MotorState.ACTIVE, 0.3)


@pytest.fixture
def drive(database: CanDatabase) -> Bench:
    return Bench(database, DRIVE)


@pytest.fixture
def steering(database: CanDatabase) -> Bench:
    return Bench(database, STEERING)


@pytest.fixture
def active(drive: Bench) -> Bench:
    drive.activate()
    return drive


def floats(data: bytes) -> tuple[float, ...]:
    return struct.unpack("<ff", data)


def test_it_is_a_motor_driver(drive: Bench) -> None:
    driver: MotorDriver = drive.axis
    assert driver.feedback.state is MotorState.OFFLINE
    assert driver.feedback.reason == "no heartbeat yet"


def test_a_heard_and_idle_drive_is_idle_and_nothing_is_sent(drive: Bench) -> None:
    assert not any(drive.run(0.2))
    assert drive.state is MotorState.IDLE


def test_an_initialising_drive_is_offline_not_in_fault(drive: Bench) -> None:
    drive.drive.heartbeat = bytes.fromhex("0100000001000100")
    drive.run(0.2)
    assert drive.state is MotorState.OFFLINE
    assert "INITIALIZING" in drive.reason


def test_the_first_cycle_of_arming_holds_the_documented_frames(drive: Bench) -> None:
    drive.until(MotorState.IDLE, 0.2)
    assert drive.axis.arm() is None
    sent = drive.cycle(command=1.0)
    assert list(sent) == [0x0B, CLEAR, SET_STATE, SET_VEL]
    assert sent[0x0B] == bytes.fromhex("0200000001000000")
    assert sent[CLEAR] == b"\x00"
    assert sent[SET_STATE] == bytes.fromhex("0800000000000000")
    assert floats(sent[SET_VEL]) == (0.0, 0.0)


def test_limits_are_set_at_arming_where_given(database: CanDatabase) -> None:
    bench = Bench(database, DRIVE, DriveLimits(velocity=1.5, current_a=12.0))
    bench.until(MotorState.IDLE, 0.2)
    bench.axis.arm()
    assert floats(bench.cycle()[0x0F]) == (1.5 * REV_PER_M, 12.0)


def test_every_cycle_of_arming_feeds_the_watchdog_with_neutral(drive: Bench) -> None:
    drive.until(MotorState.IDLE, 0.2)
    drive.axis.arm()
    for _ in range(50):
        assert floats(drive.cycle(command=1.0)[SET_VEL]) == (0.0, 0.0)
    assert drive.state is MotorState.ARMING


def test_an_older_heartbeat_does_not_end_arming(drive: Bench) -> None:
    drive.until(MotorState.IDLE, 0.2)
    drive.axis.arm()
    drive.cycle()
    drive.axis.on_frame(Frame(0x041, ACTIVE_HEARTBEAT, drive.now_s - 0.005))
    drive.cycle()
    assert drive.state is MotorState.ARMING


def test_a_busy_result_is_active_all_the_same(active: Bench) -> None:
    assert ACTIVE_HEARTBEAT[5] == 1
    assert active.state is MotorState.ACTIVE


def test_arming_that_takes_more_than_a_second_is_a_fault_with_what_the_drive_says(
    drive: Bench,
) -> None:
    drive.until(MotorState.IDLE, 0.2)
    drive.axis.arm()
    drive.cycle()
    drive.drive.heartbeat = bytes.fromhex("00000000010e0100")
    drive.run(0.95)
    assert drive.state is MotorState.ARMING
    drive.until(MotorState.FAULT, 0.1)
    assert "limit 1.00 s" in drive.reason
    assert "NOT_CALIBRATED" in drive.reason


def test_a_command_goes_out_in_motor_revolutions(active: Bench) -> None:
    assert active.cycle(command=0.375)[SET_VEL] == bytes.fromhex("0000c03f00000000")


def test_a_cycle_without_a_command_sends_the_neutral_setpoint(active: Bench) -> None:
    active.cycle(command=0.375)
    assert floats(active.cycle()[SET_VEL]) == (0.0, 0.0)


def test_feedback_is_in_joint_units(active: Bench) -> None:
    active.drive.position_rev, active.drive.velocity_rps = 10.0, -3.0
    active.cycle()
    assert active.axis.feedback.position == 2.5
    assert active.axis.feedback.velocity == -0.75


def test_current_and_voltage_are_kept(active: Bench) -> None:
    active.axis.on_frame(Frame(0x054, struct.pack("<ff", 1.0, 2.5), active.now_s))
    active.axis.on_frame(Frame(0x057, struct.pack("<ff", 24.5, 0.5), active.now_s))
    assert active.axis.feedback.current_a == 2.5
    assert active.axis.feedback.bus_voltage_v == 24.5


def test_a_tripped_watchdog_is_a_fault_that_names_it(active: Bench) -> None:
    active.drive.heartbeat = WATCHDOG_HEARTBEAT
    active.until(MotorState.FAULT, 0.2)
    assert active.axis.feedback.faults == ("WATCHDOG_TIMER_EXPIRED",)
    assert "WATCHDOG_TIMER_EXPIRED" in active.reason
    assert "DISARMED" in active.reason


def test_leaving_closed_loop_without_an_error_is_a_fault(active: Bench) -> None:
    active.drive.heartbeat = IDLE_HEARTBEAT
    active.until(MotorState.FAULT, 0.2)
    assert active.reason.startswith("left closed-loop control: state IDLE")


def test_unknown_error_bits_are_named_by_their_value(active: Bench) -> None:
    active.drive.heartbeat = bytes.fromhex("8002000001030100")
    active.until(MotorState.FAULT, 0.2)
    assert active.axis.feedback.faults == ("0x00000080", "DC_BUS_UNDER_VOLTAGE")


def test_a_silent_drive_is_a_fault_after_its_limit_and_hears_nothing_more(active: Bench) -> None:
    active.drive.heartbeat = None
    while active.state is MotorState.ACTIVE:
        sent = active.cycle()
        silent_s = active.now_s - (active.axis.feedback.t_heartbeat_s or math.nan)
        assert (silent_s < 0.355) == (active.state is MotorState.ACTIVE)
    assert sent == {}
    assert "no heartbeat for 0.36 s, limit 0.35 s" in active.reason
    assert not any(active.run(0.5))


def test_silent_estimates_are_a_fault_and_the_drive_is_told_to_let_go(active: Bench) -> None:
    active.drive.sends_estimates = False
    assert all(SET_VEL in sent for sent in active.run(0.05))
    sent = active.cycle()
    assert active.state is MotorState.FAULT
    assert "no encoder estimate for 0.06 s, limit 0.05 s" in active.reason
    assert sent == {SET_STATE: bytes.fromhex("0100000000000000")}
    assert not any(active.run(0.2))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_an_estimate_that_is_not_finite_is_a_fault(active: Bench, bad: float) -> None:
    active.drive.velocity_rps = bad
    active.cycle(command=0.1)
    assert active.state is MotorState.FAULT
    assert "not finite" in active.reason


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_command_that_is_not_finite_is_a_fault_and_never_sent(active: Bench, bad: float) -> None:
    assert SET_VEL not in active.cycle(command=bad)
    assert active.state is MotorState.FAULT


def test_a_fault_is_left_only_by_a_reset(active: Bench) -> None:
    active.drive.heartbeat = WATCHDOG_HEARTBEAT
    active.until(MotorState.FAULT, 0.2)
    active.drive.heartbeat = IDLE_HEARTBEAT
    assert not any(sent.keys() - {SET_STATE} for sent in active.run(1.0))
    assert active.state is MotorState.FAULT
    assert active.axis.arm() is not None
    active.axis.clear_faults()
    sent = active.cycle()
    assert sent == {SET_STATE: bytes.fromhex("0100000000000000"), CLEAR: b"\x00"}
    active.until(MotorState.IDLE, 0.2)
    assert active.axis.feedback.faults == ()


def test_a_standing_error_faults_again_after_the_reset(active: Bench) -> None:
    active.drive.heartbeat = WATCHDOG_HEARTBEAT
    active.until(MotorState.FAULT, 0.2)
    active.axis.clear_faults()
    active.cycle()
    assert active.state is MotorState.OFFLINE
    active.until(MotorState.FAULT, 0.2)


def test_a_reset_alone_never_arms(active: Bench) -> None:
    active.drive.heartbeat = WATCHDOG_HEARTBEAT
    active.until(MotorState.FAULT, 0.2)
    active.drive.heartbeat = IDLE_HEARTBEAT
    active.axis.clear_faults()
    sent = active.run(1.0)
    assert all(cycle.get(SET_STATE, b"\x01")[0] == 1 for cycle in sent)


def test_a_reset_sends_nothing_to_a_silent_drive(active: Bench) -> None:
    active.drive.heartbeat = None
    active.until(MotorState.FAULT, 0.5)
    active.axis.clear_faults()
    assert not any(active.run(0.3))
    assert active.state is MotorState.OFFLINE


def test_a_drive_found_active_is_a_fault_and_is_told_to_let_go(drive: Bench) -> None:
    drive.drive.heartbeat = ACTIVE_HEARTBEAT
    sent = drive.cycle()
    assert drive.state is MotorState.FAULT
    assert sent[SET_STATE] == bytes.fromhex("0100000000000000")


def test_an_error_from_before_the_start_waits_for_the_operator(drive: Bench) -> None:
    drive.drive.heartbeat = WATCHDOG_HEARTBEAT
    drive.run(0.2)
    assert drive.state is MotorState.FAULT
    assert drive.axis.feedback.faults == ("WATCHDOG_TIMER_EXPIRED",)


def test_disarming_keeps_neutral_setpoints_until_the_drive_is_idle(active: Bench) -> None:
    active.axis.disarm()
    first = active.cycle(command=1.0)
    assert first[SET_STATE] == bytes.fromhex("0100000000000000")
    assert floats(first[SET_VEL]) == (0.0, 0.0)
    assert active.state is MotorState.STOPPING
    active.drive.heartbeat = IDLE_HEARTBEAT
    active.until(MotorState.IDLE, 0.2)
    assert active.cycle() == {}


def test_a_drive_that_does_not_let_go_is_a_fault(active: Bench) -> None:
    active.axis.disarm()
    active.until(MotorState.FAULT, 1.1)
    assert active.reason.startswith("disarming not done")


@pytest.mark.parametrize("prepare", [lambda _bench: None, lambda bench: bench.activate()])
def test_the_emergency_stop_goes_out_three_times_and_is_latched(
    drive: Bench, prepare: Callable[[Bench], None]
) -> None:
    prepare(drive)
    drive.axis.estop()
    sent = drive.run(0.1)
    assert [cycle for cycle in sent if cycle] == [{ESTOP: b""}] * 3
    assert sent[:3] == [{ESTOP: b""}] * 3
    assert drive.state is MotorState.FAULT
    assert drive.reason == "emergency stop"


def test_the_emergency_stop_goes_to_a_silent_drive_too(active: Bench) -> None:
    active.drive.heartbeat = None
    active.until(MotorState.FAULT, 0.5)
    active.axis.estop()
    assert active.cycle() == {ESTOP: b""}


def test_truncated_remote_and_foreign_frames_do_not_count(drive: Bench) -> None:
    drive.drive.heartbeat = None
    for frame in (
        Frame(0x041, IDLE_HEARTBEAT[:4], 0.01),
        Frame(0x041, b"", 0.01, remote=True),
        Frame(0x021, IDLE_HEARTBEAT, 0.01),
    ):
        drive.axis.on_frame(frame)
    drive.cycle()
    assert drive.reason == "no heartbeat yet"


def test_steering_must_be_aligned_before_it_arms(steering: Bench) -> None:
    steering.until(MotorState.IDLE, 0.2)
    assert "not aligned" in (steering.axis.arm() or "")


def test_steering_counts_from_the_absolute_encoder(steering: Bench) -> None:
    steering.drive.position_rev = 3.0
    steering.until(MotorState.IDLE, 0.2)
    assert steering.axis.align(0.25) is None
    assert steering.axis.feedback.position == pytest.approx(0.25)
    steering.drive.position_rev = 3.8
    steering.cycle()
    assert steering.axis.feedback.position == pytest.approx(0.35)
    assert steering.axis.difference(0.30) == pytest.approx(0.05)


def test_alignment_is_refused_while_powered_and_without_a_position(steering: Bench) -> None:
    assert "position" in (steering.axis.align(0.1) or "")
    steering.activate()
    assert "idle" in (steering.axis.align(0.1) or "")


def test_steering_holds_its_position_and_then_obeys(steering: Bench) -> None:
    steering.drive.position_rev = 3.0
    steering.activate()
    steering.drive.position_rev = 3.01
    assert floats(steering.cycle()[SET_POS][:4] + bytes(4))[0] == 3.0
    moved = steering.cycle(command=0.5)[SET_POS]
    assert moved == struct.pack("<fhh", 3.0 + 0.5 * REV_PER_RAD, 0, 0)
    steering.drive.position_rev = 5.0
    assert steering.cycle()[SET_POS] == struct.pack("<fhh", 5.0, 0, 0)
    steering.drive.position_rev = 5.01
    assert steering.cycle()[SET_POS] == struct.pack("<fhh", 5.0, 0, 0)


def test_only_velocity_and_position_control_exist(database: CanDatabase) -> None:
    with pytest.raises(ValueError, match="TORQUE_CONTROL"):
        OdriveAxis(database.axis(2), ControlMode.TORQUE_CONTROL, 1.0, Failsafe())
