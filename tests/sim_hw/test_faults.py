"""Every kind of fault does to its device what its documentation says, as seen on the bus."""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import cantools
import numpy as np
import pytest
from cantools.database.can import Database
from e2e.p02 import e2e_p02_check

from config.can.database import AXIS_DBC, BEARING_SENSOR_DBC, VEHICLE_AUX_DBC, template_text
from config.can.frame import Frame
from config.can.odrive import AxisError, AxisState, ControlMode, InputMode
from config.faults import DEVICES, DOC_PATH, KINDS, Fault, kinds_of, table
from config.fleet import SimulatedBearings, Simulation
from sim_hw.error_frames import ERROR_FLAG
from sim_hw.fleet import FaultRefused, SimulatedFleet
from tests.sim_hw.fleets import (
    DRIVE_NODE,
    DRIVE_REV_PER_M,
    EXACT,
    STEERING_NODE,
    STEERING_REV_PER_RAD,
    database,
    fleet,
    frame,
)

SPEED_MPS, ANGLE_RAD = 1.0, 0.2
FAULT_S = 1.0
NODES = {"steering": STEERING_NODE, "drive": DRIVE_NODE}


def _loaded(dbc: str) -> Database:
    found = cantools.database.load_string(template_text(dbc), "dbc")
    assert isinstance(found, Database)
    return found


AXIS, SENSOR, AUX = _loaded(AXIS_DBC), _loaded(BEARING_SENSOR_DBC), _loaded(VEHICLE_AUX_DBC)
IDS = {"estimates": 0x09, "heartbeat": 0x01, "angle": 0x060, "look": 0x120, "target": 0x121}


class Row(NamedTuple):
    """One message as cantools reads it."""

    t_s: float
    values: dict[str, Any]


class Run(NamedTuple):
    """A robot that drives from 0 s on and has one fault from 1 s on."""

    sim: SimulatedFleet
    frames: list[Frame]

    def of(self, can_id: int, from_s: float = 0.0, to_s: float = 99.0) -> list[Row]:
        """The messages with an identifier in a stretch of time."""
        node, template = can_id // 32, can_id
        source = AUX if node == 3 else SENSOR
        if node in NODES.values():
            source, template = AXIS, can_id % 32
        message = source.get_message_by_frame_id(template)
        return [
            Row(sent.t_s, dict(message.decode_simple(sent.data, decode_choices=False)))
            for sent in self.frames
            if sent.can_id == can_id and from_s < sent.t_s <= to_s
        ]

    def estimates(self, device: str, from_s: float = 0.0, to_s: float = 99.0) -> list[Row]:
        return self.of(NODES[device] * 32 + IDS["estimates"], from_s, to_s)

    def heartbeats(self, device: str, from_s: float = 0.0, to_s: float = 99.0) -> list[Row]:
        return self.of(NODES[device] * 32 + IDS["heartbeat"], from_s, to_s)

    def angles(self, from_s: float = 0.0, to_s: float = 99.0) -> list[Row]:
        return self.of(IDS["angle"], from_s, to_s)

    def bearings(self, from_s: float = 0.0, to_s: float = 99.0) -> list[float]:
        """To landmark 1."""
        rows = self.of(IDS["target"], from_s, to_s)
        return [row.values["Bearing"] for row in rows if row.values["Target_Id"] == 1]


@lru_cache(maxsize=1)
def healthy() -> Run:
    """Without a fault."""
    return run()


