"""The emulated axis as a host on the bus sees it."""

import math
from typing import Any

import numpy as np
import pytest

from config.can.codec import Codec
from config.can.frame import Frame
from config.can.odrive import (
    AxisError,
    AxisState,
    ControlMode,
    Heartbeat,
    InputMode,
    ProcedureResult,
)
from sim_hw.faults import DeviceFaults, first_too_large
from sim_hw.motor import Motor
from sim_hw.odrive import OdriveAxis
from tests.sim_hw.fleets import database, frame

NODE = 2
WATCHDOG_S = 0.2
LIMIT_RPS = 20.0
FRICTION_RPS2 = 4.5


class Bench:
    """One axis on a bus of its own, in steps of a millisecond from t = 100 s."""

    def __init__(self) -> None:
        self.codecs = database().axis(NODE)
        self.motor = Motor(lag_s=0.03, friction_rps2=FRICTION_RPS2)
        self.start_s = 100.0
        self.steps = 0
        self.sent: list[Frame] = []
        self.drive = OdriveAxis(
            self.codecs,
            self.motor,
            t_s=self.start_s,
            velocity_limit_rps=LIMIT_RPS,
            watchdog_s=WATCHDOG_S,
            encoder_std_rev=0.0,
            rng=np.random.default_rng(1),
            faults=DeviceFaults(
                "drive", np.random.default_rng(2), (1.0, 1.0), first_too_large(), True
            ),
        )

    @property
    def t_s(self) -> float:
        return self.start_s + self.steps * 0.001

    def send(self, codec: Codec[Any], *values: float) -> None:
        self.drive.on_frame(frame(codec, self.t_s, *values), self.t_s)

    def request(self, codec: Codec[Any]) -> None:
        self.drive.on_frame(Frame(codec.can_id, b"", self.t_s, remote=True), self.t_s)

    def run(self, duration_s: float, velocity_rps: float | None = None) -> list[Frame]:
        """Let time pass, with a velocity setpoint every 10 ms if one is given."""
        frames: list[Frame] = []
        for step in range(round(duration_s * 1000)):
            if velocity_rps is not None and step % 10 == 0:
                self.send(self.codecs.set_input_vel, velocity_rps, 0.0)
            self.steps += 1
            frames += self.drive.advance(self.t_s)
        return frames

    def rows(self, codec: Codec[Any], frames: list[Frame]) -> list[Any]:
        return [codec.unpack(f.data) for f in frames if f.can_id == codec.can_id]

    def heartbeat(self) -> Heartbeat:
        self.request(self.codecs.heartbeat)
        row: Heartbeat = self.rows(self.codecs.heartbeat, self.run(0.001))[0]
        return row

    def arm(self, mode: ControlMode = ControlMode.VELOCITY_CONTROL) -> None:
        self.send(self.codecs.set_controller_mode, mode, InputMode.PASSTHROUGH)
        self.send(self.codecs.clear_errors, 0)
        self.send(self.codecs.set_axis_state, AxisState.CLOSED_LOOP_CONTROL)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_fresh_drive_sends_the_heartbeat_of_a_real_idle_one_at_once(bench: Bench) -> None:
    frames = bench.run(0.001)
    assert frames[0].can_id == NODE << 5 | 1
    assert frames[0].data == bytes.fromhex("00 00 00 00 01 00 01 00")


def test_heartbeats_come_every_100_ms_and_estimates_every_10_ms_in_idle(bench: Bench) -> None:
    frames = bench.run(1.0)
    heartbeats = [f.t_s for f in frames if f.can_id == bench.codecs.heartbeat.can_id]
    estimates = [f.t_s for f in frames if f.can_id == bench.codecs.get_encoder_estimates.can_id]
    assert np.diff(heartbeats) == pytest.approx(0.1, abs=0.0011)
    assert np.diff(estimates) == pytest.approx(0.01, abs=0.0011)
    assert (len(heartbeats), len(estimates)) == (11, 100)


