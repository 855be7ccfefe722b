"""`echelon dataset` from the files to the judgement, with onboard robots in lockstep."""

import json
import math
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner, Result

from groundstation.cli import app
from groundstation.dataset_fleet import dataset_fleet
from groundstation.dataset_play import Played, play_lockstep
from groundstation.dataset_score import pose_errors, pose_track, truth_at
from sim_hw.dataset.mrclam import read_recording
from tests.dataset.synthetic import Truth, write_data_set


def dataset(*arguments: str) -> Result:
    """Run the command."""
    return CliRunner().invoke(app, ["dataset", *arguments])


def play(folder: Path, start: str, seconds: float) -> Played:
    """Robot 1 of the folder in lockstep."""
    recording = read_recording(folder, 1)
    fleet = dataset_fleet({1: recording}, "known" if start == "known" else "unknown")
    return play_lockstep(fleet, {"r1": recording}, seconds, lambda _name, _played_s: None)["r1"]


def rms_m(folder: Path, played: Played, from_s: float) -> float:
    """Position error of what was played."""
    track = pose_track(played.trusted_poses)
    errors = pose_errors(track, truth_at(read_recording(folder, 1), track.t_s), from_s)
    assert len(errors.t_s) > 100
    return math.sqrt(float((errors.position_m**2).mean()))


def test_a_robot_told_its_start_knows_where_it_is(data_set: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = dataset(str(data_set), "--robot", "1", "--json", "--out", str(out))
    report = json.loads(result.stdout)
    robot = report["robots"]["1"]
    assert robot["position_rms_m"] < 0.06
    assert robot["position_median_m"] <= robot["position_rms_m"] <= robot["position_max_m"]
    assert robot["heading_rms_rad"] < 0.05
    assert 0.2 < robot["nees_median"] < 6.0
    assert robot["coverage"] > 0.8
    assert robot["bearings_used"] > 200
    assert robot["seconds"] == pytest.approx(39.98, abs=0.1)
    assert robot["trusted_from_s"] == 0.0
    assert (out / "robot1.png").stat().st_size > 10_000
    assert result.exit_code == (0 if report["verdict"] == "pass" else 1)


def test_a_robot_that_knows_nothing_finds_itself_and_says_when(data_set: Path) -> None:
    played = play(data_set, "unknown", 40.0)
    assert played.trusted_from_s is not None
    assert 1.0 < played.trusted_from_s < 40.0
    assert rms_m(data_set, played, played.trusted_from_s) < 0.15


def test_the_filter_bears_bias_scale_errors_and_wrong_bearings(tmp_path: Path) -> None:
    write_data_set(tmp_path, Truth(speed_scale=0.95, rate_scale=1.08, bearing_bias_rad=-0.02))
    path = tmp_path / "Robot1_Measurement.dat"
    lines = path.read_text(encoding="utf-8").splitlines()
    for number in range(20, len(lines), 60):
        time, barcode, range_m, _ = lines[number].split()
        lines[number] = f"{time} {barcode} {range_m} 0.55"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    played = play(tmp_path, "known", 40.0)
    assert rms_m(tmp_path, played, 0.0) < 0.1
    assert played.poses[-1][1].rejected >= 2


def test_ranges_change_no_byte_of_what_the_robot_says(tmp_path: Path) -> None:
    said = []
    for range_m in (1.0, 99.0):
        folder = tmp_path / str(range_m)
        folder.mkdir()
        write_data_set(folder, Truth(seconds=12.0), range_m=range_m)
        played = play(folder, "known", 10.0)
        said.append([msgspec.json.encode(pose) for _, pose in played.poses])
    assert said[0] == said[1]
    assert len(said[0]) > 150


def test_an_unknown_barcode_is_told_and_counted(data_set: Path, tmp_path: Path) -> None:
    path = data_set / "Robot1_Measurement.dat"
    text = path.read_text(encoding="utf-8")
    path.write_text(text + "1248000039.970 999 1.0 0.1\n", encoding="utf-8")
    out = str(tmp_path / "out")
    result = dataset(str(data_set), "--robot", "1", "--seconds", "5", "--json", "--out", out)
    assert "barcode 999 (1 x) not in Barcodes.dat" in result.stderr
    assert json.loads(result.stdout)["robots"]["1"]["unknown_barcodes"] == {"999": 1}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--robot", "7"], "no robot 7; the data set has 1"),
        (["--robot", "one"], "give a robot's number, or all"),
        (["--start", "lost"], "choose known or unknown"),
        (["--follow", "1"], "FOLLOWER:LEADER, e.g. 2:1"),
        (["--follow", "2:1"], "no robot 2"),
        (["--follow", "2:1", "--realtime"], "leave --realtime out"),
        (["--start", "unknown", "--seconds", "5"], "play more --seconds"),
    ],
)
def test_what_cannot_be_played_is_told_in_one_line(
    arguments: list[str], words: str, data_set: Path, tmp_path: Path
) -> None:
    result = dataset(str(data_set), "--out", str(tmp_path / "out"), *arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.strip().count("\n") == 0
    assert "Traceback" not in result.output


def test_a_broken_file_is_told_without_a_traceback(data_set: Path) -> None:
    (data_set / "Robot1_Measurement.dat").write_text("", encoding="utf-8")
    result = dataset(str(data_set), "--robot", "all", "--json")
    assert result.exit_code == 2
    assert "Robot1_Measurement.dat: holds no measurements" in result.stderr
    assert "holds no measurements" in json.loads(result.stdout)["error"]
    assert "Traceback" not in result.output


def test_two_minutes_of_a_real_robot(real_data_set: Path, tmp_path: Path) -> None:
    arguments = ["--robot", "3", "--seconds", "120", "--json", "--out", str(tmp_path)]
    robot = json.loads(dataset(str(real_data_set), *arguments).stdout)["robots"]["3"]
    assert robot["position_rms_m"] < 0.2
    assert robot["nees_median"] < 6.0
    assert robot["coverage"] > 0.8
    assert robot["unknown_barcodes"] == {"34": 2}


def test_one_real_robot_sees_another(real_data_set: Path, tmp_path: Path) -> None:
    arguments = ["--robot", "3", "--follow", "3:2", "--seconds", "20", "--json"]
    report = json.loads(dataset(str(real_data_set), *arguments, "--out", str(tmp_path)).stdout)
    follow = report["follow"]
    assert (follow["follower"], follow["leader"]) == (3, 2)
    assert follow["bearings"] >= 3
    assert follow["bearing_rms_rad"] < 0.2


@pytest.mark.process
def test_real_processes_play_in_real_time(data_set: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    result = dataset(
        str(data_set), "--robot", "1", "--realtime", "--seconds", "4", "--json", "--out", out
    )
    assert result.exit_code in (0, 1), result.output
    robot = json.loads(result.stdout)["robots"]["1"]
    assert robot["position_rms_m"] < 0.1
    assert robot["seconds"] >= 4.0
