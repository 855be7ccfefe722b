"""The whole stack as processes: it drives, it survives, it leaves nothing behind."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest

from groundstation.replay_check import check, to_text
from groundstation.series import Run, read_run
from tests.processes.running import demo, short_demo, wait_for

pytestmark = pytest.mark.process


def test_a_short_mission_passes_and_leaves_nothing_running(tmp_path: Path) -> None:
    with demo(short_demo(tmp_path, 6.0), tmp_path / "run") as running:
        code, output = running.finish()
        summary = json.loads(output)
        assert summary["why"] == []
        assert code == 0
        assert summary["verdict"] == "pass"
        assert set(summary["followers"]) == {"r2", "r3"}
        assert summary["collisions"] == 0
        assert running.pids() == []
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names >= {"run.mcap", "fleet.yaml", "summary.json", "trajectories.png", "formation.png"}
    assert json.loads((tmp_path / "run" / "summary.json").read_text()) == summary
    replayed = check(tmp_path / "run" / "run.mcap")
    assert to_text(replayed).endswith("verdict: pass")
    assert [robot.robot for robot in replayed.robots] == ["r1", "r2", "r3"]


def test_a_killed_leader_brings_every_follower_to_rest_within_a_second(tmp_path: Path) -> None:
    with demo(short_demo(tmp_path, 60.0), tmp_path / "run") as running:
        wait_for(lambda: running.mission_time_s() > 3.0)
        running.kill("--robot", "r1")
        code, output = running.finish()
        assert code == 1
        assert "SIGKILL" in str(json.loads(output)["faults"])
        assert running.pids() == []
    run = read_run(tmp_path / "run" / "run.mcap")
    killed_ns = run.motion["r1"][-1].t_ns
    for name, reason in (("r2", "leader r1: no message"), ("r3", "r2 stopped: leader r1")):
        assert _standing_after_s(run, name, killed_ns) < 1.0
        assert reason in run.status[name][-1].reason


def test_killed_hardware_is_noticed_by_every_robot_and_nothing_hangs(tmp_path: Path) -> None:
    with demo(short_demo(tmp_path, 60.0), tmp_path / "run") as running:
        wait_for(lambda: running.mission_time_s() > 3.0)
        running.kill("-m sim_hw")
        code, output = running.finish()
        assert code == 1
        assert "sim" in [fault["robot"] for fault in json.loads(output)["faults"]]
        assert running.pids() == []
    run = read_run(tmp_path / "run" / "run.mcap")
    for name in ("r1", "r2", "r3"):
        last = run.status[name][-1]
        assert last.state == "FAULT"
        assert "CAN bus lost" in last.reason


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_demo_stops_the_robots_and_keeps_the_recording(
    tmp_path: Path, number: signal.Signals, code: int
) -> None:
    with demo(short_demo(tmp_path, 60.0), tmp_path / "run") as running:
        wait_for(lambda: running.tells("driving"))
        running.process.send_signal(number)
        assert running.finish()[0] == code
        assert running.pids() == []
    run = read_run(tmp_path / "run" / "run.mcap")
    assert {run.status[name][-1].state for name in ("r1", "r2", "r3")} == {"STANDBY"}


def _standing_after_s(run: Run, name: str, since_ns: int) -> float:
    """Time from an instant until the robot truly stands for good."""
    track = run.truth[name]
    travelled_m = np.hypot(np.diff(track.x_m), np.diff(track.y_m))
    moving = travelled_m > 0.02 * np.diff(track.t_ns) * 1e-9
    return max(0.0, float(track.t_ns[1:][moving][-1] - since_ns) * 1e-9)
