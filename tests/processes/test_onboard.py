"""One onboard process: what it loads, how soon it is ready, what it takes, how it refuses."""

import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, cast

import pytest
import zenoh

from config import topics
from config.fleet import Fleet
from config.loader import load_fleet, shipped_fleet_path
from config.zenoh_settings import session_config
from groundstation.fleet_link import FleetLink
from groundstation.rehearsal import rehearsal
from tests.processes.running import run_command, wait_for, write_fleet

pytestmark = pytest.mark.process

FORBIDDEN = {"groundstation", "scipy", "filterpy", "matplotlib", "typer", "rich", "pytest"}
PLUGIN = {"sim_hw", "sim_hw.simcan", "sim_hw.simcan.bus", "sim_hw.simcan.record"}
READY_LIMIT_S = 1.5
MEMORY_LIMIT_MB = 80.0


class Bench(NamedTuple):
    """Simulated hardware of the demo fleet and a ground station, up and running."""

    fleet: Fleet
    path: Path
    link: FleetLink

    def hears(self, robot: str) -> bool:
        """Whether the robot says that it is ready."""
        self.link.poll()
        status = self.link.view.status(robot)
        return status is not None and status.ready


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    shipped = load_fleet(shipped_fleet_path("demo")).fleet
    shipped = shipped.model_copy(update={"ground": "tcp/127.0.0.1:0"})
    with tempfile.TemporaryDirectory(prefix="echelon-") as folder:
        fleet = rehearsal(shipped, Path(folder)).fleet
        path = write_fleet(Path(folder), fleet)
        with FleetLink.as_ground_station(fleet) as link:
            command = [sys.executable, "-m", "sim_hw", "--fleet", str(path)]
            with subprocess.Popen(command, stderr=subprocess.DEVNULL) as simulator:
                wait_for(lambda: bool(link.poll()) and "sim" in link.view.alive)
                yield Bench(fleet, path, link)
                simulator.terminate()


@contextmanager
def onboard(bench: Bench, robot: str, *python: str) -> Iterator[subprocess.Popen[str]]:
    """The robot's process; ended by SIGTERM, which it obeys with exit code 0."""
    command = [sys.executable, *python, "-m", "onboard", "--fleet", str(bench.path)]
    with subprocess.Popen(
        [*command, "--robot", robot], stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)


def test_it_is_ready_in_time_and_small(bench: Bench) -> None:
    started_s = time.monotonic()
    with onboard(bench, "r1") as process:
        wait_for(lambda: bench.hears("r1"))
        ready_s = time.monotonic() - started_s
        status = Path(f"/proc/{process.pid}/status").read_text()
    peak = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert peak is not None
    print(f"ready after {ready_s:.2f} s, peak memory {int(peak[1]) / 1024:.0f} MB")
    assert ready_s <= READY_LIMIT_S
    assert int(peak[1]) / 1024 <= MEMORY_LIMIT_MB


def test_it_loads_nothing_but_what_a_robot_needs(bench: Bench) -> None:
    with onboard(bench, "r2", "-X", "importtime") as process:
        wait_for(lambda: _has_spoken(bench, "r2"))
        process.send_signal(signal.SIGTERM)
        _, told = process.communicate()
    assert process.returncode == 0
    loaded = set(re.findall(r"import time:.*\|\s*([\w.]+)\s*$", told, re.MULTILINE))
    assert "onboard.robot" in loaded
    assert {name.split(".")[0] for name in loaded} & FORBIDDEN == set()
    assert {name for name in loaded if name.split(".")[0] == "sim_hw"} <= PLUGIN


def test_it_cannot_hear_the_truth(bench: Bench) -> None:
    """A publisher of truth finds no subscriber although three robots are connected to it."""
    settings = zenoh.Config.from_json5(session_config("tcp/127.0.0.1:0", [bench.fleet.ground]))
    with (
        onboard(bench, "r2"),
        onboard(bench, "r1"),
        zenoh.open(settings) as session,
    ):
        heard = session.declare_publisher(topics.ESTOP.key(bench.fleet.name))
        truth = session.declare_publisher(f"{topics.TRUTH.key(bench.fleet.name, 'r1')}/probe")
        wait_for(lambda: _matches(heard))
        wait_for(lambda: bench.hears("r1"))
        others = session.declare_publisher(topics.MOTION.key(bench.fleet.name, "r1"))
        wait_for(lambda: _matches(others))
        assert not _matches(truth)


def test_every_key_that_it_subscribes_to_is_out_of_truths_reach() -> None:
    truth = zenoh.KeyExpr(topics.TRUTH.key("demo"))
    for topic in (topics.MOTION, topics.ESTOP, topics.COMMAND):
        assert not truth.intersects(zenoh.KeyExpr(topic.key("demo")))


def _matches(publisher: zenoh.Publisher) -> bool:
    """Whether anyone subscribes; the stub calls the status a bool, it is an object."""
    return bool(cast(Any, publisher.matching_status).matching)


def _has_spoken(bench: Bench, robot: str) -> bool:
    bench.link.poll()
    return bench.link.view.status(robot) is not None


def test_a_robot_that_is_not_in_the_fleet_is_named() -> None:
    ended = run_command("echelon-onboard", "--fleet", "demo", "--robot", "r9")
    _refused(ended, "r9", "r1, r2, r3")


def test_a_can_channel_that_does_not_exist_is_named() -> None:
    ended = run_command("echelon-onboard", "--fleet", "hardware", "--robot", "r1")
    _refused(ended, "socketcan", "can0")


def test_simulated_hardware_that_does_not_run_is_named(tmp_path: Path) -> None:
    ended = run_command(
        "echelon-onboard",
        *("--fleet", "demo", "--robot", "r1"),
        env={"XDG_RUNTIME_DIR": str(tmp_path)},
    )
    _refused(ended, "r1.sock", "echelon-sim")


def test_a_port_in_use_is_named(bench: Bench) -> None:
    r1 = bench.fleet.robots["r1"].model_copy(update={"listen": bench.fleet.ground})
    r9 = bench.fleet.model_copy(
        update={
            "robots": {**bench.fleet.robots, "r1": r1},
            "ground": "tcp/127.0.0.1:9",
        }
    )
    path = bench.path.with_name("in_use.yaml")
    write_fleet(bench.path.parent, r9.model_copy(update={"name": "in_use"}))
    ended = run_command("echelon-onboard", "--fleet", str(path), "--robot", "r1")
    _refused(ended, bench.fleet.ground, "in use")


def test_an_unknown_key_in_the_fleet_file_is_named_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    text = shipped_fleet_path("demo").read_text().replace("wheelbase_m", "wheelbse_m")
    path.write_text(text)
    ended = run_command("echelon-onboard", "--fleet", str(path), "--robot", "r1")
    _refused(ended, "bad.yaml:", "wheelbse_m", "wheelbase_m", "^")


def _refused(ended: subprocess.CompletedProcess[str], *words: str) -> None:
    assert ended.returncode == 2
    assert "Traceback" not in ended.stderr
    for word in words:
        assert word in ended.stderr