def test_the_vendor_frames_arm_the_axis_and_turn_the_motor(bench: Bench) -> None:
    for can_id, data in (
        (0x04B, "02 00 00 00 01 00 00 00"),
        (0x047, "08 00 00 00 00 00 00 00"),
        (0x04D, "00 00 c0 3f 00 00 00 00"),
    ):
        bench.drive.on_frame(Frame(can_id, bytes.fromhex(data), bench.t_s), bench.t_s)
    bench.run(0.15)
    assert bench.drive.axis.armed
    assert bench.motor.velocity_rps == pytest.approx(1.5, rel=0.01)


def test_an_armed_axis_reports_closed_loop_and_stays_busy(bench: Bench) -> None:
    bench.arm()
    heartbeat = bench.heartbeat()
    assert heartbeat.axis_state == AxisState.CLOSED_LOOP_CONTROL
    assert heartbeat.procedure_result == ProcedureResult.BUSY


def test_set_axis_state_is_accepted_with_four_bytes_and_not_with_three(bench: Bench) -> None:
    request = bytes((8, 0, 0, 0))
    can_id = bench.codecs.set_axis_state.can_id
    bench.drive.on_frame(Frame(can_id, request[:3], bench.t_s), bench.t_s)
    assert not bench.drive.axis.armed
    bench.drive.on_frame(Frame(can_id, request, bench.t_s), bench.t_s)
    assert bench.drive.axis.armed


def test_the_watchdog_trips_200_ms_after_the_last_setpoint(bench: Bench) -> None:
    bench.arm()
    bench.run(0.5, velocity_rps=3.0)
    last_setpoint_s = bench.t_s - 0.01
    bench.run(0.189)
    assert bench.drive.axis.armed
    frames = bench.run(0.111)
    assert not bench.drive.axis.armed
    assert bench.t_s - last_setpoint_s == pytest.approx(0.31)
    tripped = [f for f in frames if f.can_id == bench.codecs.heartbeat.can_id][-1]
    assert tripped.data == bytes.fromhex("00 00 00 01 01 03 01 00")


def test_only_setpoints_feed_the_watchdog(bench: Bench) -> None:
    bench.arm()
    for _ in range(25):
        bench.send(bench.codecs.set_limits, 10.0, 10.0)
        bench.send(bench.codecs.set_controller_mode, 2, 1)
        bench.request(bench.codecs.get_error)
        bench.run(0.01)
    assert bench.drive.axis.active_errors == AxisError.WATCHDOG_TIMER_EXPIRED


def test_clearing_errors_feeds_the_watchdog(bench: Bench) -> None:
    bench.arm()
    for _ in range(5):
        bench.run(0.15)
        bench.send(bench.codecs.clear_errors, 0)
    assert bench.drive.axis.armed


def test_an_idle_axis_does_not_trip(bench: Bench) -> None:
    bench.run(1.0)
    assert bench.drive.axis.active_errors == 0


def test_a_tripped_axis_coasts_to_a_stop_by_friction(bench: Bench) -> None:
    bench.arm()
    bench.run(0.5, velocity_rps=9.0)
    bench.send(bench.codecs.estop)
    bench.run(1.0)
    assert bench.motor.velocity_rps == pytest.approx(9.0 - FRICTION_RPS2 * 1.0, rel=0.01)
    bench.run(1.1)
    assert bench.motor.velocity_rps == 0.0


def test_an_error_refuses_arming_until_it_is_cleared(bench: Bench) -> None:
    bench.send(bench.codecs.estop)
    bench.send(bench.codecs.set_axis_state, AxisState.CLOSED_LOOP_CONTROL)
    heartbeat = bench.heartbeat()
    assert heartbeat.axis_error == AxisError.ESTOP_REQUESTED
    assert heartbeat.axis_state == AxisState.IDLE
    assert heartbeat.procedure_result == ProcedureResult.DISARMED
    bench.arm()
    assert bench.drive.axis.armed


