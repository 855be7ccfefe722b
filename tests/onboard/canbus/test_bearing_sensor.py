"""The bearing sensor: frames come together to sets, and sets say what they lack."""

import math

import pytest

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.vehicle import TargetClass
from config.fleet import BearingSensor as Settings
from onboard.canbus.bearing_sensor import BearingSensor, BearingSet
from tests.onboard.canbus.fakes import bearing_header, bearing_health, bearing_target

HEADER_VECTOR = Frame(0x120, bytes.fromhex("73194dc3a1013930"), 3.0)


class Bench:
    """A receiver whose protection already trusts the sensor, and the sensor's counters."""

    def __init__(self, database: CanDatabase, settings: Settings | None = None) -> None:
        self.sensor = BearingSensor(database.bearing_sensor(0), settings or Settings())
        self.headers = self.targets = 0
        for _ in range(3):
            self.header(0, 0.0)
            self.sensor.on_frame(bearing_health(self.headers % 16, 0.0))
        self.header(4, 0.0)
        for slot in range(4):
            self.target(slot, 0.1, 0.0)
        self.sensor.take(0.1)

    def header(
        self, n: int, t_s: float, *, capture: int = 77, version: int = 1, latency_raw: int = 417
    ) -> None:
        self.headers += 1
        self.sensor.on_frame(
            bearing_header(
                n,
                self.headers % 16,
                t_s,
                capture=capture,
                version=version,
                latency_raw=latency_raw,
            )
        )

    def target(
        self,
        slot: int,
        bearing_rad: float,
        t_s: float,
        *,
        capture: int = 77,
        target: int = 13,
        quality: int = 12,
    ) -> None:
        self.targets += 1
        self.sensor.on_frame(
            bearing_target(
                slot,
                bearing_rad,
                self.targets % 16,
                t_s,
                capture=capture,
                target=target,
                quality=quality,
            )
        )

    def one(self, now_s: float) -> BearingSet:
        (only,) = self.sensor.take(now_s)
        return only


@pytest.fixture
def bench(database: CanDatabase) -> Bench:
    return Bench(database)


def test_a_set_closes_with_its_last_target_in_any_order(bench: Bench) -> None:
    bench.header(2, 3.0)
    bench.target(1, -0.7854, 3.001)
    assert bench.sensor.take(3.001) == []
    bench.target(0, 0.5, 3.002, target=1023)
    result = bench.one(3.002)
    assert result.complete
    assert result.frame == "body"
    first, second = result.targets
    assert (first.target, first.kind, first.quality) == (13, TargetClass.ROBOT, 12)
    assert first.bearing_rad == pytest.approx(-0.7854)
    assert first.std_rad == pytest.approx(0.004)
    assert second.target is None


def test_the_capture_time_is_reception_less_latency_and_bus(bench: Bench) -> None:
    bench.header(0, 3.0)
    result = bench.one(3.0)
    assert result.t_capture_s == pytest.approx(3.0 - 0.0417 - 0.0003, abs=1e-9)
    assert result.latency_known


def test_the_documented_header_is_read(database: CanDatabase) -> None:
    bench = Bench(database)
    while bench.headers % 16 != 8:
        bench.header(0, 2.9)
    bench.sensor.take(2.9)
    bench.sensor.on_frame(HEADER_VECTOR)
    assert bench.sensor.take(3.001) == []
    result = bench.one(3.02)
    assert (result.complete, result.targets) == (False, ())
    assert result.t_capture_s == pytest.approx(2.958, abs=1e-9)


def test_an_unknown_latency_is_said_and_not_subtracted(bench: Bench) -> None:
    bench.header(0, 3.0, latency_raw=65535)
    result = bench.one(3.0)
    assert not result.latency_known
    assert result.t_capture_s == pytest.approx(2.9997)


def test_a_look_that_saw_nothing_is_a_complete_set(bench: Bench) -> None:
    bench.header(0, 3.0)
    result = bench.one(3.0)
    assert (result.complete, result.targets) == (True, ())


