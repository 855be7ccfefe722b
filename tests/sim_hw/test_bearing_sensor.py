"""What the emulated bearing sensor reports, against geometry worked out here."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from config.angles import wrap
from config.can.frame import Frame
from config.can.vehicle import BearingFrame, BearingHealth, BearingTarget, SensorState, TargetClass
from config.fleet import BearingSensor as SensorConfig
from config.fleet import Marker, SimulatedBearings
from sim_hw.bearing_sensor import BearingSensor, MarkedVehicle
from sim_hw.vehicle import Vehicle
from tests.sim_hw.fleets import database

EXACT = SimulatedBearings(std_rad=0.0, latency_s=0.0)
RESOLUTION_RAD = 1e-4


class Look(NamedTuple):
    """One look as it came over the bus."""

    t_s: float
    header: BearingFrame
    targets: list[BearingTarget]


def vehicle(
    x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0, steering_rad: float = 0.0
) -> Vehicle:
    at = Vehicle(0.25, x_m, y_m, heading_rad)
    at.steering_rad = steering_rad
    return at


def looks(
    own: Vehicle,
    landmarks: list[Marker],
    others: list[MarkedVehicle] | None = None,
    config: SensorConfig | None = None,
    errors: SimulatedBearings = EXACT,
    duration_s: float = 0.02,
    seed: int = 1,
) -> list[Look]:
    """Every look of a sensor that stands still, decoded from its frames."""
    codecs = database().bearing_sensor((config or SensorConfig()).unit)
    sensor = BearingSensor(
        codecs,
        config or SensorConfig(),
        errors,
        landmarks,
        50.0,
        np.random.default_rng(seed),
        np.random.default_rng(0),
    )
    found: list[Look] = []
    for frame in run(sensor, own, others or [], duration_s):
        if frame.can_id == codecs.frame.can_id:
            found.append(Look(frame.t_s, codecs.frame.unpack(frame.data), []))
        elif frame.can_id == codecs.target.can_id:
            found[-1].targets.append(codecs.target.unpack(frame.data))
    return found


def run(
    sensor: BearingSensor, own: Vehicle, others: list[MarkedVehicle], duration_s: float
) -> list[Frame]:
    frames: list[Frame] = []
    for step in range(1, round(duration_s * 1000) + 1):
        frames += sensor.advance(50.0 + step * 0.001, own, others)
    return frames


def bearings(own: Vehicle, landmarks: list[Marker], config: SensorConfig) -> list[float]:
    return [target.bearing for target in looks(own, landmarks, config=config)[0].targets]


def test_a_body_sensor_measures_from_the_heading_and_its_mounting_yaw() -> None:
    own = vehicle(1.0, 2.0, heading_rad=0.4, steering_rad=0.3)
    seen = bearings(own, [Marker(id=1, x_m=4.0, y_m=6.0)], SensorConfig(yaw_rad=-0.2))
    assert seen == [pytest.approx(math.atan2(4.0, 3.0) - 0.4 + 0.2, abs=RESOLUTION_RAD)]


def test_a_fork_sensor_turns_with_the_steering() -> None:
    own = vehicle(1.0, 2.0, heading_rad=0.4, steering_rad=0.3)
    config = SensorConfig(mounting="fork", yaw_rad=-0.2)
    seen = bearings(own, [Marker(id=1, x_m=4.0, y_m=6.0)], config)
    assert seen == [pytest.approx(math.atan2(4.0, 3.0) - 0.4 - 0.3 + 0.2, abs=RESOLUTION_RAD)]


def test_left_is_positive_and_behind_is_pi() -> None:
    marks = [Marker(id=1, x_m=0, y_m=1), Marker(id=2, x_m=0, y_m=-2), Marker(id=3, x_m=-3, y_m=0)]
    assert bearings(vehicle(), marks, SensorConfig()) == pytest.approx(
        [math.pi / 2, -math.pi / 2, math.pi], abs=RESOLUTION_RAD
    )


def test_markers_of_another_robot_are_seen_where_its_pose_puts_them() -> None:
    other = vehicle(2.0, 1.0, heading_rad=math.pi / 2)
    marks = [Marker(id=20, x_m=0.0, y_m=0.0), Marker(id=21, x_m=-0.5, y_m=0.25)]
    look = looks(vehicle(), [], [MarkedVehicle(other, marks)])[0]
    by_id = {target.target_id: target for target in look.targets}
    assert by_id[20].bearing == pytest.approx(math.atan2(1.0, 2.0), abs=RESOLUTION_RAD)
    assert by_id[21].bearing == pytest.approx(math.atan2(0.5, 1.75), abs=RESOLUTION_RAD)
    assert {target.target_class for target in look.targets} == {TargetClass.ROBOT}


def test_landmarks_are_classed_as_landmarks() -> None:
    look = looks(vehicle(), [Marker(id=7, x_m=1, y_m=1)])[0]
    assert [(t.target_id, t.target_class) for t in look.targets] == [(7, TargetClass.LANDMARK)]


def test_targets_outside_the_field_of_view_or_the_range_are_not_seen() -> None:
    marks = [
        Marker(id=1, x_m=math.cos(0.49), y_m=math.sin(0.49)),
        Marker(id=2, x_m=math.cos(0.51), y_m=math.sin(0.51)),
        Marker(id=3, x_m=4.9, y_m=0),
        Marker(id=4, x_m=5.1, y_m=0),
    ]
    look = looks(
        vehicle(),
        marks,
        config=SensorConfig(fov_half_rad=0.5),
        errors=EXACT.model_copy(update={"range_m": 5.0}),
    )[0]
    assert [target.target_id for target in look.targets] == [1, 3]


def test_a_look_that_sees_nothing_is_reported() -> None:
    seen = looks(vehicle(), [], duration_s=0.1)
    assert [look.header.n_targets for look in seen] == [0] * 10
    assert all(look.header.frame_valid for look in seen)


def test_the_sixteen_nearest_of_too_many_targets_are_sent_and_the_frame_says_so() -> None:
    marks = [Marker(id=n, x_m=20.0 - n, y_m=0.0) for n in range(18)]
    look = looks(vehicle(), marks)[0]
    assert look.header.n_targets == 16
    assert look.header.targets_truncated == 1
    assert [target.target_id for target in look.targets] == list(range(17, 1, -1))
    assert [target.slot for target in look.targets] == list(range(16))
    fits = looks(vehicle(), marks[:16])[0]
    assert (fits.header.n_targets, fits.header.targets_truncated) == (16, 0)


def test_looks_come_at_the_rate_of_the_sensor_with_counted_numbers() -> None:
    seen = looks(vehicle(), [], config=SensorConfig(rate_hz=30.0), duration_s=10.0)
    assert len(seen) == pytest.approx(300, abs=1)
    assert np.diff([look.t_s for look in seen]) == pytest.approx(1 / 30, abs=0.0011)
    assert set(np.diff([look.header.capture_id for look in seen])) == {1, -255}


def test_latency_delays_the_frames_and_is_told() -> None:
    moving = vehicle()
    codecs = database().bearing_sensor(0)
    errors = SimulatedBearings(std_rad=0.0, latency_s=0.0257, range_m=2000.0)
    sensor = BearingSensor(
        codecs,
        SensorConfig(),
        errors,
        [Marker(id=1, x_m=1000.0, y_m=0.0)],
        50.0,
        np.random.default_rng(3),
        np.random.default_rng(4),
    )
    headers: list[tuple[Frame, BearingFrame]] = []
    told_rad: list[float] = []
    for step in range(1, 501):
        t_s = 50.0 + step * 0.001
        moving.heading_rad = -(t_s - 50.0)
        for frame in sensor.advance(t_s, moving, []):
            if frame.can_id == codecs.frame.can_id:
                headers.append((frame, codecs.frame.unpack(frame.data)))
            if frame.can_id == codecs.target.can_id:
                told_rad.append(codecs.target.unpack(frame.data).bearing)
    assert all(header.latency == pytest.approx(25.7) for _, header in headers)
    captured_s = [frame.t_s - 0.0257 for frame, _ in headers]
    assert told_rad == pytest.approx([t - 50.0 for t in captured_s], abs=2 * RESOLUTION_RAD)
    clock_ms = np.diff([header.capture_time for _, header in headers]) % 6553.6
    assert clock_ms == pytest.approx(np.diff(captured_s) * 1e3, abs=0.11)


def test_noise_has_the_deviation_and_bias_asked_for_and_is_white() -> None:
    errors = SimulatedBearings(std_rad=0.05, bias_rad=0.01, latency_s=0.0)
    mark = Marker(id=1, x_m=1.0, y_m=0.0)
    seen = looks(vehicle(), [mark], errors=errors, duration_s=40.0)
    values = np.array([look.targets[0].bearing for look in seen])
    assert len(values) == 4000
    assert values.mean() == pytest.approx(0.01, abs=4 * 0.05 / math.sqrt(4000))
    assert values.std() == pytest.approx(0.05, rel=4 / math.sqrt(2 * 4000))
    centred = values - values.mean()
    correlation = float((centred[1:] * centred[:-1]).mean() / centred.var())
    assert abs(correlation) < 4 / math.sqrt(4000)
    assert seen[0].targets[0].bearing_std == pytest.approx(0.05)


def test_noise_across_the_cut_at_pi_stays_wrapped() -> None:
    errors = SimulatedBearings(std_rad=0.05, latency_s=0.0)
    seen = looks(vehicle(), [Marker(id=1, x_m=-1, y_m=0)], errors=errors, duration_s=5.0)
    values = [look.targets[0].bearing for look in seen]
    assert max(abs(value) for value in values) <= math.pi + RESOLUTION_RAD
    deviations = np.array([wrap(value - math.pi) for value in values])
    assert deviations.std() == pytest.approx(0.05, rel=0.2)
    assert min(values) < 0 < max(values)


def test_dropouts_hit_single_targets_with_the_probability_asked_for() -> None:
    errors = EXACT.model_copy(update={"dropout": 0.2})
    marks = [Marker(id=1, x_m=1, y_m=0), Marker(id=2, x_m=0, y_m=1)]
    seen = looks(vehicle(), marks, errors=errors, duration_s=20.0)
    counts = np.bincount([len(look.targets) for look in seen], minlength=3) / len(seen)
    assert counts == pytest.approx([0.04, 0.32, 0.64], abs=0.05)
    assert all(look.header.n_targets == len(look.targets) for look in seen)


def test_health_is_sent_ten_times_a_second_and_describes_the_sensor() -> None:
    codecs = database().bearing_sensor(1)
    config = SensorConfig(unit=1, fov_half_rad=1.0, rate_hz=30.0)
    sensor = BearingSensor(
        codecs, config, EXACT, [], 50.0, np.random.default_rng(1), np.random.default_rng(2)
    )
    frames = run(sensor, vehicle(), [], 3.0)
    rows: list[BearingHealth] = [
        codecs.health.unpack(f.data) for f in frames if f.can_id == codecs.health.can_id
    ]
    assert len(rows) == 31
    assert {row.sensor_state for row in rows} == {SensorState.RUNNING}
    assert rows[0].fov_half == pytest.approx(1.0, abs=0.0125)
    assert rows[0].frame_rate == 30.0
    assert [row.uptime for row in rows[::10]] == [0, 1, 2, 3]
