"""The command line: help with examples, JSON on standard output, bad input without traceback."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from config.loader import load_fleet, shipped_fleet_path
from groundstation import fleet_commands
from groundstation.cli import app
from groundstation.endpoints import with_real_port
from groundstation.fleet_link import ANY_LOOPBACK, FleetLink
from tests.groundstation.fake_robot import FakeRobot, robots

COMMANDS = (
    "demo",
    "monitor",
    "status",
    "arm",
    "start",
    "stop",
    "estop",
    "reset",
    "at-start",
    "record",
    "doctor",
    "fault",
)
NEEDED = {"doctor": ("--mission",), "fault": ("r1", "bearing", "stuck")}
"""What a command needs besides a fleet."""
ABOUT_FILES = ("recover", "replay", "report")
RUNNER = CliRunner()


@pytest.mark.parametrize("command", [*COMMANDS, *ABOUT_FILES])
def test_help_shows_an_example(command: str) -> None:
    result = RUNNER.invoke(app, [command, "--help"])
    assert result.exit_code == 0
    assert f"Example: echelon {command}" in result.stdout


def test_version_is_told() -> None:
    result = RUNNER.invoke(app, ["--version"])
    assert result.exit_code == 0
    assert result.stdout.startswith("echelon 0.")


def test_help_needs_neither_figures_nor_network() -> None:
    code = (
        "import sys; sys.argv = ['echelon', '--help']\n"
        "import groundstation.cli\n"
        "try: groundstation.cli.main()\n"
        "except SystemExit: pass\n"
        "heavy = {'matplotlib', 'zenoh', 'numpy'}\n"
        "print('heavy:', sorted(heavy & set(sys.modules)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert "heavy: []" in result.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_an_unknown_fleet_is_named(command: str) -> None:
    result = RUNNER.invoke(app, [command, *NEEDED.get(command, ()), "--fleet", "dmeo"])
    assert result.exit_code == 2
    assert "dmeo" in result.stderr
    assert "demo" in result.stderr
    assert result.stdout == ""


def test_a_mistake_in_a_fleet_file_is_shown_in_place(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text(shipped_fleet_path("demo").read_text().replace("wheelbase_m", "wheelbse_m"))
    result = RUNNER.invoke(app, ["status", "--fleet", str(bad), "--json"])
    assert result.exit_code == 2
    assert "wheelbse_m" in result.stderr
    assert "wheelbse_m" in json.loads(result.stdout)["error"]


def test_a_bad_endpoint_is_refused() -> None:
    result = RUNNER.invoke(app, ["demo", "--ground", "localhost:7447"])
    assert result.exit_code == 2
    assert "tcp/ADDRESS:PORT" in result.stderr


def test_a_run_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("keep")
    result = RUNNER.invoke(app, ["demo", "--lockstep", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "is not empty" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_a_ground_endpoint_in_use_is_refused(tmp_path: Path) -> None:
    endpoint = with_real_port(ANY_LOOPBACK)
    fleet = load_fleet(shipped_fleet_path("demo")).fleet.model_copy(update={"ground": endpoint})
    with FleetLink.as_ground_station(fleet):
        result = RUNNER.invoke(app, ["demo", "--ground", endpoint, "--out", str(tmp_path / "run")])
    assert result.exit_code == 2
    assert f"cannot listen on {endpoint}: Address already in use" in result.stderr


@pytest.mark.parametrize("command", ["status", "arm", "start", "stop", "reset", "at-start"])
def test_a_fleet_that_does_not_run_is_told(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_commands, "DISCOVERY_S", 0.1)
    result = RUNNER.invoke(app, [command, "--ground", with_real_port(ANY_LOOPBACK)])
    assert result.exit_code == 2
    assert "no robot of fleet demo is heard" in result.stderr


def test_an_emergency_stop_that_nobody_heard_is_no_success(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fleet_commands, "ESTOP_LIMIT_S", 0.2)
    result = RUNNER.invoke(app, ["estop", "--ground", with_real_port(ANY_LOOPBACK), "--json"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["ok"] is False


def test_status_of_a_running_fleet_is_one_json_document() -> None:
    endpoint = with_real_port(ANY_LOOPBACK)
    fleet = load_fleet(shipped_fleet_path("demo")).fleet.model_copy(update={"ground": endpoint})
    fakes = [FakeRobot(fleet, name) for name in fleet.robots]
    with FleetLink.as_ground_station(fleet), robots(*fakes):
        result = RUNNER.invoke(app, ["status", "--ground", endpoint, "--json"])
        lines = RUNNER.invoke(app, ["status", "--ground", endpoint])
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert {name: robot["state"] for name, robot in document["robots"].items()} == dict.fromkeys(
        fleet.robots, "STANDBY"
    )
    assert lines.stdout.startswith("r1: STANDBY, ready, loop p99 2.00 ms")


def test_an_unknown_formation_is_refused_with_the_known_ones() -> None:
    result = RUNNER.invoke(app, ["formation", "star"])
    assert result.exit_code == 2
    assert "no formation 'star'; known are default, wide, left" in result.stderr


def test_a_port_of_the_page_in_use_is_told(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        endpoint = with_real_port(ANY_LOOPBACK)
        result = RUNNER.invoke(app, ["monitor", "--port", port, "--ground", endpoint])
    assert result.exit_code == 2
    assert f"port {port}: Address already in use" in result.stderr
    assert "--port" in result.stderr