def run(
    *faults: Fault,
    until_s: float = 2.0,
    commands: bool = True,
    seed: int = 1,
    errors: Simulation = EXACT,
) -> Run:
    """Drive straight on; the faults begin at `FAULT_S`."""
    sim = SimulatedFleet(fleet(1, errors), seed, 0.0, database())
    robot, frames = sim.robots["r1"], []
    for fault in faults:
        sim.inject(fault, FAULT_S)
    axes = {name: database().axis(node) for name, node in NODES.items()}
    modes = {"steering": ControlMode.POSITION_CONTROL, "drive": ControlMode.VELOCITY_CONTROL}
    for name, axis in axes.items():
        robot.deliver(frame(axis.set_controller_mode, 0.0, modes[name], InputMode.PASSTHROUGH))
        robot.deliver(frame(axis.set_axis_state, 0.0, AxisState.CLOSED_LOOP_CONTROL))
    for tick in range(round(until_s * 100)):
        t_s = tick * 0.01
        angle, speed = ANGLE_RAD * STEERING_REV_PER_RAD, SPEED_MPS * DRIVE_REV_PER_M
        if commands:
            robot.deliver(frame(axes["steering"].set_input_pos, t_s, angle, 0.0, 0.0))
            robot.deliver(frame(axes["drive"].set_input_vel, t_s, speed, 0.0))
        sim.advance(t_s + 0.01)
        frames += robot.collect()
    return Run(sim, frames)


def fault(device: str, kind: str, value: float | None = None, for_s: float | None = None) -> Fault:
    return Fault(robot="r1", device=device, kind=kind, value=value, for_s=for_s)


def reports(done: Run, device: str, from_s: float, to_s: float = 99.0) -> list[Row]:
    """The measurements of a device."""
    if device in NODES:
        return done.estimates(device, from_s, to_s)
    return done.angles(from_s, to_s) if device == "encoder" else done.of(0x120, from_s, to_s)


EVERY_DEVICE = [device for device in DEVICES if device != "bus"]
DRIVES = list(NODES)


@pytest.mark.parametrize("device", EVERY_DEVICE)
def test_off_is_silence_and_ends_with_the_fault(device: str) -> None:
    done = run(fault(device, "off", for_s=0.5), until_s=2.5)
    assert len(reports(done, device, 0.5, FAULT_S)) == pytest.approx(50, abs=1)
    assert reports(done, device, FAULT_S + 0.011, FAULT_S + 0.5) == []
    assert len(reports(done, device, FAULT_S + 0.52, FAULT_S + 1.02)) == pytest.approx(50, abs=2)


def test_a_drive_without_power_coasts_and_comes_back_idle_and_unreferenced() -> None:
    done = run(fault("drive", "off", for_s=1.0), until_s=2.5)
    assert done.sim.robots["r1"].truth.speed_mps == 0.0
    back = done.heartbeats("drive", 2.0)
    assert back[0].values["Axis_State"] == AxisState.IDLE
    assert back[0].values["Axis_Error"] == AxisError.INITIALIZING
    assert abs(done.estimates("drive", 2.0)[0].values["Pos_Estimate"]) < 0.01


@pytest.mark.parametrize("device", DRIVES)
def test_a_mute_drive_sends_nothing_and_obeys(device: str) -> None:
    done = run(fault(device, "mute"))
    assert reports(done, device, FAULT_S + 0.011) == []
    assert done.heartbeats(device, FAULT_S + 0.011) == []
    truth = done.sim.robots["r1"].truth
    assert truth.speed_mps == pytest.approx(SPEED_MPS, abs=1e-3)
    assert truth.steering_rad == pytest.approx(ANGLE_RAD, abs=1e-3)


def test_stuck_estimates_freeze_while_the_motor_goes_on() -> None:
    done = run(fault("drive", "stuck"))
    held = {tuple(row.values.values()) for row in done.estimates("drive", FAULT_S + 0.011)}
    assert len(held) == 1
    assert done.sim.robots["r1"].drive.axis.position_rev > 1.9 * DRIVE_REV_PER_M


def test_a_stuck_encoder_repeats_its_angle_with_good_protection() -> None:
    done = run(fault("encoder", "stuck"))
    rows = done.angles(FAULT_S + 0.011)
    assert len({row.values["Angle"] for row in rows}) == 1
    assert all(row.values["Angle_Valid"] for row in rows)
    _assert_protected(done, 0x060)


@pytest.mark.parametrize("std_rad", [0.0, 0.05])
def test_a_stuck_sensor_repeats_its_last_look_under_new_numbers(std_rad: float) -> None:
    errors = EXACT.model_copy(update={"bearings": SimulatedBearings(std_rad=std_rad)})
    done = run(fault("bearing", "stuck"), errors=errors)
    assert len({round(b, 4) for b in done.bearings(FAULT_S + 0.03)}) == 1
    assert len({round(b, 4) for b in done.bearings(0.5, FAULT_S)}) > 30
    numbers = {row.values["Capture_Id"] for row in done.of(0x120, FAULT_S + 0.03)}
    assert len(numbers) > 90
    _assert_protected(done, 0x121)


