"""A sample of `make kills`: signals to real processes, judged on truth."""

import signal

import pytest

from tests.processes.kills import Round, run_round

pytestmark = pytest.mark.process


@pytest.mark.parametrize(
    ("target", "number"), [("r2", signal.SIGSTOP), ("r1", signal.SIGTERM)], ids=["hangs", "ended"]
)
def test_after_a_signal_every_robot_stands_says_why_and_stays(
    target: str, number: signal.Signals
) -> None:
    outcome = run_round(Round(0, target, number, 0.5))
    assert outcome.problems == []
