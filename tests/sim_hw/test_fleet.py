"""Whole simulated robots: their buses, their motion, their random streams."""

import math
from itertools import pairwise
from typing import Any

import cantools
import pytest
from cantools.database.can import Database
from e2e.p02 import e2e_p02_check

from config.can.database import AXIS_DBC, BEARING_SENSOR_DBC, VEHICLE_AUX_DBC, template_text
from config.can.frame import Frame
from config.can.odrive import AxisState, ControlMode, InputMode
from config.fleet import BearingSensor as SensorConfig
from config.fleet import Fleet, SimulatedBearings, Simulation
from sim_hw.fleet import SimulatedFleet
from sim_hw.robot import FRICTION_MPS2, STEERING_STOP_FACTOR, SimulatedRobot
from tests.sim_hw.fleets import (
    DRIVE_NODE,
    DRIVE_REV_PER_M,
    EXACT,
    LIMITS,
    STEERING_NODE,
    STEERING_REV_PER_RAD,
    WHEELBASE_M,
    database,
    fleet,
    frame,
)

START_S = 1000.0
STEERING = database().axis(STEERING_NODE)
DRIVE = database().axis(DRIVE_NODE)
PROTECTED_IDS = {0x060, 0x120, 0x121, 0x122}


def simulated(of: Fleet, seed: int = 1) -> SimulatedFleet:
    return SimulatedFleet(of, seed, START_S, database())


def arm(robot: SimulatedRobot, t_s: float) -> None:
    for codecs, mode in (
        (STEERING, ControlMode.POSITION_CONTROL),
        (DRIVE, ControlMode.VELOCITY_CONTROL),
    ):
        robot.deliver(frame(codecs.set_controller_mode, t_s, mode, InputMode.PASSTHROUGH))
        robot.deliver(frame(codecs.clear_errors, t_s, 0))
        robot.deliver(frame(codecs.set_axis_state, t_s, AxisState.CLOSED_LOOP_CONTROL))


def steer(robot: SimulatedRobot, t_s: float, speed_mps: float, steering_rad: float) -> None:
    angle_rev, speed_rps = steering_rad * STEERING_REV_PER_RAD, speed_mps * DRIVE_REV_PER_M
    robot.deliver(frame(STEERING.set_input_pos, t_s, angle_rev, 0.0, 0.0))
    robot.deliver(frame(DRIVE.set_input_vel, t_s, speed_rps, 0.0))


def drive(
    fleet_: SimulatedFleet, duration_s: float, speed_mps: float, steering_rad: float
) -> dict[str, list[Frame]]:
    """Steer every robot alike at 100 Hz; returns the frames of each bus."""
    frames: dict[str, list[Frame]] = {name: [] for name in fleet_.robots}
    begin_s = fleet_.t_s
    for step in range(round(duration_s * 100)):
        for robot in fleet_.robots.values():
            steer(robot, begin_s + step * 0.01, speed_mps, steering_rad)
        fleet_.advance(begin_s + (step + 1) * 0.01)
        for name, robot in fleet_.robots.items():
            frames[name] += robot.collect()
    return frames


def test_a_robot_at_rest_stays_where_the_fleet_file_puts_it() -> None:
    of = fleet(3)
    sim = simulated(of)
    sim.advance(START_S + 1.0)
    for name, robot in sim.robots.items():
        start = of.robots[name].start
        truth = robot.truth
        assert (truth.x_m, truth.y_m, truth.heading_rad) == (start.x_m, start.y_m, 0.5)
        assert truth.t_s == pytest.approx(START_S + 1.0)


def test_commands_over_the_bus_drive_the_circle_of_the_model() -> None:
    sim = simulated(fleet(1, EXACT))
    robot = sim.robots["r1"]
    arm(robot, START_S)
    drive(sim, 1.0, 1.0, 0.3)
    before = robot.truth
    drive(sim, 0.7, 1.0, 0.3)
    after = robot.truth
    assert after.steering_rad == pytest.approx(0.3, abs=1e-6)
    assert after.speed_mps == pytest.approx(1.0, abs=1e-6)
    turn_rad = 0.7 * 1.0 * math.sin(0.3) / WHEELBASE_M
    assert after.heading_rad - before.heading_rad == pytest.approx(turn_rad, abs=1e-5)
    chord_m = 2 * WHEELBASE_M / math.sin(0.3) * math.sin(turn_rad / 2)
    travelled_m = math.dist((after.x_m, after.y_m), (before.x_m, before.y_m))
    assert travelled_m == pytest.approx(chord_m, abs=1e-5)


