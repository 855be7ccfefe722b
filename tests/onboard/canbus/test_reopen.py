"""A lost link is opened again with a growing pause, on a real virtual bus and on a scripted one."""

import can
import pytest

from config.can.frame import Frame
from onboard.canbus.bus_errors import BusUnavailable
from onboard.canbus.port import BusState, CanPort


class Flaky:
    """Makes virtual buses, except while it is told not to."""

    def __init__(self, channel: str) -> None:
        self.channel = channel
        self.works = True
        self.tries: list[float] = []
        self.now_s = 0.0
        self.bus = self.make()

    def make(self) -> can.BusABC:
        self.tries.append(self.now_s)
        if not self.works:
            raise BusUnavailable("virtual", self.channel, "unplugged", "Plug it in")
        self.bus = can.Bus(self.channel, "virtual", ignore_config=True)
        return self.bus

    def run(self, port: CanPort, from_s: float, until_s: float) -> None:
        for tick in range(round(from_s * 100), round(until_s * 100)):
            self.now_s = tick / 100
            port.receive(self.now_s, 1000.0 + self.now_s)


def test_a_link_that_comes_back_is_used_again_and_told_of() -> None:
    flaky = Flaky("test-reopen")
    port = CanPort(flaky.bus, 500_000, flaky.make)
    flaky.run(port, 0.0, 0.1)
    flaky.bus.shutdown()
    flaky.run(port, 0.1, 0.2)
    assert port.health().state == "lost"
    assert port.send([Frame(0x04D, bytes(8), 0.2)]) == 0
    flaky.run(port, 0.2, 0.5)
    assert port.state is BusState.ACTIVE
    with can.Bus("test-reopen", "virtual", ignore_config=True) as peer:
        assert port.send([Frame(0x04D, bytes(8), 0.5)]) == 1
        heard = peer.recv(0)
        assert heard is not None
        assert peer.recv(0) is None, "nothing of the time without a link is sent later"
        peer.send(can.Message(arbitration_id=0x041, is_extended_id=False))
        assert [frame.can_id for frame in port.receive(0.5, 1000.5)] == [0x041]
    health = port.health()
    assert (health.reopened, health.send_failures, health.state) == (1, 1, "active")
    (note,) = port.take_notes()
    assert "open again; it was lost because receiving failed" in note
    assert port.take_notes() == []
    port.close()


def test_the_pause_doubles_up_to_two_seconds_and_starts_small_again() -> None:
    flaky = Flaky("test-pause")
    port = CanPort(flaky.bus, 500_000, flaky.make)
    flaky.works = False
    flaky.bus.shutdown()
    flaky.run(port, 0.0, 12.0)
    pauses = [b - a for a, b in zip(flaky.tries[1:], flaky.tries[2:], strict=False)]
    assert flaky.tries[1] == pytest.approx(0.21, abs=0.011)
    assert pauses == pytest.approx([0.4, 0.8, 1.6, 2.0, 2.0, 2.0, 2.0], abs=0.011)
    assert "unplugged" in port.reason
    flaky.works = True
    flaky.run(port, 12.0, 14.1)
    assert port.state is BusState.ACTIVE
    flaky.bus.shutdown()
    flaky.run(port, 14.1, 14.4)
    assert port.health().reopened == 2
    port.close()


def test_without_a_way_to_reopen_a_lost_port_stays_lost() -> None:
    bus = can.Bus("test-stays-lost", "virtual", ignore_config=True)
    port = CanPort(bus)
    bus.shutdown()
    for tick in range(500):
        port.receive(tick / 100, 1000.0)
    assert port.state is BusState.LOST
    assert port.health().reopened == 0


def test_a_closed_port_is_not_opened_again() -> None:
    flaky = Flaky("test-closed-reopen")
    port = CanPort(flaky.bus, 500_000, flaky.make)
    port.close()
    flaky.run(port, 0.0, 5.0)
    assert (port.state, len(flaky.tries)) == (BusState.CLOSED, 1)


def test_the_load_is_that_of_the_last_second_with_stuffing_at_its_worst() -> None:
    with can.Bus("test-load", "virtual", ignore_config=True) as peer:
        port = CanPort.open("virtual", "test-load", 500_000)
        for tick in range(250):
            peer.send(can.Message(arbitration_id=1, data=bytes(8), is_extended_id=False))
            port.receive(tick / 100, 1000.0)
            port.send([Frame(2, bytes(8), tick / 100)])
        # 200 frames per s of 8 * 8 + 47 + 24 bits each
        assert port.health().load == pytest.approx(200 * 135 / 500_000, rel=0.02)
        port.close()
