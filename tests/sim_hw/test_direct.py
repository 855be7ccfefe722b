"""The bus of a simulated robot in the same process fails as socketcan does."""

import errno

import can
import pytest

from sim_hw.bus_timing import HOST_QUEUE_FRAMES
from sim_hw.fleet import SimulatedFleet
from sim_hw.simcan.direct import RECEIVE_BUFFER_FRAMES, DirectBus
from tests.sim_hw.fleets import database, fleet

MESSAGE = can.Message(arbitration_id=0x04D, data=bytes(8), is_extended_id=False)


@pytest.fixture
def sim() -> SimulatedFleet:
    return SimulatedFleet(fleet(1), 1, 0.0, database())


def joined(sim: SimulatedFleet) -> DirectBus:
    return DirectBus(sim.robots["r1"], "r1", 0.0, 1e9)


def test_messages_carry_the_end_of_their_frame_on_the_wall_clock(sim: SimulatedFleet) -> None:
    with joined(sim) as bus:
        assert bus.recv(0) is None
        sim.advance(0.1)
        bus.update(0.1)
        first = bus.recv(0)
        assert first is not None
        assert first.arbitration_id == 0x021
        assert 1e9 < first.timestamp < 1e9 + 0.002


def test_a_full_transmit_queue_is_an_error_until_the_bus_has_taken_a_frame(
    sim: SimulatedFleet,
) -> None:
    with joined(sim) as bus:
        for _ in range(HOST_QUEUE_FRAMES):
            bus.send(MESSAGE, timeout=0)
        with pytest.raises(can.CanOperationError, match="Transmit buffer full"):
            bus.send(MESSAGE, timeout=0)
        sim.advance(0.01)
        bus.update(0.01)
        bus.send(MESSAGE, timeout=0)


def test_error_frames_are_received_with_class_and_counters(sim: SimulatedFleet) -> None:
    with joined(sim) as bus:
        sim.robots["r1"].begin_fault("bus", "bus_off", None)
        sim.advance(0.05)
        bus.update(0.05)
        message = bus.recv(0)
        assert message is not None
        assert message.is_error_frame
        assert message.arbitration_id & 0x40


def test_a_lost_adapter_is_an_error_of_the_network_device(sim: SimulatedFleet) -> None:
    with joined(sim) as bus:
        sim.robots["r1"].begin_fault("bus", "adapter_lost", None)
        with pytest.raises(can.CanOperationError) as lost:
            bus.recv(0)
        assert lost.value.error_code == errno.ENODEV
        with pytest.raises(can.CanOperationError, match="is gone"):
            bus.send(MESSAGE)
        sim.robots["r1"].end_fault("bus", "adapter_lost")
        sim.advance(0.1)
        bus.update(0.1)
        assert bus.recv(0) is not None


def test_a_host_that_does_not_read_loses_the_newest_frames(sim: SimulatedFleet) -> None:
    with joined(sim) as bus:
        sim.advance(3.0)
        bus.update(3.0)
        assert bus.lost > 0
        kept = sum(1 for _ in iter(lambda: bus.recv(0), None))
        assert kept == RECEIVE_BUFFER_FRAMES