def test_the_wheel_travels_further_than_the_encoder_says_by_the_scale_error() -> None:
    sim = simulated(fleet(8, Simulation(odometry_scale_error=0.02)))
    for robot in sim.robots.values():
        arm(robot, START_S)
    begin = {name: robot.truth for name, robot in sim.robots.items()}
    frames = drive(sim, 2.0, 1.0, 0.0)
    signs: set[float] = set()
    for name, robot in sim.robots.items():
        estimates = [f for f in frames[name] if f.can_id == DRIVE.get_encoder_estimates.can_id]
        counted_m = DRIVE.get_encoder_estimates.unpack(estimates[-1].data).pos_estimate / (
            DRIVE_REV_PER_M
        )
        truth = robot.truth
        counted_m += (truth.t_s - estimates[-1].t_s) * 1.0
        travelled_m = math.dist((truth.x_m, truth.y_m), (begin[name].x_m, begin[name].y_m))
        # A frame is stamped at its end on the bus, up to 0.7 ms after the count was taken.
        assert travelled_m / counted_m == pytest.approx(robot.odometry_scale, abs=4e-4)
        signs.add(round(robot.odometry_scale - 1.0, 6))
    assert signs == {0.02, -0.02}


def test_the_fork_turns_no_faster_than_its_limit_and_not_beyond_its_stop() -> None:
    sim = simulated(fleet(1, EXACT))
    robot = sim.robots["r1"]
    arm(robot, START_S)
    drive(sim, 0.2, 0.0, 3.0)
    assert robot.truth.steering_rad == pytest.approx(0.2 * LIMITS.steering_rate_radps, abs=0.01)
    drive(sim, 1.0, 0.0, 3.0)
    assert robot.truth.steering_rad == pytest.approx(STEERING_STOP_FACTOR * LIMITS.steering_rad)


def test_a_host_that_falls_silent_leaves_the_robot_coasting_with_its_fork_held() -> None:
    sim = simulated(fleet(1, EXACT))
    robot = sim.robots["r1"]
    arm(robot, START_S)
    drive(sim, 1.0, 2.0, 0.2)
    sim.advance(sim.t_s + 0.15)
    assert robot.truth.speed_mps == pytest.approx(2.0, abs=1e-3)
    sim.advance(sim.t_s + 0.05)
    coasting_from_s = sim.t_s
    sim.advance(coasting_from_s + 0.5)
    assert robot.truth.speed_mps == pytest.approx(2.0 - 0.5 * FRICTION_MPS2, abs=0.02)
    sim.advance(coasting_from_s + 2.0)
    assert robot.truth.speed_mps == 0.0
    assert robot.truth.steering_rad == pytest.approx(0.2, abs=1e-3)


def test_robots_see_landmarks_and_each_other_but_never_themselves() -> None:
    sim = simulated(fleet(3))
    sim.advance(START_S + 0.05)
    codec = database().bearing_sensor(0).target
    seen = {
        name: {codec.unpack(f.data).target_id for f in robot.collect() if f.can_id == codec.can_id}
        for name, robot in sim.robots.items()
    }
    landmarks = {1, 2, 3, 4}
    assert seen["r1"] == landmarks | {20, 21, 22, 30, 31, 32}
    assert seen["r2"] == landmarks | {10, 11, 12, 30, 31, 32}


def databases() -> list[Database]:
    """The shipped DBC files read by cantools, each with the identifiers of these robots."""
    texts = [
        template_text(BEARING_SENSOR_DBC),
        template_text(VEHICLE_AUX_DBC),
    ]
    return [_loaded(text) for text in texts]


def _loaded(text: str) -> Database:
    loaded = cantools.database.load_string(text, "dbc")
    assert isinstance(loaded, Database)
    return loaded


def _decoded(frame_: Frame, axis: Database, others: list[Database]) -> dict[str, Any]:
    if frame_.can_id >> 5 in (STEERING_NODE, DRIVE_NODE):
        message = axis.get_message_by_frame_id(frame_.can_id & 0x1F)
        return dict(message.decode_simple(frame_.data))
    for candidate in others:
        for message in candidate.messages:
            if message.frame_id == frame_.can_id:
                return dict(message.decode_simple(frame_.data))
    raise AssertionError(f"frame {frame_.can_id:#x} is in no database")


