"""The compiled codecs against cantools on the robot's exported DBC, and against known frames."""

import math
import random
import struct
from typing import Any

import pytest
from cantools.database import load_string
from cantools.database.can import Database, Message

from config.can import odrive, vehicle
from config.can.codec import FLOAT32_MAX, Codec, FrameTooShort, NonFiniteSignal
from config.can.database import (
    AXIS_DBC,
    BEARING_SENSOR_DBC,
    VEHICLE_AUX_DBC,
    CanDatabase,
    DatabaseMismatch,
    template_text,
)
from config.can.robot_dbc import robot_dbc

STEERING, DRIVE, SENSOR = 1, 2, 1
FRAMES_PER_MESSAGE = 60

DB = CanDatabase.load()
CODECS: list[Codec[Any]] = [
    *DB.axis(STEERING),
    *DB.axis(DRIVE),
    *DB.bearing_sensor(SENSOR),
    *DB.vehicle_aux(),
]


def load_reference() -> Database:
    database = load_string(robot_dbc(STEERING, DRIVE, SENSOR), "dbc", strict=True)
    assert isinstance(database, Database)
    return database


REFERENCE = load_reference()


def reference(codec: Codec[Any]) -> Message:
    return REFERENCE.get_message_by_frame_id(codec.can_id)


def same(one: object, other: object) -> bool:
    return one == other or (one != one and other != other)


@pytest.mark.parametrize("codec", CODECS, ids=lambda codec: f"{codec.can_id:#x}-{codec.name}")
class TestAgainstCantools:
    def test_describes_the_same_message(self, codec: Codec[Any]) -> None:
        message = reference(codec)
        assert message.dbc is not None
        data_id = message.dbc.attributes.get("E2E_DataID")
        assert codec.length == message.length
        assert message.senders[0].endswith(codec.sender)
        assert codec.cycle_time_s == pytest.approx((message.cycle_time or 0) / 1000)
        assert codec.e2e_data_id == (data_id.value if data_id else None)
        assert codec.feeds_watchdog == (
            codec.name in ("Axis_Set_Input_Pos", "Axis_Set_Input_Vel", "Axis_Set_Input_Torque")
        )

    def test_unpacks_any_frame_alike(self, codec: Codec[Any]) -> None:
        message, rng = reference(codec), random.Random(codec.can_id)
        for _ in range(FRAMES_PER_MESSAGE):
            data = rng.randbytes(codec.length)
            expected = message.decode(data, decode_choices=False)
            assert isinstance(expected, dict)
            by_name = {name.lower(): value for name, value in expected.items()}
            row = codec.unpack(data)
            assert row._fields == codec.signals
            for name, value in zip(codec.signals, row, strict=True):
                assert same(value, by_name[name])

    def test_packs_any_allowed_value_alike(self, codec: Codec[Any]) -> None:
        message, rng = reference(codec), random.Random(codec.can_id)
        for _ in range(FRAMES_PER_MESSAGE):
            values = {signal.name: random_value(signal, rng) for signal in message.signals}
            expected = message.encode(values, strict=True)
            row = {name.lower(): value for name, value in values.items()}
            named = {name: row[name] for name in codec.signals}
            assert codec.pack(**named) == without_protection(codec, expected)
            assert codec.pack(*named.values()) == codec.pack(**named)

    def test_returns_every_frame_unchanged(self, codec: Codec[Any]) -> None:
        message, rng = reference(codec), random.Random(codec.can_id)
        for _ in range(FRAMES_PER_MESSAGE):
            values = {signal.name: random_value(signal, rng) for signal in message.signals}
            data = without_protection(codec, message.encode(values, strict=True))
            assert codec.pack(*codec.unpack(data)) == data


def random_value(signal: Any, rng: random.Random) -> float:
    if signal.is_float:
        return rng.choice([0.0, rng.gauss(0, 1), rng.gauss(0, 1e6), rng.gauss(0, 1e-6)])
    low = signal.minimum if signal.minimum is not None else 0
    high = signal.maximum
    if signal.scale == 1:
        return rng.randint(int(low), int(high))
    return rng.uniform(low, high)


