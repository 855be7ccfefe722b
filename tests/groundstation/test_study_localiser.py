"""The localiser's study: its bound, a small sample of its runs, and the bars that judge them."""

import io
import math
from statistics import fmean

import pytest
from rich.console import Console

from groundstation.study.bound_cells import BOUND_CELLS, BoundResult, run_bound
from groundstation.study.leader_cells import LeaderResult
from groundstation.study.localiser import judge, print_localiser, study_localiser
from groundstation.study.runner import Job


@pytest.mark.parametrize(("count", "bound_m"), [(2, 0.106), (3, 0.087), (4, 0.0612)])
def test_the_bound_is_that_of_the_mathematics(count: int, bound_m: float) -> None:
    """Section 10 has it from 60 paths."""
    runs = [run_bound(Job(BOUND_CELLS[count], seed)).position_mse_m2 for seed in range(1, 7)]
    assert math.sqrt(fmean(runs)) == pytest.approx(bound_m, rel=0.08)


def test_a_few_seeds_of_the_default_are_near_the_bound_and_honest() -> None:
    printed = io.StringIO()
    console = Console(file=printed, width=120)
    report = study_localiser("gaussian", (2, 4), 3, console, workers=1)
    assert set(report.landmarks) == {"2", "4"}
    for row in report.landmarks.values():
        assert row.ratio == pytest.approx(row.rmse_m / row.bound_m)
        assert row.ratio < 1.3
        assert 2.5 < row.nees < 5.5
    print_localiser(console, report)
    assert "gaussian localiser, paper scenario, 3 seeds (core alone)" in printed.getvalue()


@pytest.mark.parametrize(
    ("error_m", "nees", "missed"),
    [
        (0.109, 4.0, []),
        (0.111, 4.0, ["RMSE is 1.110 of the bound, limit 1.1"]),
        (0.1, 3.5, ["NEES is 3.50, limits 3.6 and 4.4"]),
        (0.1, math.nan, ["NEES is nan, limits 3.6 and 4.4"]),
    ],
)
def test_the_bars_judge_the_default_with_two_landmarks_and_more(
    error_m: float, nees: float, missed: list[str]
) -> None:
    run = LeaderResult([], [], [], [], error_m**2, 0.0, nees, 1.0)
    bound = BoundResult([], 0.01)
    assert judge(2, "gaussian", [run], [bound]).problems == missed
    assert judge(1, "gaussian", [run], [bound]).problems == []
    assert judge(2, "particle", [run], [bound]).problems == []
