"""The transmit guard: just inside a limit passes, just outside is blocked and named."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.fleet import Axis, Limits, Vehicle
from onboard.safety.transmit_guard import GuardVerdict, TransmitGuard
from tests.onboard.canbus.fakes import estimates, signed, steering_angle

REV_PER_M, REV_PER_RAD = 4.0, 8.0
ZERO_REV = 3.0
VEHICLE = Vehicle(
    wheelbase_m=0.25,
    steering=Axis(node=1, revolutions_per_unit=REV_PER_RAD),
    drive=Axis(node=2, revolutions_per_unit=REV_PER_M),
)
LIMITS = Limits(
    speed_mps=1.0,
    acceleration_mps2=2.0,
    deceleration_mps2=4.0,
    steering_rad=0.5,
    steering_rate_radps=1.0,
)
Verdict = GuardVerdict


def speed(value_mps: float, t_s: float = 0.0, torque: float = 0.0) -> Frame:
    return Frame(0x04D, struct.pack("<ff", value_mps * REV_PER_M, torque), t_s)


def steering(angle_rad: float, t_s: float = 0.0, feed_forward: int = 0) -> Frame:
    position_rev = ZERO_REV + angle_rad * REV_PER_RAD
    return Frame(0x02C, struct.pack("<fhh", position_rev, feed_forward, 0), t_s)


def make_guard(database: CanDatabase, motion_allowed: bool = True) -> TransmitGuard:
    """A guard that has seen the wheel straight and the robot at rest."""
    guard = TransmitGuard(database, VEHICLE, LIMITS, bearing_unit=0)
    guard.observe(steering_angle(0.0, 0, 0.0))
    guard.observe(estimates(1, ZERO_REV, 0.0, 0.0))
    guard.observe(estimates(2, 0.0, 0.0, 0.0))
    guard.motion_allowed = motion_allowed
    return guard


@pytest.fixture
def guard(database: CanDatabase) -> TransmitGuard:
    return make_guard(database)


@pytest.fixture
def closed(database: CanDatabase) -> TransmitGuard:
    return make_guard(database, motion_allowed=False)


def ramp_speed(guard: TransmitGuard, rate_mps2: float, start_mps: float, steps: int) -> Verdict:
    """First verdict other than PASSED on a ramp at 100 Hz, else PASSED."""
    for step in range(1, steps + 1):
        verdict = guard.check(speed(start_mps + rate_mps2 * 0.01 * step, 0.01 * step)).verdict
        if verdict is not Verdict.PASSED:
            return verdict
    return Verdict.PASSED


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_speed_limit_is_the_boundary(guard: TransmitGuard, sign: float) -> None:
    guard.observe(estimates(2, 0.0, sign * 0.99 * REV_PER_M, 0.0))
    assert guard.check(speed(sign * 1.0)).verdict is Verdict.PASSED
    decision = guard.check(speed(sign * 1.002))
    assert decision.verdict is Verdict.OVER_LIMIT
    assert decision.reason == f"speed setpoint {sign * 1.002:.3f} m/s, limit 1.000 m/s"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_steering_limit_is_the_boundary(guard: TransmitGuard, sign: float) -> None:
    guard.observe(estimates(1, ZERO_REV + sign * 0.49 * REV_PER_RAD, 0.0, 0.0))
    assert guard.check(steering(sign * 0.509)).verdict is Verdict.PASSED
    assert guard.check(steering(sign * 0.511)).verdict is Verdict.OVER_LIMIT


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_blocked(guard: TransmitGuard, bad: float) -> None:
    assert guard.check(speed(bad)).verdict is Verdict.NOT_FINITE
    assert guard.check(speed(0.0, torque=bad)).verdict is Verdict.NOT_FINITE
    assert guard.check(steering(bad)).verdict is Verdict.NOT_FINITE


def test_feed_forward_is_blocked(guard: TransmitGuard) -> None:
    assert guard.check(speed(0.0, torque=0.1)).verdict is Verdict.WRONG_CONTENT
    assert guard.check(steering(0.0, feed_forward=1)).verdict is Verdict.WRONG_CONTENT


@pytest.mark.parametrize(
    ("rate_mps2", "expected"), [(2.0, Verdict.PASSED), (2.4, Verdict.OVER_RATE)]
)
def test_acceleration_has_its_limit(
    guard: TransmitGuard, rate_mps2: float, expected: Verdict
) -> None:
    assert ramp_speed(guard, rate_mps2, start_mps=0.0, steps=40) is expected


@pytest.mark.parametrize(
    ("rate_mps2", "expected"), [(-4.0, Verdict.PASSED), (-6.0, Verdict.OVER_RATE)]
)
def test_deceleration_has_its_own_limit(
    guard: TransmitGuard, rate_mps2: float, expected: Verdict
) -> None:
    guard.observe(estimates(2, 0.0, 1.0 * REV_PER_M, 0.0))
    assert ramp_speed(guard, rate_mps2, start_mps=1.0, steps=15) is expected


def test_a_jump_may_be_worth_50_ms_and_no_more(database: CanDatabase) -> None:
    assert make_guard(database).check(speed(0.104)).verdict is Verdict.PASSED
    assert make_guard(database).check(speed(0.106)).verdict is Verdict.OVER_RATE


def test_a_jump_back_through_zero_counts_both_ways(database: CanDatabase) -> None:
    guard = make_guard(database)
    guard.observe(estimates(2, 0.0, 0.2 * REV_PER_M, 0.0))
    assert guard.check(speed(-0.1)).verdict is Verdict.PASSED
    guard = make_guard(database)
    guard.observe(estimates(2, 0.0, 0.22 * REV_PER_M, 0.0))
    assert guard.check(speed(-0.1)).verdict is Verdict.OVER_RATE


def test_standstill_passes_from_any_speed(guard: TransmitGuard) -> None:
    guard.observe(estimates(2, 0.0, 1.0 * REV_PER_M, 0.0))
    assert guard.check(speed(0.0)).verdict is Verdict.PASSED


@pytest.mark.parametrize(("rate", "expected"), [(1.0, Verdict.PASSED), (1.3, Verdict.OVER_RATE)])
def test_the_steering_rate_has_its_limit(
    guard: TransmitGuard, rate: float, expected: Verdict
) -> None:
    verdicts = [guard.check(steering(rate * 0.01 * k, 0.01 * k)).verdict for k in range(1, 38)]
    assert (set(verdicts) == {Verdict.PASSED}) == (expected is Verdict.PASSED)
    assert expected in verdicts


@given(
    steps=st.lists(st.tuples(st.floats(0.001, 0.05), st.floats(-1.2, 1.2)), min_size=1, max_size=40)
)
def test_what_passes_keeps_speed_and_long_run_acceleration(
    database: CanDatabase, steps: list[tuple[float, float]]
) -> None:
    guard, now_s, before_mps, gained_mps = make_guard(database), 0.0, 0.0, 0.0
    for dt_s, value_mps in steps:
        now_s += dt_s
        if guard.check(speed(value_mps, now_s)).verdict is not Verdict.PASSED:
            continue
        assert abs(value_mps) <= 1.0 * 1.001 + 1e-6
        crossing = before_mps * value_mps < 0
        faster = abs(value_mps) - (0.0 if crossing else abs(before_mps))
        gained_mps += max(0.0, faster)
        before_mps = value_mps
    assert gained_mps <= 2.0 * 1.05 * (now_s + 0.05) + 1e-3


def test_without_leave_only_neutral_setpoints_pass(closed: TransmitGuard) -> None:
    assert closed.check(speed(0.0)).verdict is Verdict.PASSED
    assert closed.check(speed(0.001)).verdict is Verdict.MOTION_NOT_ALLOWED
    assert closed.check(steering(0.049)).verdict is Verdict.PASSED
    assert closed.check(steering(0.051)).verdict is Verdict.MOTION_NOT_ALLOWED


def test_a_held_setpoint_passes_although_the_wheel_is_pushed(closed: TransmitGuard) -> None:
    assert closed.check(steering(0.0)).verdict is Verdict.PASSED
    closed.observe(estimates(1, ZERO_REV + 0.2 * REV_PER_RAD, 0.0, 0.1))
    assert closed.check(steering(0.0, 0.1)).verdict is Verdict.PASSED


def test_steering_waits_for_measurements(database: CanDatabase) -> None:
    guard = TransmitGuard(database, VEHICLE, LIMITS, bearing_unit=0)
    assert guard.check(steering(0.0)).verdict is Verdict.MOTION_NOT_ALLOWED
    guard.motion_allowed = True
    guard.observe(estimates(1, ZERO_REV, 0.0, 0.0))
    decision = guard.check(steering(0.0))
    assert decision.verdict is Verdict.MOTION_NOT_ALLOWED
    assert "zero" in decision.reason


def test_the_zero_is_not_measured_while_moving_nor_from_a_bad_angle(
    database: CanDatabase,
) -> None:
    guard = make_guard(database)
    guard.observe(steering_angle(0.4, 1, 0.02))
    guard.observe(estimates(1, ZERO_REV, 0.0, 0.02))
    assert guard.check(steering(0.0, 0.02)).verdict is Verdict.PASSED
    guard.motion_allowed = False
    for bad in (
        steering_angle(0.4, 1, 0.2, flags=0x10),
        Frame(0x060, bytes(8), 0.2),
        steering_angle(0.4, 1, 0.1),
    ):
        guard.observe(bad)
        guard.observe(estimates(1, ZERO_REV, 0.0, 0.2))
    guard.motion_allowed = True
    assert guard.check(steering(0.0, 0.2)).verdict is Verdict.PASSED


@pytest.mark.parametrize(
    ("can_id", "data"),
    [
        (0x022, b""),
        (0x042, b""),
        (0x038, b"\x00"),
        (0x058, b"\x00"),
        (0x027, bytes.fromhex("0100000000000000")),
        (0x047, bytes.fromhex("0800000000000000")),
        (0x02B, bytes.fromhex("0300000001000000")),
        (0x04B, bytes.fromhex("0200000001000000")),
        (0x04F, struct.pack("<ff", 10.0, 20.0)),
        (0x010, signed(0x010, b"\x30", 0)),
        (0x012, signed(0x012, b"\x20\x00\x00", 5)),
        (0x123, signed(0x123, bytes(7), 9)),
    ],
)
def test_stop_clear_and_state_frames_pass_without_leave(
    closed: TransmitGuard, can_id: int, data: bytes
) -> None:
    assert closed.check(Frame(can_id, data, 0.0)).verdict is Verdict.PASSED


@pytest.mark.parametrize(
    ("can_id", "length", "what"),
    [
        (0x041, 8, "a drive's heartbeat"),
        (0x060, 8, "the encoder's angle"),
        (0x011, 4, "the safety node's status"),
        (0x120, 8, "the sensor's header"),
        (0x143, 8, "orders to a sensor that the robot does not have"),
        (0x067, 8, "a drive that the robot does not have"),
        (0x7E2, 0, "the drives' broadcast"),
        (0x04E, 8, "a torque setpoint"),
        (0x044, 8, "a setting of the drive"),
        (0x056, 1, "a reboot"),
        (0x02D, 8, "a velocity setpoint for the steering"),
        (0x04C, 8, "a position setpoint for the drive"),
    ],
)
def test_what_this_host_should_not_send_is_blocked(
    guard: TransmitGuard, can_id: int, length: int, what: str
) -> None:
    decision = guard.check(Frame(can_id, bytes(length), 0.0))
    assert decision.verdict is Verdict.NOT_WHITELISTED, what
    assert f"0x{can_id:03X}" in decision.reason


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x04D, bytes(7), 0.0),
        Frame(0x04D, b"", 0.0),
        Frame(0x042, b"\x00", 0.0),
        Frame(0x027, bytes(4), 0.0),
    ],
)
def test_a_wrong_length_is_blocked(guard: TransmitGuard, frame: Frame) -> None:
    assert guard.check(frame).verdict is Verdict.WRONG_LENGTH


def test_a_remote_frame_is_blocked(guard: TransmitGuard) -> None:
    assert guard.check(Frame(0x04D, b"", 0.0, remote=True)).verdict is Verdict.NOT_WHITELISTED


@pytest.mark.parametrize(
    ("can_id", "data"),
    [
        (0x047, bytes.fromhex("0300000000000000")),
        (0x04B, bytes.fromhex("0100000001000000")),
        (0x04B, bytes.fromhex("0200000005000000")),
        (0x02B, bytes.fromhex("0200000001000000")),
        (0x04F, struct.pack("<ff", math.nan, 20.0)),
        (0x04F, struct.pack("<ff", 10.0, 0.0)),
        (0x012, bytes(4)),
    ],
)
def test_a_state_mode_or_signature_that_driving_does_not_use_is_blocked(
    guard: TransmitGuard, can_id: int, data: bytes
) -> None:
    assert guard.check(Frame(can_id, data, 0.0)).verdict is Verdict.WRONG_CONTENT


def test_blocked_frames_are_left_out_counted_and_reported(guard: TransmitGuard) -> None:
    frames = [
        speed(0.05),
        speed(5.0, 0.01),
        steering(0.01),
        speed(math.nan, 0.02),
        Frame(0x041, b"", 0.0),
    ]
    assert guard.admit(frames) == [speed(0.05), steering(0.01)]
    assert guard.blocked == {
        Verdict.OVER_LIMIT: 1,
        Verdict.NOT_FINITE: 1,
        Verdict.NOT_WHITELISTED: 1,
    }
    assert guard.take_reports()[0] == (
        "frame 0x04D blocked: speed setpoint 5.000 m/s, limit 1.000 m/s"
    )
    assert guard.take_reports() == []


def test_a_blocked_setpoint_is_no_reference_for_the_next(guard: TransmitGuard) -> None:
    guard.check(speed(0.9))
    assert guard.check(speed(0.95, 0.01)).verdict is Verdict.OVER_RATE
    assert guard.check(speed(0.02, 0.02)).verdict is Verdict.PASSED


def test_after_a_silence_the_measured_speed_is_the_reference(guard: TransmitGuard) -> None:
    assert guard.check(speed(0.1)).verdict is Verdict.PASSED
    guard.observe(estimates(2, 0.0, 0.8 * REV_PER_M, 1.0))
    assert guard.check(speed(0.85, 1.0)).verdict is Verdict.PASSED
    assert guard.check(speed(0.1, 1.01)).verdict is Verdict.OVER_RATE


def test_a_second_setpoint_of_the_same_cycle_is_too_soon(guard: TransmitGuard) -> None:
    assert guard.admit([speed(0.0, 1.0), speed(0.0, 1.0014)]) == [speed(0.0, 1.0)]
    assert guard.blocked == {Verdict.TOO_SOON: 1}
    assert guard.take_reports() == ["frame 0x04D blocked: 1.40 ms after the last, limit 1.50 ms"]
    assert guard.admit([speed(0.0, 1.002)])
    assert guard.admit([steering(0.0, 1.002)]), "every identifier has its own spacing"


def test_an_emergency_stop_is_never_too_soon(guard: TransmitGuard) -> None:
    stop = Frame(0x042, b"", 1.0)
    assert guard.admit([stop, stop, stop]) == [stop, stop, stop]


def test_a_blocked_frame_does_not_count_for_the_spacing(guard: TransmitGuard) -> None:
    assert guard.admit([speed(5.0, 1.0)]) == []
    assert guard.admit([speed(0.0, 1.0)])


def test_what_is_asked_of_a_drive_passes_and_other_remote_frames_do_not(
    guard: TransmitGuard,
) -> None:
    asked = [Frame(can_id, b"", 0.0, remote=True) for can_id in (0x040, 0x057, 0x055, 0x020)]
    assert guard.admit(asked) == asked
    for can_id in (0x04D, 0x04E, 0x044, 0x060):
        decision = guard.check(Frame(can_id, b"", 1.0, remote=True))
        assert decision.verdict is Verdict.NOT_WHITELISTED


@pytest.mark.parametrize(("firmware", "data"), [("0.6", b"\0"), ("0.5", b"")])
def test_errors_are_cleared_as_the_firmware_wants_it(
    database: CanDatabase, firmware: str, data: bytes
) -> None:
    drive = VEHICLE.drive.model_copy(update={"firmware": firmware})
    vehicle = VEHICLE.model_copy(update={"drive": drive})
    guard = TransmitGuard(database, vehicle, LIMITS, bearing_unit=0)
    assert guard.check(Frame(0x058, data, 0.0)).verdict is Verdict.PASSED
    other = b"" if data else b"\0"
    assert guard.check(Frame(0x058, other, 1.0)).verdict is Verdict.WRONG_LENGTH


@pytest.mark.parametrize(
    ("setpoints_mps", "expected"),
    [
        ((0.0, 0.4, 0.62), Verdict.PASSED),
        ((0.0, 0.4, 0.8), Verdict.OVER_WINDOW),
        ((0.9, 0.5, 0.1), Verdict.PASSED),
        ((1.0, 0.5, -0.6), Verdict.PASSED),
    ],
)
def test_jumps_of_the_measured_speed_do_not_carry_a_setpoint_beyond_the_window(
    guard: TransmitGuard, setpoints_mps: tuple[float, ...], expected: Verdict
) -> None:
    """With 0.11 s between setpoints each one starts from the measured speed, whatever that is."""
    verdict = Verdict.PASSED
    for step, speed_mps in enumerate(setpoints_mps):
        t_s = 0.11 * step
        guard.observe(estimates(2, 0.0, speed_mps * REV_PER_M, t_s))
        verdict = guard.check(speed(speed_mps, t_s)).verdict
    assert verdict is expected


def test_jumps_of_the_measurement_do_not_carry_a_setpoint_beyond_the_window(
    guard: TransmitGuard,
) -> None:
    """With 0.11 s between setpoints each one starts from the measured angle, wherever that is."""
    verdicts = []
    for step, angle_rad in enumerate((0.0, 0.2, 0.4)):
        t_s = 0.11 * step
        guard.observe(estimates(1, ZERO_REV + angle_rad * REV_PER_RAD, 0.0, t_s))
        verdicts.append(guard.check(steering(angle_rad, t_s)).verdict)
    assert verdicts == [Verdict.PASSED, Verdict.PASSED, Verdict.OVER_WINDOW]
