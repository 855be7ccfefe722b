"""The commands about recordings, as an operator types them."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from config.fleet import Fleet
from config.loader import load_fleet, shipped_fleet_path
from groundstation.cli import app
from groundstation.endpoints import with_real_port
from groundstation.fleet_link import ANY_LOOPBACK
from groundstation.lockstep import START_WALL_NS, Lockstep
from groundstation.recorder import About, Recorder
from groundstation.recording import keys_in, read_info
from tests.groundstation.fake_robot import FakeRobot, robots
from tests.groundstation.synthetic import WALL_NS, Story, fleet, messages

RUNNER = CliRunner()


def test_a_running_fleet_is_recorded(tmp_path: Path) -> None:
    endpoint = with_real_port(ANY_LOOPBACK)
    demo: Fleet = load_fleet(shipped_fleet_path("demo")).fleet
    fakes = [FakeRobot(demo.model_copy(update={"ground": endpoint}), name) for name in demo.robots]
    out = tmp_path / "run.mcap"
    with robots(*fakes):
        result = RUNNER.invoke(
            app, ["record", "--ground", endpoint, "--seconds", "3", "--out", str(out)]
        )
    assert result.exit_code == 0
    assert f"recording to {out}.active" in result.stderr
    assert {f"echelon/demo/{name}/status" for name in demo.robots} <= set(keys_in(out))
    assert read_info(out).fleet_name == "demo"


def test_an_unfinished_recording_is_recovered_and_what_came_of_it_is_told(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap", fleet(), About(WALL_NS, "lockstep", 1)) as recorder:
        for message in messages(Story(duration_s=2.0)):
            recorder.write(*message)
            recorder.flush()
    whole = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "run.mcap").unlink()
    (tmp_path / "run.mcap.active").write_bytes(whole[: len(whole) // 2])
    refused = RUNNER.invoke(app, ["replay", str(tmp_path / "run.mcap"), "--check"])
    assert refused.exit_code == 2
    assert f"echelon recover {tmp_path / 'run.mcap.active'}" in refused.stderr
    result = RUNNER.invoke(app, ["recover", str(tmp_path / "run.mcap.active"), "--json"])
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    assert told["recording"] == str(tmp_path / "run.mcap")
    assert told["lost_chunks"] == 0
    assert told["messages"] > 100


@pytest.mark.parametrize("content", [b"", b"no MCAP file at all"])
def test_a_file_with_nothing_to_recover_stays_as_it_is(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap.active"
    path.write_bytes(content)
    result = RUNNER.invoke(app, ["recover", str(path), "--json"])
    assert result.exit_code == 2
    assert "nothing to save" in json.loads(result.stdout)["error"]
    assert path.read_bytes() == content
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap.active"]


def test_a_replay_check_is_reported_with_its_exit_code(tmp_path: Path) -> None:
    demo = load_fleet(shipped_fleet_path("demo")).fleet
    with (
        Recorder(tmp_path / "run.mcap", demo, About(START_WALL_NS, "lockstep", 1)) as recorder,
        Lockstep(demo, 1, recorder.write, replayable=True) as lockstep,
    ):
        lockstep.run_for(0.2)
    result = RUNNER.invoke(app, ["replay", "--check", str(tmp_path / "run.mcap"), "--json"])
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert document["ok"]
    assert {robot["robot"]: robot["steps"] for robot in document["robots"]} == dict.fromkeys(
        demo.robots, 20
    )