def test_the_estop_of_the_protocol_disarms(bench: Bench) -> None:
    bench.arm()
    bench.drive.on_frame(Frame(0x042, b"", bench.t_s), bench.t_s)
    assert bench.drive.axis.state is AxisState.IDLE
    assert bench.drive.axis.active_errors == AxisError.ESTOP_REQUESTED


def test_the_broadcast_node_reaches_the_axis_and_another_node_does_not(bench: Bench) -> None:
    bench.arm()
    bench.drive.on_frame(Frame(0x022, b"", bench.t_s), bench.t_s)
    assert bench.drive.axis.armed
    bench.drive.on_frame(Frame(0x7E2, b"", bench.t_s), bench.t_s)
    assert not bench.drive.axis.armed


def test_an_axis_without_calibration_is_not_armed_until_calibrated(bench: Bench) -> None:
    bench.drive.axis.calibrated = False
    bench.arm()
    assert bench.heartbeat().procedure_result == ProcedureResult.NOT_CALIBRATED
    bench.send(bench.codecs.set_axis_state, AxisState.FULL_CALIBRATION_SEQUENCE)
    assert bench.heartbeat().procedure_result == ProcedureResult.BUSY
    bench.run(2.1)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, ProcedureResult.SUCCESS)
    bench.arm()
    assert bench.drive.axis.armed


def test_a_state_that_does_not_exist_is_refused(bench: Bench) -> None:
    bench.send(bench.codecs.set_axis_state, 99)
    assert bench.heartbeat().procedure_result == ProcedureResult.INVALID_STATE


def test_a_request_for_idle_cancels_closed_loop(bench: Bench) -> None:
    bench.arm()
    bench.send(bench.codecs.set_axis_state, AxisState.IDLE)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, ProcedureResult.CANCELLED)


def test_running_faster_than_a_lowered_limit_trips_over_speed(bench: Bench) -> None:
    bench.arm()
    bench.run(0.3, velocity_rps=10.0)
    bench.send(bench.codecs.set_limits, 5.0, 10.0)
    bench.run(0.01, velocity_rps=10.0)
    assert bench.drive.axis.active_errors == AxisError.VELOCITY_LIMIT_VIOLATION


def test_a_setpoint_beyond_the_limit_is_held_at_the_limit(bench: Bench) -> None:
    bench.arm()
    bench.run(0.5, velocity_rps=100.0)
    assert bench.motor.velocity_rps == pytest.approx(LIMIT_RPS)
    assert bench.drive.axis.armed


def test_a_setpoint_that_is_no_number_disarms_and_leaves_the_motion_finite(bench: Bench) -> None:
    bench.arm()
    bench.send(bench.codecs.set_input_vel, math.nan, 0.0)
    bench.run(0.01)
    assert bench.drive.axis.active_errors == AxisError.MISSING_INPUT
    assert math.isfinite(bench.motor.position_rev)


def test_arming_in_position_mode_holds_the_present_position(bench: Bench) -> None:
    bench.motor.position_rev = 3.0
    bench.send(bench.codecs.set_absolute_position, 1.25)
    bench.arm(ControlMode.POSITION_CONTROL)
    frames = bench.run(0.1)
    assert bench.motor.position_rev == 3.0
    rows = bench.rows(bench.codecs.get_encoder_estimates, frames)
    assert rows[-1].pos_estimate == 1.25


def test_position_setpoints_count_from_the_position_that_was_set(bench: Bench) -> None:
    bench.send(bench.codecs.set_absolute_position, 10.0)
    bench.arm(ControlMode.POSITION_CONTROL)
    for _ in range(30):
        bench.send(bench.codecs.set_input_pos, 10.5, 0.0, 0.0)
        bench.run(0.01)
    assert bench.motor.position_rev == pytest.approx(0.5, abs=1e-3)