def _assert_protected(done: Run, can_id: int) -> None:
    low, high = can_id & 0xFF, can_id >> 8
    id_list = bytes((low + 17 * c + high * (2 * c + 1)) & 0xFF for c in range(16))
    sent = [f.data for f in done.frames if f.can_id == can_id]
    assert all(e2e_p02_check(data, id_list, length=0) for data in sent)
    counters = [data[1] & 0x0F for data in sent]
    assert set(np.diff(counters) % 16) == {1}


@pytest.mark.parametrize("device", EVERY_DEVICE)
def test_garbage_is_spread_over_its_whole_range(device: str) -> None:
    done = run(fault(device, "garbage"), until_s=3.0)
    values, width = _measured(done, device, FAULT_S + 0.03), math.pi
    if device in NODES:
        width = 100.0
    assert len(values) > 150
    assert max(map(abs, values)) <= width + 1e-3
    assert max(values) > 0.9 * width
    assert min(values) < -0.9 * width


def _measured(done: Run, device: str, from_s: float) -> list[float]:
    if device == "bearing":
        return done.bearings(from_s)
    name = "Angle" if device == "encoder" else "Vel_Estimate"
    return [row.values[name] for row in reports(done, device, from_s)]


def test_wrong_devices_are_off_by_the_value() -> None:
    right = healthy()
    steering = run(fault("steering", "wrong", 0.25)).estimates("steering")
    assert steering[-1].values["Pos_Estimate"] == pytest.approx(
        right.estimates("steering")[-1].values["Pos_Estimate"] + 0.25 * STEERING_REV_PER_RAD
    )
    encoder = run(fault("encoder", "wrong", -0.25)).angles()
    assert encoder[-1].values["Angle"] == pytest.approx(ANGLE_RAD - 0.25, abs=1e-3)
    sensor = run(fault("bearing", "wrong", 0.25)).bearings()
    assert sensor[-1] == pytest.approx(right.bearings()[-1] + 0.25, abs=3e-4)


def test_a_wrong_drive_counts_too_much_way_and_speed() -> None:
    rows = run(fault("drive", "wrong", 0.1), until_s=3.0).estimates("drive", FAULT_S + 0.02)
    assert rows[-1].values["Vel_Estimate"] == pytest.approx(1.1 * SPEED_MPS * DRIVE_REV_PER_M)
    way = rows[-1].values["Pos_Estimate"] - rows[0].values["Pos_Estimate"]
    elapsed_s = rows[-1].t_s - rows[0].t_s
    assert way == pytest.approx(1.1 * SPEED_MPS * DRIVE_REV_PER_M * elapsed_s, rel=0.01)


@pytest.mark.parametrize("device", EVERY_DEVICE)
def test_slow_devices_report_a_fraction_of_the_time(device: str) -> None:
    done = run(fault(device, "slow", 4.0), until_s=3.0)
    assert len(reports(done, device, FAULT_S + 0.02, 2.98)) == pytest.approx(49, abs=2)


@pytest.mark.parametrize("device", EVERY_DEVICE)
def test_delayed_frames_come_late_but_all_of_them(device: str) -> None:
    prompt, late = healthy(), run(fault(device, "delayed", 0.3))
    assert reports(late, device, FAULT_S + 0.02, FAULT_S + 0.29) == []
    expected = [row.values for row in reports(prompt, device, FAULT_S, 1.65)]
    found = [row.values for row in reports(late, device, FAULT_S, 1.96)]
    assert found[: len(expected)] == expected


@pytest.mark.parametrize("device", EVERY_DEVICE)
def test_intermittent_devices_are_silent_half_of_the_time(device: str) -> None:
    done = run(fault(device, "intermittent", 0.1), until_s=3.0)
    for start_s in np.arange(FAULT_S, 2.9, 0.2):
        assert reports(done, device, start_s + 0.012, start_s + 0.1) == []
        assert len(reports(done, device, start_s + 0.1, start_s + 0.2)) in (9, 10, 11)


