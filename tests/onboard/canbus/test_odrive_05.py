"""Firmware 0.5 against hand-written frames: other flags, other names, no procedure result."""

import struct

import pytest

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import ControlMode
from config.failsafe import Failsafe
from onboard.canbus.drive.driver import MotorFeedback, MotorState
from onboard.canbus.drive.odrive import OdriveAxis
from onboard.canbus.drive.queries import OdriveQueries
from onboard.canbus.drive.variant import variant_of
from tests.onboard.canbus.fakes import FakeDrive

IDLE = bytes.fromhex("0000000001000080")
ACTIVE = bytes.fromhex("0000000008000000")


class Bench:
    """A driver for firmware 0.5 and a fake drive at 100 Hz of virtual time."""

    def __init__(self, database: CanDatabase) -> None:
        self.axis = OdriveAxis(
            database.axis(2),
            ControlMode.VELOCITY_CONTROL,
            4.0,
            Failsafe(),
            variant=variant_of(database, 2, "0.5"),
        )
        self.drive = FakeDrive(2)
        self.drive.heartbeat = IDLE
        self.tick = 0

    @property
    def seen(self) -> MotorFeedback:
        return self.axis.feedback

    def run(self, duration_s: float) -> list[Frame]:
        sent = []
        for _ in range(round(duration_s / 0.01)):
            self.tick += 1
            for frame in self.drive.frames(self.tick * 0.01):
                self.axis.on_frame(frame)
            sent += self.axis.tick(self.tick * 0.01)
        return sent

    def activate(self) -> list[Frame]:
        self.run(0.2)
        assert self.seen.state is MotorState.IDLE
        assert self.axis.arm() is None
        sent = self.run(0.01)
        self.drive.heartbeat = ACTIVE
        self.run(0.2)
        assert self.seen.reason == "in closed-loop control"
        return sent


@pytest.fixture(name="bench")
def _bench(database: CanDatabase) -> Bench:
    return Bench(database)


def test_it_arms_with_an_empty_clear_errors(bench: Bench) -> None:
    sent = [(frame.can_id, frame.data) for frame in bench.activate()]
    assert sent == [
        (0x04B, struct.pack("<II", 2, 1)),
        (0x058, b""),
        (0x047, struct.pack("<II", 8, 0)),
        (0x04D, struct.pack("<ff", 0.0, 0.0)),
    ]


@pytest.mark.parametrize(
    ("heartbeat", "names"),
    [
        ("0008000001000000", ("WATCHDOG_TIMER_EXPIRED",)),
        ("0040000001000000", ("ESTOP_REQUESTED",)),
        ("4000000001010000", ("MOTOR_FAILED", "MOTOR_ERROR")),
        ("0001000001000100", ("ENCODER_FAILED", "ENCODER_ERROR")),
        ("0000000008000001", ("CONTROLLER_ERROR",)),
        ("0100008001000000", ("INVALID_STATE", "0x80000000")),
    ],
)
def test_errors_and_flags_are_faults_with_names(
    bench: Bench, heartbeat: str, names: tuple[str, ...]
) -> None:
    bench.activate()
    bench.drive.heartbeat = bytes.fromhex(heartbeat)
    bench.run(0.2)
    assert bench.seen.state is MotorState.FAULT
    assert bench.seen.faults == names
    assert ", ".join(names) in bench.seen.reason
    assert bench.seen.watchdog_expired == ("WATCHDOG_TIMER_EXPIRED" in names)


def test_an_unplugged_motor_that_reports_no_error_is_a_fault(bench: Bench) -> None:
    bench.activate()
    bench.drive.heartbeat = IDLE
    bench.run(0.2)
    assert bench.seen.state is MotorState.FAULT
    assert bench.seen.reason == "left closed-loop control: state IDLE, errors none"


def test_its_message_0x15_is_no_temperature_but_its_supply_is_known(bench: Bench) -> None:
    bench.axis.on_frame(Frame(0x055, struct.pack("<ff", 90.0, 91.0), 0.0))
    bench.axis.on_frame(Frame(0x057, struct.pack("<ff", 23.5, 1.0), 0.0))
    assert bench.seen.temperature_degc is None
    assert bench.seen.bus_voltage_v == 23.5


def test_a_drive_that_tells_firmware_0_6_is_not_the_one_expected(bench: Bench) -> None:
    bench.axis.on_frame(Frame(0x040, bytes((2, 4, 4, 58, 0, 6, 11, 0)), 0.0))
    assert str(bench.seen.firmware_problem).startswith("firmware 0.6.11, vehicle says 0.5: set")
    bench.axis.on_frame(Frame(0x040, bytes((2, 3, 6, 56, 0, 5, 6, 0)), 0.0))
    assert bench.seen.firmware_problem is None


@pytest.mark.parametrize(("firmware", "ids"), [("0.5", {0x40, 0x57}), ("0.6", {0x40, 0x57, 0x55})])
def test_each_query_goes_out_once_per_second_and_never_two_at_once(
    database: CanDatabase, firmware: str, ids: set[int]
) -> None:
    queries = OdriveQueries(variant_of(database, 2, "0.5" if firmware == "0.5" else "0.6"))
    sent = [queries.tick(tick * 0.01) for tick in range(1000)]
    assert max(map(len, sent)) == 1
    counts = {i: sum(f.can_id == i for frames in sent for f in frames) for i in ids}
    assert all(9 <= count <= 11 for count in counts.values())
    assert all(frame.remote and not frame.data for frames in sent for frame in frames)
    assert {frame.can_id for frames in sent for frame in frames} == ids
