"""The simcan bus with real sockets: what a host may rely on, and what a server must bear."""

import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from config.can.frame import Frame
from sim_hw.error_frames import ERROR_FLAG
from sim_hw.simcan.bus import SimCanBus
from sim_hw.simcan.server import ChannelError, SimCanServer

DEADLINE_S = 10.0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "buses" / "r1.sock"


@pytest.fixture
def server(path: Path) -> Iterator[SimCanServer]:
    with SimCanServer(path) as serving:
        yield serving


def opened(path: Path) -> can.BusABC:
    return can.Bus(interface="simcan", channel=str(path), bitrate=500_000, ignore_config=True)


@pytest.fixture
def bus(server: SimCanServer) -> Iterator[can.BusABC]:
    with opened(server.path) as connected:
        accept(server)
        yield connected


def accept(server: SimCanServer) -> None:
    assert server.receive(0.0, 0.0) == []


def message(can_id: int, data: bytes = b"", remote: bool = False) -> can.Message:
    return can.Message(
        arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote
    )


def wait_for(condition: Callable[[], bool]) -> None:
    """Let other processes run until the condition holds."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s, "condition not met in time"
        select.select([], [], [], 0.005)


def test_the_installed_plugin_is_found_by_its_name(bus: can.BusABC) -> None:
    assert isinstance(bus, SimCanBus)
    assert bus.channel_info.startswith("simcan /")


def test_frames_arrive_in_order_with_their_contents_and_times(
    server: SimCanServer, bus: can.BusABC
) -> None:
    sent = [Frame(0x100 + n, bytes(range(n)), float(n)) for n in range(9)]
    for frame in sent:
        server.send(frame, 1e9 + frame.t_s)
    for frame in sent:
        got = bus.recv(0)
        assert got is not None
        assert (got.arbitration_id, bytes(got.data)) == (frame.can_id, frame.data)
        assert got.timestamp == 1e9 + frame.t_s
        assert not got.is_extended_id
    assert bus.recv(0) is None


def test_a_hosts_frames_reach_the_devices(server: SimCanServer, bus: can.BusABC) -> None:
    bus.send(message(0x04D, bytes.fromhex("0000c03f00000000")), timeout=0)
    bus.send(message(0x043, remote=True), timeout=0)
    assert server.receive(5.0, 6.0) == [
        Frame(0x04D, bytes.fromhex("0000c03f00000000"), 5.0),
        Frame(0x043, b"", 5.0, remote=True),
    ]


def test_every_other_client_hears_a_clients_frame_but_not_itself(
    server: SimCanServer, bus: can.BusABC
) -> None:
    with opened(server.path) as other:
        accept(server)
        assert server.clients == 2
        bus.send(message(0x12, b"\x01"), timeout=0)
        server.receive(1.0, 77.0)
        heard = other.recv(0)
        assert heard is not None
        assert (heard.arbitration_id, heard.timestamp) == (0x12, 77.0)
        assert bus.recv(0) is None


def test_extended_and_error_frames_reach_clients_but_no_device(
    server: SimCanServer, bus: can.BusABC
) -> None:
    with opened(server.path) as other:
        accept(server)
        bus.send(can.Message(arbitration_id=0x12345678, is_extended_id=True), timeout=0)
        bus.send(can.Message(is_error_frame=True, is_extended_id=False), timeout=0)
        assert server.receive(1.0, 1.0) == []
        assert server.refused == 2
        extended, error = other.recv(0), other.recv(0)
        assert extended is not None
        assert extended.is_extended_id
        assert error is not None
        assert error.is_error_frame


def test_can_fd_frames_are_refused(bus: can.BusABC) -> None:
    with pytest.raises(ValueError, match="classic"):
        bus.send(can.Message(is_fd=True, data=bytes(12), is_extended_id=False), timeout=0)


def test_filters_pass_over_unwanted_frames_within_one_call(
    server: SimCanServer, bus: can.BusABC
) -> None:
    bus.set_filters([{"can_id": 0x60, "can_mask": 0x7FF, "extended": False}])
    for can_id in (0x41, 0x42, 0x60, 0x43):
        server.send(Frame(can_id, b"", 0.0), 0.0)
    wanted = bus.recv(0)
    assert wanted is not None
    assert wanted.arbitration_id == 0x60
    assert bus.recv(0) is None


def test_receiving_waits_as_long_as_asked(bus: can.BusABC) -> None:
    begun_s = time.monotonic()
    assert bus.recv(0.03) is None
    assert 0.03 <= time.monotonic() - begun_s < 1.0


def test_a_received_frame_makes_the_file_number_readable(
    server: SimCanServer, bus: can.BusABC
) -> None:
    assert select.select([bus.fileno()], [], [], 0)[0] == []
    server.send(Frame(1, b"", 0.0), 0.0)
    assert select.select([bus.fileno()], [], [], DEADLINE_S)[0] == [bus.fileno()]


def test_a_hosts_frame_makes_a_file_number_of_the_server_readable(
    server: SimCanServer, bus: can.BusABC
) -> None:
    bus.send(message(1), timeout=0)
    assert select.select(server.filenos(), [], [], DEADLINE_S)[0]


def test_a_server_that_does_not_read_fills_the_transmit_buffer(bus: can.BusABC) -> None:
    def fill() -> None:
        for _ in range(100_000):
            bus.send(message(1, bytes(8)), timeout=0)

    with pytest.raises(can.CanOperationError, match="Transmit buffer full"):
        fill()
    begun_s = time.monotonic()
    with pytest.raises(can.CanOperationError, match="Transmit buffer full"):
        bus.send(message(1, bytes(8)), timeout=0.02)
    assert time.monotonic() - begun_s >= 0.02


def test_a_full_queue_of_the_simulated_controller_is_a_full_transmit_buffer(
    server: SimCanServer, bus: can.BusABC
) -> None:
    server.tell_queue(full=True)
    assert bus.recv(0) is None
    with pytest.raises(can.CanOperationError, match="Transmit buffer full"):
        bus.send(message(1), timeout=0)
    server.tell_queue(full=False)
    assert bus.recv(0) is None
    bus.send(message(1), timeout=0)


def test_the_servers_error_frames_arrive_as_such(server: SimCanServer, bus: can.BusABC) -> None:
    server.send(Frame(ERROR_FLAG | 0x40, bytes(8), 0.0), 0.0)
    got = bus.recv(0)
    assert got is not None
    assert (got.is_error_frame, got.arbitration_id) == (True, 0x40)


def test_a_client_that_does_not_read_loses_frames_and_holds_nobody_up(
    server: SimCanServer, bus: can.BusABC
) -> None:
    with opened(server.path) as reader:
        accept(server)
        for n in range(2000):
            server.send(Frame(n & 0x7FF, b"", 0.0), 0.0)
            assert reader.recv(0) is not None
    assert 0 < server.dropped < 2000
    kept = 0
    while bus.recv(0) is not None:
        kept += 1
    assert kept + server.dropped == 2000


def test_a_lost_bus_is_an_error_on_receive_and_on_send(
    server: SimCanServer, bus: can.BusABC
) -> None:
    server.close()
    with pytest.raises(can.CanOperationError, match="is gone"):
        bus.recv(0)
    with pytest.raises(can.CanOperationError, match="is gone"):
        bus.send(message(1), timeout=0)


def test_opening_a_bus_that_nobody_serves_names_the_channel_and_what_to_do(path: Path) -> None:
    with pytest.raises(can.CanInitializationError, match=r"r1\.sock.*start echelon-sim"):
        opened(path)


def test_a_client_that_leaves_is_forgotten(server: SimCanServer) -> None:
    with opened(server.path):
        accept(server)
        assert server.clients == 1
    server.receive(0.0, 0.0)
    assert server.clients == 0
    with opened(server.path):
        accept(server)
    server.send(Frame(1, b"", 0.0), 0.0)
    assert server.clients == 0


def test_garbage_from_a_client_ends_its_connection_only(
    server: SimCanServer, bus: can.BusABC
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
        stranger.connect(str(server.path))
        stranger.send(b"hello")
        assert server.receive(0.0, 0.0) == []
    bus.send(message(7), timeout=0)
    assert [frame.can_id for frame in server.receive(0.0, 0.0)] == [7]


def test_a_second_server_is_refused_and_the_first_keeps_serving(
    server: SimCanServer, bus: can.BusABC
) -> None:
    with pytest.raises(ChannelError, match="in use"):
        SimCanServer(server.path)
    bus.send(message(7), timeout=0)
    assert len(server.receive(0.0, 0.0)) == 1


def test_a_socket_left_by_a_dead_server_is_replaced(path: Path) -> None:
    path.parent.mkdir()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as dead:
        dead.bind(str(path))
        dead.listen()
    assert path.exists()
    with SimCanServer(path), opened(path):
        pass
    assert not path.exists()


def test_a_file_in_the_way_is_not_removed(path: Path) -> None:
    path.parent.mkdir()
    path.write_text("precious")
    with pytest.raises(ChannelError, match="not a socket"):
        SimCanServer(path)
    assert path.read_text() == "precious"


def test_a_path_too_long_for_a_socket_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ChannelError, match="107 bytes"):
        SimCanServer(tmp_path / ("x" * 120))


@pytest.mark.process
def test_a_stock_can_logger_records_the_bus(server: SimCanServer, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    command = [sys.executable, "-m", "can.logger", "-i", "simcan", "-c", str(server.path)]
    sent = 0

    def send_until_written() -> bool:
        nonlocal sent
        for _ in range(20):
            server.send(Frame(sent & 0x7FF, bytes([sent & 0xFF]), 0.0), 1e9 + sent)
            sent += 1
        return log.stat().st_size > 0

    with subprocess.Popen([*command, "-f", str(log)], stdout=subprocess.DEVNULL) as logger:
        try:
            wait_for(lambda: server.receive(0.0, 0.0) == [] and server.clients == 1)
            wait_for(log.exists)
            wait_for(send_until_written)
            logger.send_signal(signal.SIGINT)
            logger.wait(DEADLINE_S)
        finally:
            logger.kill()
    recorded = list(can.LogReader(log))
    assert len(recorded) >= 20
    assert [m.arbitration_id for m in recorded] == [n & 0x7FF for n in range(len(recorded))]
    assert recorded[3].timestamp == 1e9 + 3
    assert bytes(recorded[3].data) == b"\x03"


def test_the_plugin_brings_nothing_else_of_the_simulation_along() -> None:
    program = (
        "import sys, sim_hw.simcan.bus; "
        "print(*sorted(m for m in sys.modules "
        "if m == 'numpy' or m.split('.')[0] in ('sim_hw', 'config', 'onboard')))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert result.stdout.split() == ["sim_hw", "sim_hw.simcan", "sim_hw.simcan.bus"]
