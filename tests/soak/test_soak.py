"""A tiny `make soak`, and its judgement on figures whose drift is known."""

from pathlib import Path

import numpy as np
import pytest

from config.loader import load_fleet
from tests.processes.running import write_fleet
from tests.soak.fleet import circling
from tests.soak.report import report, verdict
from tests.soak.samples import Sample, SampleFile
from tests.soak.trend import trend
from tests.soak.virtual import VirtualSoak


def noisy(slope: float, sessions: int = 1) -> list[tuple[float, float, float]]:
    rng = np.random.default_rng(5)
    return [
        (float(session), float(t), 50.0 + 7.0 * session + slope * t + rng.normal(0.0, 0.3))
        for session in range(sessions)
        for t in range(100)
    ]


@pytest.mark.parametrize("sessions", [1, 3])
@pytest.mark.parametrize("slope", [0.0, 0.05, -0.02])
def test_the_slope_is_found_whatever_the_level_of_each_session(slope: float, sessions: int) -> None:
    found = trend(noisy(slope, sessions))
    assert found is not None
    assert found.low <= slope <= found.high
    assert found.high - found.low < 0.01


def test_noise_that_lasts_makes_the_slope_less_certain() -> None:
    rng, value, points = np.random.default_rng(3), 0.0, []
    for t in range(200):
        value = 0.95 * value + rng.normal()
        points.append((0.0, float(t), value))
    found, quiet = trend(points), trend(noisy(0.0))
    assert found is not None
    assert quiet is not None
    assert found.high - found.low > 5 * (quiet.high - quiet.low)


def test_too_few_samples_have_no_slope() -> None:
    assert trend([(0.0, float(t), 1.0) for t in range(4)]) is None


@pytest.mark.parametrize(("slope", "said"), [(0.0, "flat"), (0.05, "DRIFT"), (0.02, "open")])
def test_a_drift_is_told_from_noise(slope: float, said: str) -> None:
    found = trend(noisy(slope))
    assert found is not None
    assert verdict(found, 100.0, 2.0) == said


def test_a_fleet_that_stands_for_good_fails_the_report() -> None:
    shares = [0.8, 0.0, 0.7, 0.0, 0.0]
    driving = [Sample(0, 60.0 * n, {"driving_share": share}) for n, share in enumerate(shares)]
    assert not report(driving, "virtual")
    assert report([*driving, Sample(0, 300.0, {"driving_share": 0.0})], "virtual")


def test_the_fleet_can_be_handed_to_real_processes(tmp_path: Path) -> None:
    assert load_fleet(write_fleet(tmp_path, circling())).fleet.robots.keys() == {"r1", "r2"}


def test_a_leak_fails_the_report(capsys: pytest.CaptureFixture[str]) -> None:
    leaking = [Sample(0, 60.0 * n, {"rss_mb": 60.0 + 0.5 * n}) for n in range(40)]
    assert report(leaking, "virtual")
    assert "DRIFT" in capsys.readouterr().out


def test_a_line_that_an_interruption_has_cut_off_is_left_out(tmp_path: Path) -> None:
    file = SampleFile(tmp_path / "soak.jsonl")
    file.append(Sample(0, 60.0, {"rss_mb": 60.0}))
    with (tmp_path / "soak.jsonl").open("ab") as raw:
        raw.write(b'{"session":0,"t_s":12')
    assert [sample.t_s for sample in file.read()] == [60.0]


def test_a_fleet_that_is_disturbed_comes_back_and_nobody_moves_at_rest() -> None:
    soak = VirtualSoak(circling(), 1, 0, 0.0)
    try:
        sample = soak.minute(20.0)
    finally:
        soak.close()
    assert soak.operator.done["starts"] >= 1
    assert soak.operator.done["faults"] >= 1
    assert sample.figures["driving_share"] > 0.4
    assert sample.figures["moving_at_rest"] == 0.0
    assert sample.figures["blocked"] == 0.0
