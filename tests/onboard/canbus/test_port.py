"""The CAN port on python-can's in-process bus, and on buses that fail in every way."""

import errno
import time
from collections.abc import Iterator

import can
import pytest

from config.can.frame import Frame
from onboard.canbus.bus_errors import unavailable
from onboard.canbus.port import BusState, BusUnavailable, CanPort

CHANNEL = "test-port"


@pytest.fixture
def port() -> Iterator[CanPort]:
    port = CanPort.open("virtual", CHANNEL, 500_000)
    yield port
    port.close()


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    bus = can.Bus(CHANNEL, "virtual", ignore_config=True, preserve_timestamps=True)
    yield bus
    bus.shutdown()


class ScriptedBus(can.BusABC):
    """A bus that gives out prepared messages and errors."""

    def __init__(self) -> None:
        self.inbox: list[can.Message | Exception] = []
        self.send_error: Exception | None = None
        self.timeouts: list[float | None] = []
        super().__init__(channel="scripted")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        assert timeout == 0
        if not self.inbox:
            return None, True
        item = self.inbox.pop(0)
        if isinstance(item, Exception):
            raise item
        return item, True

    def send(self, _msg: can.Message, timeout: float | None = None) -> None:
        self.timeouts.append(timeout)
        if self.send_error is not None:
            raise self.send_error


@pytest.fixture
def scripted() -> Iterator[ScriptedBus]:
    bus = ScriptedBus()
    yield bus
    bus.shutdown()


def message(can_id: int, data: bytes = b"", wall_s: float = 100.0) -> can.Message:
    return can.Message(timestamp=wall_s, arbitration_id=can_id, data=data, is_extended_id=False)


def error_message(error_class: int, detail: int = 0) -> can.Message:
    return can.Message(
        arbitration_id=error_class,
        data=bytes((0, detail, 0, 0, 0, 0, 0, 0)),
        is_extended_id=False,
        is_error_frame=True,
    )


def test_frames_cross_the_bus_both_ways(port: CanPort, peer: can.BusABC) -> None:
    assert port.send([Frame(0x04D, b"\x01\x02", 5.0)]) == 1
    heard = peer.recv(0)
    assert heard is not None
    assert (heard.arbitration_id, bytes(heard.data)) == (0x04D, b"\x01\x02")
    assert not heard.is_extended_id
    peer.send(message(0x041, b"\x03", wall_s=100.0))
    (frame,) = port.receive(now_s=7.0, wall_s=100.02)
    assert frame == Frame(0x041, b"\x03", frame.t_s)
    assert frame.t_s == pytest.approx(6.98)


def test_a_remote_frame_stays_remote(port: CanPort, peer: can.BusABC) -> None:
    port.send([Frame(0x057, b"", 5.0, remote=True)])
    heard = peer.recv(0)
    assert heard is not None
    assert heard.is_remote_frame


@pytest.mark.parametrize(
    ("stamp_s", "expected_s"), [(99.0, 6.95), (99.96, 6.96), (100.0, 7.0), (103.0, 7.0)]
)
def test_the_age_of_a_frame_is_between_0_and_50_ms(
    port: CanPort, peer: can.BusABC, stamp_s: float, expected_s: float
) -> None:
    peer.send(message(0x041, wall_s=stamp_s))
    (frame,) = port.receive(now_s=7.0, wall_s=100.0)
    assert frame.t_s == pytest.approx(expected_s)


def test_receiving_never_waits(port: CanPort) -> None:
    started_s = time.monotonic()
    assert port.receive(0.0, 0.0) == []
    assert time.monotonic() - started_s < 0.5


def test_one_call_takes_at_most_512_frames_and_leaves_the_rest(
    port: CanPort, peer: can.BusABC
) -> None:
    for _ in range(600):
        peer.send(message(0x041))
    assert len(port.receive(7.0, 100.0)) == 512
    assert len(port.receive(7.0, 100.0)) == 88
    assert port.health().received == 600


def test_extended_frames_are_not_given_and_do_not_end_the_draining(
    port: CanPort, peer: can.BusABC
) -> None:
    peer.send(can.Message(arbitration_id=0x041, is_extended_id=True))
    peer.send(message(0x042))
    assert [frame.can_id for frame in port.receive(7.0, 100.0)] == [0x042]