def without_protection(codec: Codec[Any], data: bytes) -> bytes:
    """The frame with CRC and counter cleared, which the codec leaves to config.can.e2e."""
    if codec.e2e_data_id is None:
        return data
    return bytes((0, data[1] & 0xF0)) + data[2:]


KNOWN_FRAMES: list[tuple[int, str, int, bytes]] = [
    (
        0x047,
        "08 00 00 00 00 00 00 00",
        DB.axis(2).set_axis_state.can_id,
        DB.axis(2).set_axis_state.pack(odrive.AxisState.CLOSED_LOOP_CONTROL),
    ),
    (
        0x04B,
        "02 00 00 00 01 00 00 00",
        DB.axis(2).set_controller_mode.can_id,
        DB.axis(2).set_controller_mode.pack(
            odrive.ControlMode.VELOCITY_CONTROL, odrive.InputMode.PASSTHROUGH
        ),
    ),
    (
        0x04D,
        "00 00 c0 3f 00 00 00 00",
        DB.axis(2).set_input_vel.can_id,
        DB.axis(2).set_input_vel.pack(1.5, 0.0),
    ),
    (
        0x02C,
        "00 00 80 be d2 04 0c fe",
        DB.axis(1).set_input_pos.can_id,
        DB.axis(1).set_input_pos.pack(-0.25, vel_ff=1.234, torque_ff=-0.5),
    ),
    (0x022, "", DB.axis(1).estop.can_id, DB.axis(1).estop.pack()),
    (0x038, "00", DB.axis(1).clear_errors.can_id, DB.axis(1).clear_errors.pack(0)),
]


@pytest.mark.parametrize(("can_id", "data", "made_id", "made"), KNOWN_FRAMES)
def test_makes_the_known_frames(can_id: int, data: str, made_id: int, made: bytes) -> None:
    assert (made_id, made) == (can_id, bytes.fromhex(data))


def test_reads_the_heartbeat_of_a_drive_whose_watchdog_expired() -> None:
    heartbeat = DB.axis(2).heartbeat.unpack(bytes.fromhex("0000000101030100"))
    assert odrive.AxisError(heartbeat.axis_error) is odrive.AxisError.WATCHDOG_TIMER_EXPIRED
    assert odrive.AxisState(heartbeat.axis_state) is odrive.AxisState.IDLE
    assert odrive.ProcedureResult(heartbeat.procedure_result) is odrive.ProcedureResult.DISARMED


def test_reads_the_heartbeat_captured_from_an_idle_drive() -> None:
    heartbeat = DB.axis(5).heartbeat.unpack(bytes.fromhex("0000000001000100"))
    assert heartbeat == (0, odrive.AxisState.IDLE, odrive.ProcedureResult.SUCCESS, 1)


def test_short_frames_are_read_where_the_drive_accepts_them() -> None:
    axis = DB.axis(2)
    assert axis.set_axis_state.unpack(b"\x08\0\0\0").axis_requested_state == 8
    assert axis.set_input_torque.unpack(struct.pack("<f", 0.5)).input_torque == 0.5
    assert axis.address.unpack(b"\x05\x01\0\0\0\0\0") == (5, 1, 0)


@pytest.mark.parametrize("codec", [c for c in CODECS if c.length], ids=lambda codec: codec.name)
def test_shorter_frames_are_refused_by_name(codec: Codec[Any]) -> None:
    with pytest.raises(FrameTooShort, match=codec.name):
        codec.unpack(b"\0" * (codec.min_length - 1))


def test_values_beyond_the_bits_are_clamped() -> None:
    target = DB.bearing_sensor().target
    high = target.unpack(target.pack(99, 999, 5000, 9, 99, 4.0, 1.0))
    assert high == pytest.approx((15, 255, 1023, 3, 15, 3.2767, 0.1275))
    low = target.unpack(target.pack(-1, -1, -1, -1, -1, -4.0, -1.0))
    assert low == pytest.approx((0, 0, 0, 0, 0, -3.2768, 0.0))
    assert DB.axis(1).set_input_vel.pack(1e300, -1e300) == struct.pack(
        "<ff", FLOAT32_MAX, -FLOAT32_MAX
    )