def test_after_20_ms_a_set_is_given_without_what_is_missing(bench: Bench) -> None:
    bench.header(2, 3.0)
    bench.target(0, 0.5, 3.001)
    assert bench.sensor.take(3.0199) == []
    result = bench.one(3.0201)
    assert not result.complete
    assert len(result.targets) == 1


def test_the_next_header_closes_an_open_set(bench: Bench) -> None:
    bench.header(2, 3.0, capture=1)
    bench.target(0, 0.5, 3.001, capture=1)
    bench.header(1, 3.01, capture=2)
    bench.target(1, 0.9, 3.011, capture=1)
    bench.target(0, 0.6, 3.012, capture=2)
    first, second = bench.sensor.take(3.012)
    assert [bearing.bearing_rad for bearing in first.targets] == pytest.approx([0.5])
    assert not first.complete
    assert [bearing.bearing_rad for bearing in second.targets] == pytest.approx([0.6])
    assert second.complete


def test_a_target_with_a_wrong_crc_is_missing(bench: Bench) -> None:
    bench.header(2, 3.0)
    bench.target(0, 0.5, 3.001)
    broken = bearing_target(1, 0.6, (bench.targets + 1) % 16, 3.002)
    bench.sensor.on_frame(broken._replace(data=broken.data[:7] + b"\x09"))
    result = bench.one(3.03)
    assert not result.complete
    assert len(result.targets) == 1


def test_a_target_of_quality_0_counts_but_is_not_used(bench: Bench) -> None:
    bench.header(1, 3.0)
    bench.target(0, 0.5, 3.001, quality=0)
    result = bench.one(3.001)
    assert result.complete
    assert result.targets == ()


def test_the_mounting_yaw_is_added_and_wrapped(database: CanDatabase) -> None:
    bench = Bench(database, Settings(mounting="fork", yaw_rad=math.pi / 2))
    bench.header(1, 3.0)
    bench.target(0, 3.0, 3.001)
    result = bench.one(3.001)
    assert result.frame == "fork"
    assert result.targets[0].bearing_rad == pytest.approx(3.0 + math.pi / 2 - math.tau)


def test_another_interface_version_is_refused_by_name(bench: Bench) -> None:
    bench.header(1, 3.0, version=2)
    bench.target(0, 0.5, 3.001)
    assert bench.sensor.take(4.0) == []
    assert "interface version 2" in (bench.sensor.problem(3.0) or "")


def test_a_healthy_sensor_has_no_problem(bench: Bench) -> None:
    assert bench.sensor.problem(0.05) is None
    assert bench.sensor.stale_for(0.05) == pytest.approx(0.05)


def test_silence_is_named_with_its_limit(bench: Bench) -> None:
    assert bench.sensor.problem(0.1) is None
    assert bench.sensor.problem(0.11) == (
        "bearing sensor: no bearing frame for 0.11 s, limit 0.10 s"
    )
    assert bench.sensor.problem(0.36) == (
        "bearing sensor: no health report for 0.36 s, limit 0.35 s"
    )


def test_before_the_first_report_there_is_a_problem(database: CanDatabase) -> None:
    sensor = BearingSensor(database.bearing_sensor(0), Settings())
    assert sensor.problem(0.0) == "bearing sensor: no health report yet"
    assert sensor.stale_for(0.0) is None


def test_the_sensors_own_complaint_is_passed_on(bench: Bench) -> None:
    bench.sensor.on_frame(bearing_health(4, 0.1, state=4, faults=0b11))
    assert bench.sensor.problem(0.1) == "bearing sensor: state FAULT, faults camera, blocked"


def test_a_second_sensor_listens_to_its_own_identifiers(database: CanDatabase) -> None:
    sensor = BearingSensor(database.bearing_sensor(1), Settings(unit=1))
    for counter in range(4):
        sensor.on_frame(bearing_header(0, counter, 1.0))
    assert sensor.take(1.0) == []
    assert sensor.stale_for(1.0) is None
