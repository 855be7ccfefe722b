"""The folder of a run, its figures and its effective fleet."""

import struct
from datetime import UTC, datetime
from pathlib import Path

import pytest

from config.loader import load_fleet, shipped_fleet_path
from groundstation import run_folder
from groundstation.errors import GroundError
from groundstation.figures import draw_formation, draw_trajectories
from groundstation.rehearsal import rehearsal
from groundstation.series import Run, gather
from tests.groundstation.synthetic import Story, fleet, messages


def test_a_run_folder_is_named_after_time_fleet_and_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    moment = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)
    folder = run_folder.create("paper", True, None, moment)
    assert folder.path == Path("runs/20260304T050607Z-paper-lockstep")
    assert folder.logs.is_dir()


def test_an_empty_folder_may_be_used(tmp_path: Path) -> None:
    assert run_folder.create("demo", False, tmp_path).path == tmp_path


def test_a_file_in_the_way_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(GroundError, match="cannot make the run folder"):
        run_folder.create("demo", False, tmp_path / "file")


def test_a_rehearsal_of_real_hardware_stays_on_this_machine(tmp_path: Path) -> None:
    real = load_fleet(shipped_fleet_path("hardware")).fleet
    effective, notes = rehearsal(real, Path("/tmp/echelon-x"))
    for name, robot in effective.robots.items():
        assert robot.can.interface == "simcan"
        assert robot.can.channel == f"/tmp/echelon-x/{name}.sock"
        assert robot.listen.startswith("tcp/127.0.0.1:")
    assert effective.ground.startswith("tcp/127.0.0.1:")
    assert "socketcan" in notes[0]
    folder = run_folder.create("demo", False, tmp_path)
    folder.write_fleet(effective)
    assert load_fleet(folder.fleet).fleet == effective


def test_a_rehearsal_of_a_simulated_fleet_has_nothing_to_note() -> None:
    assert rehearsal(load_fleet(shipped_fleet_path("demo")).fleet, Path("/tmp/x")).notes == []


def test_a_socket_path_that_the_system_cannot_hold_is_refused() -> None:
    with pytest.raises(GroundError, match="limit 107: set TMPDIR"):
        rehearsal(fleet(), Path("/tmp") / ("x" * 100))


def _size(png: Path) -> tuple[int, ...]:
    data = png.read_bytes()
    assert data.startswith(b"\x89PNG")
    return struct.unpack(">II", data[16:24])


def test_figures_are_drawn_reproducibly(tmp_path: Path) -> None:
    run = gather((key, body) for key, body, _ in messages(Story(duration_s=6.0)))
    for name in ("a", "b"):
        draw_trajectories(fleet(), run, tmp_path / f"{name}-paths.png")
        draw_formation(fleet(), run, tmp_path / f"{name}-errors.png")
    assert min(_size(tmp_path / "a-paths.png")) > 800
    assert min(_size(tmp_path / "a-errors.png")) > 800
    for kind in ("paths", "errors"):
        first, second = (tmp_path / f"{name}-{kind}.png" for name in "ab")
        assert first.read_bytes() == second.read_bytes()


def test_figures_of_an_empty_run_are_drawn_too(tmp_path: Path) -> None:
    draw_trajectories(fleet(), Run(), tmp_path / "paths.png")
    draw_formation(fleet(), Run(), tmp_path / "errors.png")
    assert _size(tmp_path / "paths.png")
    assert _size(tmp_path / "errors.png")