@pytest.mark.parametrize("device", DRIVES)
def test_estimates_that_are_no_numbers(device: str) -> None:
    rows = run(fault(device, "nan", for_s=0.5)).estimates(device, FAULT_S + 0.011)
    numbers = [math.isfinite(row.values["Pos_Estimate"]) for row in rows]
    assert not any(numbers[:49])
    assert all(numbers[51:])


@pytest.mark.parametrize(
    ("kind", "error", "after_s"),
    [
        ("failed", AxisError.DRV_FAULT, 0.0),
        ("undervolt", AxisError.DC_BUS_UNDER_VOLTAGE, 0.0),
        ("overheat", AxisError.INVERTER_OVER_TEMP, 0.5),
        ("disarm", AxisError(0), 0.0),
    ],
)
@pytest.mark.parametrize("device", DRIVES)
def test_a_drive_disarms_with_the_error_of_its_fault(
    device: str, kind: str, error: AxisError, after_s: float
) -> None:
    done = run(fault(device, kind))
    states = [row.values["Axis_State"] for row in done.heartbeats(device, 0.05, FAULT_S + after_s)]
    assert set(states) == {AxisState.CLOSED_LOOP_CONTROL}
    last = done.heartbeats(device, FAULT_S + after_s + 0.11)
    assert {row.values["Axis_State"] for row in last} == {AxisState.IDLE}
    assert {row.values["Axis_Error"] for row in last} == {error}


def test_voltage_and_temperature_are_told_on_request() -> None:
    sim = SimulatedFleet(fleet(1, EXACT), 1, 0.0, database())
    robot, axis = sim.robots["r1"], database().axis(DRIVE_NODE)
    sim.inject(fault("drive", "undervolt", 9.5))
    sim.inject(fault("drive", "overheat", 20.0))
    sim.advance(1.0)
    for codec in (axis.get_bus_voltage_current, axis.get_temperature):
        robot.deliver(Frame(codec.can_id, b"", 1.0, remote=True))
    sim.advance(1.01)
    done = Run(sim, robot.collect())
    voltage = done.of(axis.get_bus_voltage_current.can_id)[0].values["Bus_Voltage"]
    assert voltage == pytest.approx(9.5)
    temperature = done.of(axis.get_temperature.can_id)[0].values["FET_Temperature"]
    assert temperature == pytest.approx(50.0, abs=0.2)


@pytest.mark.parametrize("device", DRIVES)
def test_a_restart_is_a_second_of_silence_and_then_idle(device: str) -> None:
    done = run(fault(device, "restart"), until_s=3.0)
    assert reports(done, device, FAULT_S + 0.011, FAULT_S + 1.0) == []
    assert done.heartbeats(device, 2.0)[0].values["Axis_State"] == AxisState.IDLE


def test_a_jammed_wheel_stands_and_a_jammed_fork_stays() -> None:
    wheel = run(fault("drive", "jammed"))
    assert wheel.sim.robots["r1"].truth.speed_mps == 0.0
    assert wheel.heartbeats("drive")[-1].values["Axis_State"] == AxisState.CLOSED_LOOP_CONTROL
    fork = SimulatedFleet(fleet(1, EXACT), 1, 0.0, database())
    fork.inject(fault("steering", "jammed"))
    axis = database().axis(STEERING_NODE)
    robot = fork.robots["r1"]
    for row in (
        frame(axis.set_controller_mode, 0.0, ControlMode.POSITION_CONTROL, InputMode.PASSTHROUGH),
        frame(axis.set_axis_state, 0.0, AxisState.CLOSED_LOOP_CONTROL),
        frame(axis.set_input_pos, 0.0, 1.0, 0.0, 0.0),
    ):
        robot.deliver(row)
    fork.advance(0.15)
    assert robot.truth.steering_rad == 0.0


def test_failed_sensors_say_so() -> None:
    angle = run(fault("encoder", "failed")).angles()[-1].values
    assert (angle["Angle_Valid"], angle["Fault_Internal"], angle["Fault_Magnet"]) == (0, 1, 1)
    health = run(fault("bearing", "failed")).of(0x122)[-1].values
    assert (health["Sensor_State"], health["Fault_Internal"]) == (4, 1)


