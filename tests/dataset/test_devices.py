"""A recording as devices on the bus: what the frames say is what was recorded, and no more."""

import itertools
import math
from pathlib import Path

import pytest

from config.angles import wrap
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.vehicle import TargetClass
from groundstation.dataset_fleet import LOOP_HZ, WHEELBASE_M, dataset_fleet
from sim_hw.dataset.devices import PlaybackRobot
from sim_hw.dataset.mrclam import BearingRow, OdometryRow, Recording, read_recording
from sim_hw.dataset.virtual_car import VirtualCar
from tests.dataset.synthetic import write_data_set

T0_S = 5.0
DATABASE = CanDatabase.load()


def frames_of(recording: Recording, seconds: float) -> list[Frame]:
    """Everything that the devices send from the recording's start on."""
    config = dataset_fleet({1: recording}, "known").robots["r1"]
    robot = PlaybackRobot(config, recording, DATABASE, T0_S)
    robot.play(T0_S)
    frames: list[Frame] = []
    for tick in range(round(seconds * LOOP_HZ)):
        robot.advance(T0_S + tick / LOOP_HZ)
        frames += robot.collect()
    return frames


@pytest.mark.parametrize(("speed", "rate"), [(0.08, 0.3), (0.0, 0.5), (0.05, -0.4)])
def test_the_virtual_car_turns_its_fork_as_the_unicycle_turns(speed: float, rate: float) -> None:
    """Body and encoder integrated at the robot's own rate give the commanded direction."""
    rows = [OdometryRow(-1.0, speed, rate), OdometryRow(60.0, 0.0, 0.0)]
    car = VirtualCar(WHEELBASE_M, rows, 0.0)
    body, last, turned = 0.0, 0.0, 0.0
    for tick in range(1, 1201):
        car.advance(tick / LOOP_HZ)
        angle = wrap(car.steering_rad)
        change = wrap(angle - last)
        body += speed / WHEELBASE_M / LOOP_HZ * math.sin(last + 0.5 * change)
        turned += change
        last = angle
    assert body + turned == pytest.approx(rate * 60.0, abs=0.005)
    assert car.way_m == pytest.approx(speed * 60.0)


def test_a_turn_on_the_spot_winds_the_encoder_round(data_set: Path) -> None:
    recording = read_recording(data_set, 1)._replace(
        odometry=(
            OdometryRow(99.0, 0.0, 0.5),
            OdometryRow(120.0, 0.0, 0.0),
        ),
        bearings=(),
        start_s=100.0,
        end_s=120.0,
    )
    codec = DATABASE.vehicle_aux().steering_angle
    angles = [
        codec.unpack(frame.data).angle
        for frame in frames_of(recording, 20.0)
        if frame.can_id == codec.can_id
    ]
    assert max(angles) == pytest.approx(math.pi, abs=0.03)
    assert min(angles) == pytest.approx(-math.pi, abs=0.03)
    steps = [wrap(two - one) for one, two in itertools.pairwise(angles)]
    assert steps == pytest.approx([0.5 / LOOP_HZ] * len(steps), abs=2e-4)


def test_the_drive_reports_a_velocity_whose_integral_is_the_way(data_set: Path) -> None:
    recording = read_recording(data_set, 1)
    vehicle = dataset_fleet({1: recording}, "known").robots["r1"].vehicle
    codec = DATABASE.axis(vehicle.drive.node).get_encoder_estimates
    estimates = [
        codec.unpack(frame.data)
        for frame in frames_of(recording, 30.0)
        if frame.can_id == codec.can_id
    ]
    way_rev = sum(each.vel_estimate for each in estimates) / LOOP_HZ
    assert way_rev == pytest.approx(estimates[-1].pos_estimate, rel=1e-5)
    assert estimates[-1].pos_estimate > 0.5 * vehicle.drive.revolutions_per_unit


def test_bearings_of_one_instant_are_one_look_and_the_sensor_stays_alive(data_set: Path) -> None:
    recording = read_recording(data_set, 1)
    seen = tuple(BearingRow(recording.start_s + 1.013, subject, 0.1) for subject in (6, 7, 2))
    frames = frames_of(recording._replace(bearings=seen), 3.0)
    codecs = DATABASE.bearing_sensor(0)
    headers = [(f.t_s, codecs.frame.unpack(f.data)) for f in frames if f.can_id == 288]
    targets = [(f.t_s, codecs.target.unpack(f.data)) for f in frames if f.can_id == 289]
    assert len(headers) >= 3.0 * LOOP_HZ
    assert [header.n_targets for _, header in headers if header.n_targets] == [3]
    assert [t_s for t_s, _ in targets] == pytest.approx([T0_S + 1.013] * 3)
    kinds = {target.target_id: target.target_class for _, target in targets}
    assert kinds == {6: TargetClass.LANDMARK, 7: TargetClass.LANDMARK, 2: TargetClass.ROBOT}


def test_more_bearings_than_a_look_can_carry_become_two_looks(data_set: Path) -> None:
    recording = read_recording(data_set, 1)
    seen = tuple(BearingRow(recording.start_s + 1.0, 6, 0.01 * each) for each in range(20))
    codec = DATABASE.bearing_sensor(0).frame
    counts = [
        header.n_targets
        for frame in frames_of(recording._replace(bearings=seen), 2.0)
        if frame.can_id == codec.can_id and (header := codec.unpack(frame.data)).n_targets
    ]
    assert counts == [16, 4]


def test_the_recording_waits_for_the_host(data_set: Path) -> None:
    recording = read_recording(data_set, 1)
    config = dataset_fleet({1: recording}, "known").robots["r1"]
    robot = PlaybackRobot(config, recording, DATABASE, T0_S)
    robot.advance(T0_S + 3.0)
    assert robot.started_s is None
    assert robot.truth.x_m == pytest.approx(1.0)
    robot.deliver(Frame(18, bytes(4), T0_S + 3.0))
    robot.advance(T0_S + 8.0)
    assert robot.started_s == pytest.approx(T0_S + 3.0)
    assert math.hypot(robot.truth.x_m - 1.0, robot.truth.y_m + 1.0) > 0.2


def test_ranges_change_no_byte_on_the_bus(tmp_path: Path) -> None:
    sent = []
    for range_m in (1.0, 7.7):
        folder = tmp_path / str(range_m)
        folder.mkdir()
        write_data_set(folder, range_m=range_m)
        sent.append(frames_of(read_recording(folder, 1), 40.0))
    assert sent[0] == sent[1]
    assert any(frame.can_id == 289 for frame in sent[0])
