"""The studies of the follower's filter, sampled: the same bars, few seeds. Core alone."""

import json

import pytest
from typer.testing import CliRunner

from groundstation.cli import app
from groundstation.study.direction import PAPER_MAX_RAD
from groundstation.study.direction_run import Variant, drive_direction
from groundstation.study.relative import Case, judge
from groundstation.study.straight_leg import Leg, drive_leg


def test_two_markers_keep_the_range_and_claim_it_honestly() -> None:
    leg = Leg(scale_error=0.02, opposite=True, seconds=12.0)
    row = judge(Case(2, True, 12.0), [drive_leg(leg, seed) for seed in (1, 2)])
    assert row.problems == []
    assert row.nis_mean == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("mutual", [True, False])
def test_with_one_marker_the_robot_says_so_and_keeps_away(mutual: bool) -> None:
    leg = Leg(scale_error=0.02, markers=1, mutual=mutual, seconds=15.0)
    runs = [drive_leg(leg, seed) for seed in (1, 2, 3)]
    assert judge(Case(1, mutual, 15.0), runs).problems == []
    assert all(run.reported_s is not None and run.reported_s < 3.0 for run in runs)
    for run in runs:
        if run.stopped_s is not None:
            assert "range to r1" in run.reason
            assert "3 sigma" in run.reason
            assert "limit 0.200 m" in run.reason


def test_the_same_seed_gives_the_same_run() -> None:
    leg = Leg(scale_error=0.01, opposite=False, seconds=2.0)
    assert drive_leg(leg, 7) == drive_leg(leg, 7)
    assert drive_leg(leg, 7) != drive_leg(leg, 8)


def test_the_papers_filter_stays_within_the_papers_only_number_unless_rates_are_mixed_up() -> None:
    """The erratum's error appears where the fork jumps; the corrected model has none of it."""
    right, wrong = (drive_direction(v, 1) for v in (Variant.PAPER, Variant.PAPER_FORK_RATE))
    assert right.from_start_rad <= PAPER_MAX_RAD
    assert wrong.settled_rad > 5 * right.settled_rad


def test_the_command_prints_one_document_and_tells_good_from_bad() -> None:
    arguments = ["study", "relative", "--seeds", "1", "--seconds", "1", "--json"]
    result = CliRunner().invoke(app, arguments)
    document = json.loads(result.stdout)
    assert (document["mode"], document["markers"]) == ("core alone", 2)
    assert set(document["scale_errors"]) == {"0.01", "0.02"}
    assert document["ok"] == (result.exit_code == 0)
