"""Section 4 of the paper: its scenario, cells, table and figures."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from groundstation.cli import app
from groundstation.study import paper_study
from groundstation.study.bound_cells import BoundResult, run_bound
from groundstation.study.drawing import save
from groundstation.study.figure4 import draw_figure4
from groundstation.study.formation_cells import FollowerResult, FormationResult, run_formation
from groundstation.study.leader_cells import COUNTS, LeaderResult, kept_times_s, run_leader
from groundstation.study.runner import Job
from groundstation.study.scenario import (
    landmark_positions,
    leader_truth,
    measured_bearings,
    paper_fleet,
    true_bearings,
)
from groundstation.study.table import (
    Figure4,
    Figure5,
    LockstepRow,
    PaperTable,
    follower_rows,
    leader_row,
    to_json,
    to_markdown,
)

RUNNER = CliRunner()
KEPT = len(kept_times_s())


def leader_result(position_mse: float, nis: float | None = 1.0) -> LeaderResult:
    """A result with errors that do not change over time."""
    error = [math.sqrt(position_mse / 2)] * KEPT
    bearing = [] if nis is None else [0.01] * KEPT
    return LeaderResult(error, error, [0.02] * KEPT, bearing, position_mse, 4e-4, 3.5, nis)


def follower_result(place_mse: float, heading_max: float) -> FollowerResult:
    """A result with hand-made figures."""
    return FollowerResult([0.0], [0.0], place_mse, 4.0, 9.0, 1.0, 1.0, 1.0, heading_max, 3.0, 1.0)


def test_the_true_path_is_the_papers_36_metres() -> None:
    path = leader_truth(paper_fleet(), 1, 0.0, 0.0).states
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert len(path) == 901
    assert float(steps.sum()) == pytest.approx(36.0, abs=0.01)
    assert float(np.max(np.abs(path[:, 2] - path[:, 3]))) == pytest.approx(0.0655, abs=1e-4)
    assert path[400, 2] == pytest.approx(math.pi / 4 - 4 * math.pi / 3, abs=1e-4)


def test_the_same_seed_is_the_same_truth_and_another_is_not() -> None:
    source = paper_fleet()
    first, again, other = (leader_truth(source, seed).states for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_landmarks_noise_does_not_depend_on_how_many_are_seen() -> None:
    source = paper_fleet()
    states = leader_truth(source, 1).states
    two, four = (
        measured_bearings(
            true_bearings(states, list(landmark_positions(source, count).values()), "fork"), 1, 0.05
        )
        for count in (2, 4)
    )
    assert np.array_equal(two, four[:, :2])


def test_four_landmarks_localise_the_leader_to_centimetres() -> None:
    result = run_leader(Job("leader-paper-4", 1))
    assert 0.03 < math.sqrt(result.position_mse_m2) < 0.12
    assert result.nis is not None
    assert 0.8 < result.nis < 1.2
    assert len(result.x_m) == len(result.bearing_rad) == KEPT


def test_the_bound_of_four_landmarks_is_six_centimetres() -> None:
    result = run_bound(Job("bound-4", 1))
    assert math.sqrt(result.position_mse_m2) == pytest.approx(0.061, abs=0.006)
    assert len(result.variance_m2) == KEPT


def test_the_formation_is_held_to_centimetres_and_a_seed_repeats() -> None:
    first, again = (run_formation(Job("formation-ours-scaled", 1)) for _ in range(2))
    assert first == again
    assert set(first.followers) == {"r2", "r3"}
    for follower in first.followers.values():
        assert math.sqrt(follower.place_mse_m2) < 0.03
        assert 0.8 < follower.nis < 1.2


def test_a_row_pools_squares_and_compares_with_the_bound() -> None:
    row = leader_row(
        [leader_result(0.01), leader_result(0.04)],
        [BoundResult([], 0.0125), BoundResult([], 0.0125)],
    )
    assert row.rmse_m == pytest.approx(math.sqrt(0.025))
    assert row.mean_rmse_m == pytest.approx(0.15)
    assert row.worst_rmse_m == pytest.approx(0.2)
    assert row.ratio == pytest.approx(math.sqrt(2))
    assert row.heading_rmse_rad == pytest.approx(0.02)
    assert (row.nees, row.nis) == (3.5, 1.0)


def test_without_landmarks_there_is_no_nis() -> None:
    assert leader_row([leader_result(1.0, None)], [BoundResult([], 1.0)]).nis is None


def test_followers_get_a_row_each() -> None:
    rows = follower_rows(
        [
            FormationResult({"r2": follower_result(1.0, 0.01), "r3": follower_result(4.0, 0.1)}),
            FormationResult({"r2": follower_result(7.0, 0.03), "r3": follower_result(4.0, 0.2)}),
        ]
    )
    assert rows["r2"].place_rms_m == pytest.approx(2.0)
    assert rows["r2"].lost == 2
    assert (rows["r2"].alpha_max_rad, rows["r2"].alpha_worst_rad) == (0.02, 0.03)
    assert (rows["r3"].range_rms_m, rows["r3"].bearing_rms_rad) == (2.0, 3.0)


def test_the_table_reads_the_same_as_document_and_as_markdown() -> None:
    row = leader_row([leader_result(0.01)], [BoundResult([], 0.01)])
    followers = follower_rows([FormationResult({"r2": follower_result(1.0, 0.01)})])
    table = PaperTable(
        100,
        Figure4("core alone", {"paper": {"2": row}}),
        Figure5({"ours": followers}, 1, {"r2": LockstepRow(0.015, None, 0.067, 0.036, 0.04)}),
    )
    document = json.loads(to_json(table))
    assert document["figure4"]["filters"]["paper"]["2"]["ratio"] == pytest.approx(1.0)
    assert document["figure5"]["lockstep"]["r2"]["place_rms_m"] == 0.015
    text = to_markdown(table)
    assert "| 2 | 0.1000 | 0.1000 | 0.1000 | 0.1000 | 1.000 | 0.0200 | 3.50 | 1.000 |" in text
    assert "| r2 | 0.0150 | - | 0.0670 | 0.0400 | 0.0360 |" in text
    assert "core alone" in text
    assert "in lockstep" in text


def test_figure_4_is_drawn_from_results(tmp_path: Path) -> None:
    results = {count: [leader_result(0.01, 1.0 if count else None)] * 2 for count in COUNTS}
    bounds = {count: [BoundResult([0.01] * KEPT, 0.01)] for count in COUNTS}
    files = draw_figure4("Figure 4", results, bounds, (1, 2), tmp_path, "figure4")
    assert [path.name for path in files] == ["figure4.png", "figure4.pdf"]
    assert all(path.stat().st_size > 10_000 for path in files)


def test_equal_figures_are_equal_files(tmp_path: Path) -> None:
    drawn = []
    for name in ("a", "b"):
        figure = Figure(figsize=(2, 2))
        figure.add_subplot().plot([1, 2], [2, 1])
        (tmp_path / name).mkdir()
        drawn.append([path.read_bytes() for path in save(figure, tmp_path / name, "line")])
    assert drawn[0] == drawn[1]


def test_the_command_keeps_results_and_goes_on_with_more_seeds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Job] = []

    def leader(job: Job) -> LeaderResult:
        asked.append(job)
        return leader_result(0.01 * job.seed)

    monkeypatch.setattr(paper_study, "run_leader", leader)
    monkeypatch.setattr(paper_study, "run_bound", lambda _: BoundResult([0.01] * KEPT, 0.01))
    monkeypatch.setattr(paper_study, "draw_figure4", lambda *_: [])
    common = ["study", "paper", "--out", str(tmp_path / "out"), "--only", "figure4", "--json"]
    common += ["--workers", "1"]
    first = RUNNER.invoke(app, [*common, "--seeds", "1"])
    assert first.exit_code == 0
    more = RUNNER.invoke(app, [*common, "--seeds", "3", "--resume"])
    assert more.exit_code == 0
    assert [job.seed for job in asked] == [1] * 10 + [2] * 10 + [3] * 10
    row = json.loads(more.stdout)["figure4"]["filters"]["ours"]["2"]
    assert row["rmse_m"] == pytest.approx(math.sqrt(0.02))
    assert row["ratio"] == pytest.approx(math.sqrt(2))
    assert json.loads((tmp_path / "out" / "table.json").read_bytes()) == json.loads(more.stdout)
    assert "| 2 | 0.1414" in (tmp_path / "out" / "table.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--seeds", "0"], "--seeds"),
        (["--only", "figure6"], "figure6"),
        (["--out", "{occupied}"], "is not empty"),
        (["--out", "{occupied}", "--resume"], "holds no study"),
        (["--out", "{occupied}/precious.txt/deeper"], "cannot make the folder"),
    ],
)
def test_bad_arguments_are_told_in_one_message(
    arguments: list[str], told: str, tmp_path: Path
) -> None:
    (tmp_path / "precious.txt").write_text("keep")
    given = [each.format(occupied=tmp_path) for each in arguments]
    result = RUNNER.invoke(app, ["study", "paper", *given])
    assert result.exit_code == 2
    assert told in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