def test_every_frame_on_the_bus_is_in_the_database() -> None:
    sim = simulated(fleet(2))
    axis, others = _loaded(template_text(AXIS_DBC)), databases()
    for robot in sim.robots.values():
        arm(robot, START_S)
    frames = drive(sim, 0.5, 1.0, 0.1)["r1"]
    names: set[str] = set()
    for sent in frames:
        names |= _decoded(sent, axis, others).keys()
    assert {"Axis_State", "Pos_Estimate", "Angle", "Bearing", "Latency", "Uptime"} <= names


def test_every_frame_of_our_own_devices_carries_valid_protection_and_a_running_counter() -> None:
    sim = simulated(fleet(2))
    sim.advance(START_S + 0.5)
    counters: dict[int, int] = {}
    for sent in sim.robots["r2"].collect():
        if sent.can_id not in PROTECTED_IDS:
            continue
        low, high = sent.can_id & 0xFF, sent.can_id >> 8
        id_list = bytes((low + 17 * c + high * (2 * c + 1)) & 0xFF for c in range(16))
        assert e2e_p02_check(sent.data, id_list, length=0)
        counter = sent.data[1] & 0x0F
        assert counter == (counters.get(sent.can_id, counter - 1) + 1) % 16
        counters[sent.can_id] = counter
    assert counters.keys() == PROTECTED_IDS


def test_frames_come_in_the_order_of_the_bus() -> None:
    sim = simulated(fleet(2))
    sim.advance(START_S + 0.5)
    ends = [sent.t_s for sent in sim.robots["r1"].collect()]
    assert all(late - early > 90e-6 for early, late in pairwise(ends))
    assert sim.robots["r1"].collect() == []


def test_a_request_is_answered_as_soon_as_it_has_gone_over_the_bus() -> None:
    sim = simulated(fleet(1))
    sim.advance(START_S + 0.0201)
    robot = sim.robots["r1"]
    robot.collect()
    robot.deliver(Frame(DRIVE.get_version.can_id, b"", START_S + 0.0204, remote=True))
    sim.advance(START_S + 0.022)
    assert DRIVE.get_version.can_id in [sent.can_id for sent in robot.collect()]


def run_of(seed: int, names: list[str] | None = None) -> dict[str, list[Frame]]:
    sim = SimulatedFleet(fleet(2), seed, START_S, database(), names)
    for robot in sim.robots.values():
        arm(robot, START_S)
    return drive(sim, 0.3, 1.0, 0.1)


def test_the_same_seed_gives_the_same_frames_and_another_seed_others() -> None:
    assert run_of(5) == run_of(5)
    assert run_of(5) != run_of(6)


def test_robots_of_one_fleet_draw_different_noise() -> None:
    frames = run_of(5)
    angles = {
        name: [f.data for f in sent if f.can_id == 0x060][:5] for name, sent in frames.items()
    }
    assert angles["r1"] != angles["r2"]


def test_the_noise_of_a_robot_does_not_depend_on_which_others_are_simulated() -> None:
    together, alone = run_of(5)["r2"], run_of(5, ["r2"])["r2"]
    assert [f for f in together if f.can_id == 0x060] == [f for f in alone if f.can_id == 0x060]


def test_one_long_advance_equals_many_short_ones() -> None:
    long, short = simulated(fleet(2)), simulated(fleet(2))
    long.advance(START_S + 0.4)
    for step in range(1, 161):
        short.advance(START_S + step * 0.0025)
    assert long.robots["r1"].collect() == short.robots["r1"].collect()


def test_a_name_that_is_not_in_the_fleet_is_refused() -> None:
    with pytest.raises(KeyError, match="r9"):
        SimulatedFleet(fleet(2), 1, START_S, database(), ["r9"])


def test_a_narrow_slow_sensor_is_simulated_as_configured() -> None:
    sensor = SensorConfig(unit=2, rate_hz=20.0, fov_half_rad=0.3)
    sim = simulated(fleet(2, Simulation(bearings=SimulatedBearings(std_rad=0.0)), sensor))
    sim.advance(START_S + 1.0)
    frames = sim.robots["r2"].collect()
    assert len([f for f in frames if f.can_id == 0x160]) == pytest.approx(20, abs=1)
    codec = database().bearing_sensor(2).target
    seen = [abs(codec.unpack(f.data).bearing) for f in frames if f.can_id == 0x161]
    assert max(seen, default=0.0) <= 0.3