def test_values_are_rounded_not_cut() -> None:
    angle = DB.vehicle_aux().steering_angle
    packed = angle.pack(1, 1, 0, 0, angle=-0.12346, rate=0.0006, sample_time=0.09)
    assert angle.unpack(packed)[4:] == pytest.approx((-0.1235, 0.001, 0.1))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_integer_signal_refuses_what_is_not_finite(value: float) -> None:
    with pytest.raises(NonFiniteSignal, match="Bearing"):
        DB.bearing_sensor().target.pack(0, 0, 0, 0, 0, value, 0.0)


def test_a_float_signal_carries_nan_and_infinity() -> None:
    estimates = DB.axis(1).get_encoder_estimates
    row = estimates.unpack(estimates.pack(math.nan, -math.inf))
    assert math.isnan(row.pos_estimate)
    assert row.vel_estimate == -math.inf


def test_identifiers_follow_the_plan() -> None:
    assert DB.axis(62).heartbeat.can_id == 62 * 32 + 1
    assert [DB.bearing_sensor(unit).frame.can_id for unit in range(3)] == [0x120, 0x140, 0x160]
    assert DB.bearing_sensor(2).target.e2e_data_id == 0x161
    assert [codec.can_id for codec in DB.vehicle_aux()] == [0x010, 0x011, 0x012, 0x060]
    identifiers = [codec.can_id for codec in CODECS]
    assert len(set(identifiers)) == len(identifiers)


@pytest.mark.parametrize(
    ("enum", "message", "signal"),
    [
        (odrive.AxisState, "Drive_Heartbeat", "Axis_State"),
        (odrive.ProcedureResult, "Drive_Heartbeat", "Procedure_Result"),
        (odrive.ControlMode, "Drive_Set_Controller_Mode", "Control_Mode"),
        (odrive.InputMode, "Drive_Set_Controller_Mode", "Input_Mode"),
        (odrive.RebootAction, "Drive_Reboot", "Action"),
        (odrive.SdoOpcode, "Drive_RxSdo", "Opcode"),
        (vehicle.TargetClass, "Brg_Target", "Target_Class"),
        (vehicle.SensorState, "Brg_Health", "Sensor_State"),
        (vehicle.RequestedState, "Brg_Command", "Requested_State"),
        (vehicle.EstopSource, "Sys_Estop", "Estop_Source"),
        (vehicle.HostState, "Sys_Host_Heartbeat", "Host_State"),
    ],
)
def test_enumerations_say_what_the_dbc_says(enum: Any, message: str, signal: str) -> None:
    choices = REFERENCE.get_message_by_name(message).get_signal_by_name(signal).choices
    assert choices is not None
    assert {int(item): item.name for item in enum} == {n: str(c) for n, c in choices.items()}


@pytest.mark.parametrize(
    ("dbc", "old", "new", "named"),
    [
        (AXIS_DBC, "Axis_Heartbeat", "Axis_Pulse", "heartbeat"),
        (AXIS_DBC, " Axis_State ", " State ", "axis_state"),
        (AXIS_DBC, "Axis_Set_Input_Vel: 8", "Axis_Set_Input_Vel: 9", "Axis_Set_Input_Vel"),
        (AXIS_DBC, "SIG_VALTYPE_ 13 Input_Vel : 1;", "", "Input_Vel"),
        (BEARING_SENSOR_DBC, "(0.0001,0)", "(1,0)", "Bearing"),
        (BEARING_SENSOR_DBC, "Brg_Target_CRC : 0|8@1+", "Brg_Target_CRC : 0|7@1+", "Brg_Target"),
        (VEHICLE_AUX_DBC, "Angle : 16|16@1-", "Angle : 23|16@0-", "SteerEnc_Angle"),
        (VEHICLE_AUX_DBC, "BO_ 16", "BO_ sixteen", VEHICLE_AUX_DBC),
    ],
)
def test_a_dbc_that_does_not_match_is_named(dbc: str, old: str, new: str, named: str) -> None:
    texts = {name: template_text(name) for name in (AXIS_DBC, BEARING_SENSOR_DBC, VEHICLE_AUX_DBC)}
    assert old in texts[dbc]
    texts[dbc] = texts[dbc].replace(old, new)
    with pytest.raises(DatabaseMismatch) as caught:
        CanDatabase.from_texts(*texts.values())
    assert dbc in str(caught.value)
    assert named in str(caught.value)
