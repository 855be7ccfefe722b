"""The emulated bus against bit-by-bit arithmetic and the rules of CAN."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.can.frame import Frame
from config.fleet import BearingSensor
from sim_hw.bus_faults import BusFaults
from sim_hw.bus_timing import HOST, HOST_QUEUE_FRAMES, RESTART_S, TimedBus
from sim_hw.can_controller import ErrorState
from sim_hw.error_frames import ERROR_FLAG
from sim_hw.fleet import SimulatedFleet
from sim_hw.frame_length import frame_bits
from tests.sim_hw.fleets import database, fleet

BIT_S = 1 / 500_000
BUS_OFF_CLASS, RESTARTED_CLASS, CONTROLLER_CLASS = 0x40, 0x100, 0x04
PASSIVE_BITS = 0x30


def bits_one_by_one(frame: Frame) -> int:
    """Length of a frame on the wire by the book: CRC-15 and stuffing bit by bit."""
    header = f"0{frame.can_id:011b}{int(frame.remote)}00{len(frame.data):04b}"
    bits = [int(bit) for bit in header + "".join(f"{byte:08b}" for byte in frame.data)]
    crc = 0
    for bit in bits:
        flips = bit ^ crc >> 14
        crc = crc << 1 & 0x7FFF ^ (0x4599 if flips else 0)
    last, run, length = None, 0, 0
    for bit in bits + [int(bit) for bit in f"{crc:015b}"]:
        run = run + 1 if bit == last else 1
        last, length = bit, length + 1
        if run == 5:
            last, run, length = 1 - bit, 1, length + 1
    return length + 10 + 3


@settings(deadline=None)
@given(st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans())
def test_the_length_is_that_of_every_bit_counted(can_id: int, data: bytes, remote: bool) -> None:
    frame = Frame(can_id, b"" if remote else data, 0.0, remote)
    assert frame_bits(frame) == bits_one_by_one(frame)


def test_a_frame_of_eight_bytes_takes_111_to_135_bits() -> None:
    rng = np.random.default_rng(1)
    lengths = [
        frame_bits(Frame(int(rng.integers(0x800)), data, 0.0))
        for data in [rng.bytes(8) for _ in range(2000)] + [bytes(8), b"\xff" * 8, b"\x3c" * 8]
    ]
    assert min(lengths) >= 111
    assert 124 < max(lengths) <= 135
    assert np.mean(lengths) == pytest.approx(114.5, abs=3)


def bus_with(
    kind: str | None = None, value: float | None = None, bitrate: int = 500_000
) -> TimedBus:
    faults = BusFaults(np.random.default_rng(1), unprotected_nodes=(1, 2))
    if kind is not None:
        faults.begin(kind, value, 0.0)
    return TimedBus(bitrate, 0.0, ("one", "two"), faults)


def test_whenever_the_bus_falls_idle_the_lowest_waiting_identifier_goes_first() -> None:
    bus = bus_with()
    bus.queue("one", Frame(0x300, bytes(8), 0.0))
    bus.queue("two", Frame(0x200, bytes(8), 50e-6))
    bus.queue(HOST, Frame(0x010, bytes(8), 60e-6))
    bus.queue("one", Frame(0x001, bytes(8), 0.0))
    bus.advance(0.01)
    # 0x300 has begun before the others came; 0x001 waits behind it in the same queue.
    assert [frame.can_id for frame in bus.to_host] == [0x300, 0x001, 0x200]
    assert bus.to_devices[0].t_s > bus.to_host[1].t_s
    assert bus.to_devices[0].t_s < bus.to_host[2].t_s


def test_data_wins_against_a_request_for_it() -> None:
    bus = bus_with()
    bus.queue(HOST, Frame(0x41, b"", 0.0, remote=True))
    bus.queue("one", Frame(0x41, bytes(8), 0.0))
    bus.advance(0.01)
    assert bus.to_host[0].t_s < bus.to_devices[0].t_s


@pytest.mark.parametrize("bitrate", [125_000, 250_000, 500_000, 1_000_000])
def test_a_frame_is_stamped_with_its_end_at_the_bit_rate(bitrate: int) -> None:
    bus = bus_with(bitrate=bitrate)
    frame = Frame(0x123, b"\x12\x34\x56\x78", 0.001)
    bus.queue("one", frame)
    bus.advance(0.001 + 0.9 * frame_bits(frame) / bitrate)
    assert bus.to_host == []
    bus.advance(0.01)
    assert bus.to_host[0].t_s == pytest.approx(0.001 + (frame_bits(frame) - 3) / bitrate)


def test_many_small_advances_carry_what_one_long_one_does() -> None:
    results = []
    for steps in (1, 97):
        bus = bus_with()
        for n in range(40):
            bus.queue(("one", "two")[n % 2], Frame(0x100 + 7 * n % 31, bytes([n]), n * 1e-4))
        for step in range(1, steps + 1):
            bus.advance(0.02 * step / steps)
        results.append(bus.to_host)
    assert results[0] == results[1]
    assert len(results[0]) == 40


def test_the_hosts_queue_holds_ten_frames_and_refuses_more() -> None:
    bus = bus_with()
    assert all(bus.queue(HOST, Frame(0x41, bytes(8), 0.0)) for _ in range(HOST_QUEUE_FRAMES))
    assert not bus.queue(HOST, Frame(0x41, bytes(8), 0.0))
    assert bus.host.overflowed == 1
    bus.advance(0.001)
    assert bus.queue(HOST, Frame(0x41, bytes(8), 0.001))


def error_classes(frames: list[Frame]) -> list[int]:
    return [frame.can_id & 0xFF | frame.can_id & 0x100 for frame in frames]


def test_thirty_two_errors_in_a_row_take_a_sender_off_the_bus_and_it_restarts() -> None:
    bus = bus_with("corruption", 1.0)
    frame = Frame(0x04D, bytes(8), 0.0)
    bus.queue(HOST, frame)
    bus.advance(0.05)
    assert bus.is_off(HOST)
    assert bus.to_devices == []
    assert all(error.can_id & ERROR_FLAG for error in bus.to_host)
    destroyed = [error for error in bus.to_host if error.can_id & 0x80]
    assert len(destroyed) == 32
    assert destroyed[-1].t_s == pytest.approx(32 * (frame_bits(frame) + 20) * BIT_S, rel=0.01)
    classes = error_classes(bus.to_host)
    assert [c for c in classes if not c & 0x80] == [4, 4, BUS_OFF_CLASS]
    assert not bus.queue(HOST, frame)
    bus.advance(0.06 + RESTART_S)
    assert error_classes(bus.to_host)[-1] == RESTARTED_CLASS
    assert bus.host.state is ErrorState.ACTIVE
    assert bus.queue(HOST, frame._replace(t_s=0.2))


def test_a_destroyed_frame_is_sent_again_until_it_arrives() -> None:
    bus = bus_with("corruption", 0.5)
    for n in range(20):
        bus.queue("one", Frame(0x049, bytes([n]), n * 0.01))
        bus.advance(n * 0.01 + 0.01)
    arrived = [frame for frame in bus.to_host if not frame.can_id & ERROR_FLAG]
    assert [frame.data[0] for frame in arrived] == list(range(20))
    assert len(bus.to_host) > 25
    assert bus.node("one").transmit_errors > 0


def test_a_flipped_bit_in_a_protected_frame_reaches_the_receiver() -> None:
    bus = bus_with("corruption", 1.0)
    bus.queue("one", Frame(0x060, bytes(8), 0.0))
    bus.advance(0.01)
    (arrived,) = bus.to_host
    assert sum(byte.bit_count() for byte in arrived.data) == 1


def send_hundred(bus: TimedBus) -> list[int]:
    for n in range(100):
        bus.queue("one", Frame(0x060, bytes([n]), n * 0.001))
        bus.advance(n * 0.001 + 0.001)
    return [frame.data[0] for frame in bus.to_host]


def test_loss_duplication_and_reordering_befall_their_share_of_the_frames() -> None:
    lost, doubled, mixed = (
        send_hundred(bus_with(kind, 0.3)) for kind in ("loss", "duplication", "reordering")
    )
    assert 50 < len(lost) < 90
    assert lost == sorted(lost)
    assert 110 < len(doubled) < 150
    assert sorted(set(doubled)) == list(range(100))
    assert len(mixed) in (99, 100)
    assert 10 < sum(late < early for early, late in pairwise(mixed)) < 40


def test_a_babbling_node_starves_everybody_and_fills_the_hosts_queue() -> None:
    sim = SimulatedFleet(fleet(1), 1, 0.0, database())
    robot = sim.robots["r1"]
    robot.begin_fault("bus", "babbling", None)
    for n in range(50):
        robot.deliver(Frame(0x04D, bytes(8), n * 0.01))
        sim.advance(n * 0.01 + 0.01)
    heard = {frame.can_id for frame in robot.collect() if frame.t_s > 0.01}
    assert heard == {0x000}
    assert robot.bus.host.overflowed > 30
    robot.end_fault("bus", "babbling")
    sim.advance(1.5)
    assert {0x049, 0x060} <= {frame.can_id for frame in robot.collect()}


def test_a_host_whose_cable_is_out_turns_passive_but_never_bus_off() -> None:
    bus = bus_with("unplugged")
    bus.queue(HOST, Frame(0x04D, bytes(8), 0.0))
    bus.queue("one", Frame(0x060, bytes(8), 0.0))
    bus.advance(0.5)
    bus.advance(1.0)
    assert bus.host.state is ErrorState.PASSIVE
    assert all(frame.can_id & ERROR_FLAG for frame in bus.to_host)
    assert bus.to_devices == []
    passive = [f for f in bus.to_host if f.can_id & CONTROLLER_CLASS and f.data[1] & PASSIVE_BITS]
    assert len(passive) == 1
    assert passive[0].data[6] == 128


def test_a_host_at_another_bit_rate_disturbs_until_it_is_passive_and_hears_nothing() -> None:
    bus = bus_with("wrong_bitrate")
    for n in range(100):
        bus.queue("one", Frame(0x060, bytes([n]), n * 0.001))
        bus.advance(n * 0.001 + 0.001)
    assert all(frame.can_id & ERROR_FLAG for frame in bus.to_host)
    assert bus.host.state is ErrorState.PASSIVE
    assert bus.node("one").transmit_errors < 96
    bus.queue(HOST, Frame(0x04D, bytes(8), 0.1))
    bus.advance(0.15)
    assert bus.is_off(HOST)


def test_a_bus_off_fault_lasts_until_it_ends() -> None:
    sim = SimulatedFleet(fleet(1), 1, 0.0, database())
    robot = sim.robots["r1"]
    sim.advance(0.1)
    robot.collect()
    robot.begin_fault("bus", "bus_off", None)
    sim.advance(1.0)
    assert not robot.deliver(Frame(0x04D, bytes(8), 1.0))
    assert error_classes(robot.collect()) == [BUS_OFF_CLASS]
    robot.end_fault("bus", "bus_off")
    sim.advance(1.0 + RESTART_S + 0.05)
    frames = robot.collect()
    assert error_classes(frames)[0] == RESTARTED_CLASS
    assert len(frames) > 10


def test_the_nominal_robot_loads_a_bus_of_500_kbit_by_a_quarter() -> None:
    """Sensor at 30 Hz with 7 targets, 4 frames of the host at 100 Hz: can.md has 20.5 to 24.9 %."""
    sim = SimulatedFleet(fleet(2, sensor=BearingSensor(rate_hz=30.0)), 1, 0.0, database())
    robot = sim.robots["r1"]
    host = [0x02C, 0x04D, *[0x012] * 2]
    for tick in range(200):
        for can_id in host:
            robot.deliver(Frame(can_id, bytes(8), tick * 0.01))
        sim.advance(tick * 0.01 + 0.01)
    frames = 200 + 20 + 100 + 30 * 8 + 10 + 400
    assert robot.bus.load.frames == pytest.approx(frames, rel=0.02)
    assert frames * 111 * BIT_S < robot.bus.load.share < frames * 135 * BIT_S
    assert 0.205 < robot.bus.load.share < 0.26
    assert robot.bus.load.errors == 0