def test_an_armed_axis_does_not_take_a_new_position(bench: Bench) -> None:
    bench.arm(ControlMode.POSITION_CONTROL)
    bench.send(bench.codecs.set_absolute_position, 5.0)
    assert bench.drive.axis.position_rev == 0.0


@pytest.mark.parametrize("remote", [True, False])
def test_requests_are_answered_as_remote_frames_and_as_empty_ones(
    bench: Bench, remote: bool
) -> None:
    codecs = bench.codecs
    wanted: list[Codec[Any]] = [
        codecs.get_version,
        codecs.get_error,
        codecs.get_temperature,
        codecs.get_bus_voltage_current,
        codecs.get_iq,
    ]
    for codec in wanted:
        bench.drive.on_frame(Frame(codec.can_id, b"", bench.t_s, remote), bench.t_s)
    answers = {f.can_id: f for f in bench.run(0.001)}
    assert all(codec.can_id in answers for codec in wanted)
    version = codecs.get_version.unpack(answers[codecs.get_version.can_id].data)
    assert (version.protocol_version, version.fw_version_minor) == (2, 6)
    voltage = codecs.get_bus_voltage_current.unpack(
        answers[codecs.get_bus_voltage_current.can_id].data
    )
    assert voltage.bus_voltage == 24.0


def test_get_error_keeps_the_reason_for_disarming_until_cleared(bench: Bench) -> None:
    bench.arm()
    bench.run(0.3)
    bench.request(bench.codecs.get_error)
    row = bench.rows(bench.codecs.get_error, bench.run(0.001))[0]
    assert row == (AxisError.WATCHDOG_TIMER_EXPIRED, AxisError.WATCHDOG_TIMER_EXPIRED)
    bench.send(bench.codecs.clear_errors, 0)
    bench.request(bench.codecs.get_error)
    assert bench.rows(bench.codecs.get_error, bench.run(0.001))[0] == (0, 0)


def test_a_reboot_is_silent_and_deaf_for_a_second_then_initialises(bench: Bench) -> None:
    bench.arm()
    bench.run(0.2, velocity_rps=5.0)
    bench.send(bench.codecs.reboot, 0)
    assert bench.run(0.99) == []
    bench.arm()
    assert not bench.drive.axis.armed
    first = bench.rows(bench.codecs.heartbeat, bench.run(0.02))[0]
    assert first.axis_error == AxisError.INITIALIZING
    bench.arm()
    assert not bench.drive.axis.armed
    bench.run(0.5)
    assert abs(bench.drive.axis.position_rev) < 0.1
    bench.arm()
    assert bench.drive.axis.armed


def test_a_disarm_without_a_reason_shows_no_error(bench: Bench) -> None:
    bench.arm()
    bench.drive.begin_fault("disarm", None, bench.t_s)
    heartbeat = bench.heartbeat()
    assert (heartbeat.axis_error, heartbeat.axis_state) == (0, AxisState.IDLE)


def test_setpoints_between_steps_lose_no_motion() -> None:
    calm, busy = Bench(), Bench()
    for bench in (calm, busy):
        bench.arm()
        bench.run(0.1, velocity_rps=5.0)
    for _ in range(100):
        calm.run(0.001)
        within_s = busy.t_s + 0.0004
        busy.drive.on_frame(frame(busy.codecs.set_input_vel, within_s, 5.0, 0.0), within_s)
        busy.run(0.001)
    assert busy.motor.position_rev == pytest.approx(calm.motor.position_rev, abs=1e-12)


def test_a_frame_from_ahead_of_the_simulation_does_not_bring_cyclic_frames_forward() -> None:
    bench = Bench()
    bench.run(0.1)
    ahead_s = bench.t_s + 0.05
    bench.drive.on_frame(frame(bench.codecs.set_input_vel, ahead_s, 1.0, 0.0), ahead_s)
    times = [f.t_s for f in bench.run(0.1) if f.can_id == bench.codecs.get_encoder_estimates.can_id]
    assert np.diff(times) == pytest.approx(0.01, abs=0.0011)
