"""`echelon-sim` as a process: buses, truth, shutdown, refusals."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import msgspec
import pytest
import zenoh
from typer.testing import CliRunner
from zenoh.handlers import FifoChannel

from config import topics
from config.messages import SimulatedBus, Truth
from config.zenoh_settings import session_config
from groundstation.cli import app
from sim_hw.__main__ import BAD_INPUT, main
from sim_hw.serve import PERIOD_S, Lateness
from tests.sim_hw.fleets import database

DEADLINE_S = 10.0
FLEET = "demo"
RUNNER = CliRunner()


def wait_for(condition: Callable[[], bool]) -> None:
    """Let other processes run until the condition holds."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s, "condition not met in time"
        select.select([], [], [], 0.005)


@pytest.fixture
def runtime() -> Iterator[Path]:
    """A folder for sockets with a path short enough for them."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.fixture
def ground() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def simulator(runtime: Path, ground: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "sim_hw", "--fleet", FLEET, "--ground", ground]
    with subprocess.Popen(
        [*command, "--robots", "r1,r2"],
        env={**os.environ, "XDG_RUNTIME_DIR": str(runtime)},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        try:
            assert "serving r1, r2" in process.stderr.readline()
            yield process
        finally:
            process.kill()


def opened(runtime: Path, robot: str) -> can.BusABC:
    path = runtime / "echelon" / FLEET / f"{robot}.sock"
    return can.Bus(interface="simcan", channel=str(path), ignore_config=True)


def read_for_ever(bus: can.BusABC) -> None:
    while True:
        bus.recv(1.0)


@pytest.mark.process
def test_devices_send_at_their_rates_and_answer_a_host(
    simulator: subprocess.Popen[str], runtime: Path
) -> None:
    drive = database().axis(2)
    with opened(runtime, "r2") as bus:
        request = can.Message(
            arbitration_id=drive.get_version.can_id, is_remote_frame=True, is_extended_id=False
        )
        bus.send(request, timeout=0)
        received: list[can.Message] = []

        def listen() -> bool:
            while (message := bus.recv(0)) is not None:
                received.append(message)
            return bool(received) and received[-1].timestamp - received[0].timestamp > 0.5

        wait_for(listen)
    assert simulator.poll() is None
    times = [m.timestamp for m in received]
    assert abs(times[-1] - time.time()) < 2.0
    assert times == sorted(times)
    for can_id in (0x49, 0x60):
        cyclic = [m.timestamp for m in received if m.arbitration_id == can_id]
        assert (cyclic[-1] - cyclic[0]) / (len(cyclic) - 1) == pytest.approx(0.01, rel=0.02)
    assert drive.get_version.can_id in {m.arbitration_id for m in received}


@pytest.mark.process
def test_truth_is_published_100_times_a_second_with_a_token_of_life(
    runtime: Path, ground: str, request: pytest.FixtureRequest
) -> None:
    settings = zenoh.Config.from_json5(session_config(ground, []))
    with zenoh.open(settings) as session:
        samples = session.declare_subscriber(topics.TRUTH.key(FLEET, "*"), FifoChannel(10_000))
        token_key = topics.liveliness_key(FLEET, "sim")
        request.getfixturevalue("simulator")
        wait_for(lambda: bool(list(session.liveliness().get(token_key))))
        truths: list[Truth] = []

        def enough() -> bool:
            while (sample := samples.try_recv()) is not None:
                truths.append(msgspec.json.decode(sample.payload.to_bytes(), type=Truth))
            return len(truths) >= 100

        wait_for(enough)
        newest_ns = truths[-1].t_ns
    assert {truth.robot for truth in truths} == {"r1", "r2"}
    own = [truth for truth in truths if truth.robot == "r1"]
    numbers = [truth.seq for truth in own]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    elapsed_s = (own[-1].t_ns - own[0].t_ns) * 1e-9
    assert elapsed_s / (len(own) - 1) == pytest.approx(0.01, rel=0.2)
    assert abs(time.monotonic_ns() - newest_ns) < 2e9
    assert abs(own[-1].wall_ns - time.time_ns()) < 2e9
    assert (own[-1].speed_mps, own[-1].steering_rad) == (0.0, 0.0)
    assert own[-1].heading_rad == pytest.approx(0.7854)


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_cleanly(
    simulator: subprocess.Popen[str], runtime: Path, number: signal.Signals
) -> None:
    with opened(runtime, "r1") as bus:
        simulator.send_signal(number)
        assert simulator.wait(DEADLINE_S) == 0
        with pytest.raises(can.CanOperationError, match="is gone"):
            read_for_ever(bus)
    assert list((runtime / "echelon" / FLEET).iterdir()) == []


@pytest.mark.process
def test_a_second_simulator_of_the_same_fleet_is_refused(
    simulator: subprocess.Popen[str],
    runtime: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    assert main(["--fleet", FLEET, "--robots", "r2"]) == BAD_INPUT
    assert "r2.sock is in use" in capsys.readouterr().err
    assert simulator.poll() is None


def identifiers(bus: can.BusABC, duration_s: float) -> set[int]:
    """What is heard on a bus for a while, after what had been heard before."""
    while bus.recv(0) is not None:
        pass
    found: set[int] = set()
    until_s = time.monotonic() + duration_s
    while (remaining_s := until_s - time.monotonic()) > 0:
        if (message := bus.recv(remaining_s)) is not None:
            found.add(message.arbitration_id)
    return found


@pytest.mark.process
def test_faults_are_injected_while_it_runs(
    ground: str, runtime: Path, request: pytest.FixtureRequest
) -> None:
    """`echelon fault` reaches it through a peer that listens as the ground station does."""
    settings = zenoh.Config.from_json5(session_config(ground, []))
    with zenoh.open(settings) as session:
        loads = session.declare_subscriber(topics.SIM_BUS.key(FLEET, "r2"), FifoChannel(100))
        request.getfixturevalue("simulator")
        with opened(runtime, "r2") as bus:
            assert fault(ground, "r2", "encoder", "off", "--for", "60s")["ok"]
            assert 0x060 not in (heard := identifiers(bus, 0.2))
            assert {0x041, 0x049, 0x120} <= heard
            assert fault(ground, "r2", "encoder", "ok")["ok"]
            wait_for(lambda: 0x060 in identifiers(bus, 0.1))
        refused = fault(ground, "r3", "encoder", "off", code=1)
        assert "no simulated hardware answers for it" in str(refused["reason"])
        told = [loads.recv() for _ in range(3)]
    load = msgspec.json.decode(told[-1].payload.to_bytes(), type=SimulatedBus)
    assert (load.robot, load.host_state, load.errors) == ("r2", "ACTIVE", 0)
    assert 0.1 < load.load < 0.5


def fault(ground: str, *words: str, code: int = 0) -> dict[str, object]:
    """What `echelon fault --json` answers."""
    result = RUNNER.invoke(app, ["fault", *words, "--json", "--ground", ground])
    assert result.exit_code == code, result.stderr
    answer: dict[str, object] = json.loads(result.stdout)
    return answer


def test_faults_that_no_robot_can_have_are_refused_by_name() -> None:
    for words, named in (
        (("r22", "bearing", "off"), "no robot 'r22'; did you mean 'r2'"),
        (("r2", "baering", "off"), "no device 'baering'; did you mean 'bearing'"),
        (("r2", "bearing", "stukc"), "no fault of bearing 'stukc'; did you mean 'stuck'"),
        (("r2", "bearing", "stuck", "--for", "2h"), "'2h' is no duration"),
    ):
        result = RUNNER.invoke(app, ["fault", *words])
        assert result.exit_code == 2
        assert named in result.stderr


@pytest.mark.process
def test_a_lost_adapter_ends_the_connection_until_it_is_back(
    ground: str, runtime: Path, tmp_path: Path
) -> None:
    script = tmp_path / "faults.yaml"
    script.write_text(
        "version: 1\nclock: power\nfaults:\n"
        "  - {at: 0.5, for: 0.3, robot: r1, device: bus, kind: adapter_lost}\n"
    )
    words = ["--fleet", FLEET, "--robots", "r1", "--ground", ground, "--faults", str(script)]
    with subprocess.Popen(
        [sys.executable, "-m", "sim_hw", *words],
        env={**os.environ, "XDG_RUNTIME_DIR": str(runtime)},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stderr is not None
            assert "serving r1" in process.stderr.readline()
            with (
                opened(runtime, "r1") as bus,
                pytest.raises(can.CanOperationError, match="is gone"),
            ):
                read_for_ever(bus)
            wait_for((runtime / "echelon" / FLEET / "r1.sock").exists)
            with opened(runtime, "r1") as bus:
                assert identifiers(bus, 0.2)
        finally:
            process.kill()


def test_robots_that_are_not_on_simcan_are_refused_by_name(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["--fleet", "hardware"]) == BAD_INPUT
    assert "robot r1 is on CAN interface socketcan" in capsys.readouterr().err


def test_unknown_robots_and_fleets_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--fleet", FLEET, "--robots", "r1,r77"]) == BAD_INPUT
    assert "no robot r77 in fleet demo; it has r1, r2, r3" in capsys.readouterr().err
    assert main(["--fleet", "nonesuch"]) == BAD_INPUT
    assert "nonesuch" in capsys.readouterr().err


def test_help_shows_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    assert "example: echelon-sim --fleet" in capsys.readouterr().out


def test_missed_periods_are_skipped_and_counted() -> None:
    lateness = Lateness()
    assert [lateness.record(late_s) for late_s in (0.0, 0.001, 5.5 * PERIOD_S)] == [0, 0, 5]
    assert (lateness.periods, lateness.skipped) == (3, 5)
    assert "11.0 ms late" in str(lateness)