def test_a_blind_sensor_looks_on_time_and_sees_nothing() -> None:
    done = run(fault("bearing", "blind"))
    looks = done.of(0x120, FAULT_S + 0.03)
    assert len(looks) == pytest.approx(97, abs=2)
    assert {row.values["N_Targets"] for row in looks} == {0}
    assert done.bearings(FAULT_S + 0.03) == []


RANDOM: list[Callable[[], Fault]] = [
    lambda: fault("bearing", "garbage"),
    lambda: fault("bus", "corruption", 0.3),
    lambda: fault("bus", "reordering", 0.3),
]


@pytest.mark.parametrize("make", RANDOM)
def test_the_seed_decides_what_is_random(make: Callable[[], Fault]) -> None:
    one, again, other = (run(make(), seed=seed).frames for seed in (1, 1, 2))
    assert one == again
    assert one != other


def test_a_fault_changes_nothing_before_it_begins() -> None:
    for device, kind in (("bearing", "garbage"), ("drive", "stuck")):
        early = [f for f in run(fault(device, kind)).frames if f.t_s < FAULT_S]
        assert early == [f for f in healthy().frames if f.t_s < FAULT_S]


@pytest.mark.parametrize("device", DEVICES)
def test_every_kind_begins_and_ends_and_leaves_a_healthy_device(device: str) -> None:
    sim = SimulatedFleet(fleet(1, EXACT), 1, 0.0, database())
    robot = sim.robots["r1"]
    for kind in kinds_of(device):
        sim.inject(fault(device, kind))
        sim.advance(sim.t_s + 0.05)
        sim.inject(fault(device, "ok"))
        assert robot.active_faults(device) == []
        sim.advance(sim.t_s + (1.1 if kind in ("off", "restart") else 0.2))
        robot.collect()
        sim.advance(sim.t_s + 0.15)
        heard = {f.can_id for f in robot.collect() if not f.can_id & ERROR_FLAG}
        assert {0x21, 0x29, 0x41, 0x49, 0x60, 0x120, 0x121, 0x122} <= heard


def test_the_same_kind_again_replaces_the_former_with_its_end() -> None:
    sim = SimulatedFleet(fleet(1), 1, 0.0, database())
    sim.inject(fault("encoder", "off", for_s=0.5))
    sim.advance(0.3)
    sim.inject(fault("encoder", "off", for_s=0.5))
    sim.advance(0.6)
    assert sim.robots["r1"].active_faults("encoder") == ["off"]
    sim.advance(0.81)
    assert sim.robots["r1"].active_faults("encoder") == []
    assert sim.take_notes() == ["r1 encoder: off for 0.5 s"] * 2 + ["r1 encoder: off ends"]


@pytest.mark.parametrize(
    ("wanted", "named"),
    [
        (Fault(robot="r9", device="drive", kind="off"), "no robot 'r9'; known are r1, r2"),
        (fault("baering", "off"), "no device 'baering'; did you mean 'bearing'"),
        (fault("bearing", "stukc"), "no fault of bearing 'stukc'; did you mean 'stuck'"),
        (fault("encoder", "nan"), "no fault of encoder 'nan'"),
        (fault("drive", "off", 3.0), "takes no value"),
        (fault("bus", "loss", 1.5), "1.5 is not allowed for loss: 0 to 1"),
        (fault("drive", "restart", for_s=1.0), "happens once: leave `for` out"),
    ],
)
def test_a_fault_that_cannot_be_is_refused_by_name(wanted: Fault, named: str) -> None:
    sim = SimulatedFleet(fleet(2), 1, 0.0, database())
    with pytest.raises(FaultRefused, match=named.replace("?", r"\?").replace("`", ".")):
        sim.inject(wanted)


def test_the_page_of_documentation_is_the_table_in_the_code() -> None:
    """If not: python -m config.faults"""
    assert DOC_PATH.read_text(encoding="utf-8") == table()
    assert all(f"`{row.name}`" in table() for row in KINDS)