def test_a_full_buffer_drops_counts_and_does_not_lose_the_link(scripted: ScriptedBus) -> None:
    port = CanPort(scripted)
    scripted.send_error = can.CanOperationError("Failed to transmit", errno.ENOBUFS)
    assert port.send([Frame(1, b"", 0.0), Frame(2, b"", 0.0)]) == 0
    assert port.state is BusState.ACTIVE
    scripted.send_error = None
    assert port.send([Frame(3, b"", 0.0)]) == 1
    assert scripted.timeouts == [0, 0, 0]
    health = port.health()
    assert (health.sent, health.send_failures) == (1, 2)


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN),
        BrokenPipeError(errno.EPIPE, "Broken pipe"),
    ],
)
def test_a_link_lost_while_sending_silences_the_port(
    scripted: ScriptedBus, error: Exception
) -> None:
    port = CanPort(scripted)
    scripted.send_error = error
    port.send([Frame(1, b"", 0.0)])
    assert port.state is BusState.LOST
    assert str(error) in port.reason
    scripted.send_error = None
    scripted.inbox.append(message(0x041))
    assert port.send([Frame(2, b"", 0.0)]) == 0
    assert port.receive(0.0, 0.0) == []
    assert len(scripted.timeouts) == 1


@pytest.mark.parametrize(
    "error", [can.CanOperationError("Failed to receive: Network is down", 100), ValueError("bad")]
)
def test_a_link_lost_while_receiving_keeps_what_came_before(
    scripted: ScriptedBus, error: Exception
) -> None:
    port = CanPort(scripted)
    scripted.inbox += [message(0x041), error, message(0x042)]
    assert [frame.can_id for frame in port.receive(0.0, 0.0)] == [0x041]
    assert port.state is BusState.LOST
    assert type(error).__name__ in port.reason


@pytest.mark.parametrize(
    ("errors", "state"),
    [
        ([error_message(0x20)], BusState.ACTIVE),
        ([error_message(0x04, 0x04)], BusState.ACTIVE),
        ([error_message(0x04, 0x10)], BusState.PASSIVE),
        ([error_message(0x04, 0x20)], BusState.PASSIVE),
        ([error_message(0x04, 0x20), error_message(0x04, 0x40)], BusState.ACTIVE),
        ([error_message(0x40)], BusState.BUS_OFF),
        ([error_message(0x40), error_message(0x100)], BusState.ACTIVE),
    ],
)
def test_error_frames_tell_the_state_of_the_controller(
    scripted: ScriptedBus, errors: list[can.Message], state: BusState
) -> None:
    port = CanPort(scripted)
    scripted.inbox += errors
    assert port.receive(0.0, 0.0) == []
    assert port.state is state
    assert port.health().error_frames == len(errors)
    assert port.health().state == state.value


def test_nothing_is_sent_while_the_controller_is_off(scripted: ScriptedBus) -> None:
    port = CanPort(scripted)
    scripted.inbox.append(error_message(0x40))
    port.receive(0.0, 0.0)
    assert port.send([Frame(1, b"", 0.0)]) == 0
    assert scripted.timeouts == []


def test_a_closed_port_is_closed_for_good() -> None:
    port = CanPort.open("virtual", "test-port-closed", 500_000)
    port.close()
    port.close()
    assert port.state is BusState.CLOSED
    assert port.receive(0.0, 0.0) == []
    assert port.send([Frame(1, b"", 0.0)]) == 0


def test_a_missing_socketcan_channel_is_named_with_what_to_do() -> None:
    with pytest.raises(BusUnavailable, match="CAN bus socketcan:can0 cannot be opened") as caught:
        CanPort.open("socketcan", "can0", 500_000)
    assert caught.value.channel == "can0"
    assert caught.value.advice in str(caught.value)


def test_an_unknown_interface_is_named() -> None:
    with pytest.raises(BusUnavailable, match=r"nosuch:x cannot be opened.*can\.interface"):
        CanPort.open("nosuch", "x", 500_000)


@pytest.mark.parametrize(
    ("code", "advice"),
    [
        (errno.EAFNOSUPPORT, "no CAN sockets"),
        (errno.ENODEV, "no network interface can7"),
        (errno.ENETDOWN, "ip link set can7 up"),
        (errno.EACCES, "may not use can7"),
        (errno.ENOENT, "Nobody serves can7"),
        (errno.ECONNREFUSED, "Nobody serves can7"),
    ],
)
def test_every_cause_has_its_advice(code: int, advice: str) -> None:
    assert advice in str(unavailable("socketcan", "can7", OSError(code, "text")))
    wrapped = can.CanInitializationError("wrapped")
    wrapped.__cause__ = OSError(code, "text")
    assert advice in str(unavailable("socketcan", "can7", wrapped))
