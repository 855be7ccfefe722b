"""A recorded run gives the same outputs bit for bit, and a changed estimator does not."""

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from config import topics
from config.fleet import Fleet
from config.messages import RelativeEstimate, StepRecord
from groundstation import keys
from groundstation.errors import GroundError
from groundstation.lockstep import START_WALL_NS, Lockstep
from groundstation.recorder import About, Recorder
from groundstation.recording import read_messages
from groundstation.replay_check import check, to_text
from onboard.estimate.relative_ukf import RelativeUkf
from onboard.model.vehicle import WheelMotion
from tests.hil.fleets import shipped, straight

Keep = Callable[[str, bytes], bool]


def _record(path: Path, fleet: Fleet, mission: bool, keep: Keep = lambda key, body: True) -> None:
    """A run under virtual time: a mission from its start, or the first half second only."""

    def write(key: str, body: bytes, wall_ns: int) -> None:
        if keep(key, body):
            recorder.write(key, body, wall_ns)

    with (
        Recorder(path, fleet, About(START_WALL_NS, "lockstep", 3)) as recorder,
        Lockstep(fleet, 3, write, replayable=True) as lockstep,
    ):
        if mission:
            lockstep.start_mission()
            lockstep.run_for(0.7)
            lockstep.estop()
        lockstep.run_for(0.5)


@pytest.mark.parametrize("fleet", ["demo", "paper", "hardware"])
def test_runs_of_shipped_fleets_are_reproduced_bit_for_bit(fleet: str, tmp_path: Path) -> None:
    _record(tmp_path / "run.mcap", straight(fleet, 5.0), mission=True)
    report = check(tmp_path / "run.mcap")
    assert to_text(report).endswith("verdict: pass")
    assert {robot.robot for robot in report.robots} == set(shipped(fleet).robots)
    for robot in report.robots:
        assert robot.ok
        assert robot.steps > 100
        assert robot.messages > robot.steps


def test_a_change_of_a_billionth_in_the_estimator_is_named_with_topic_and_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _record(tmp_path / "run.mcap", shipped("demo"), mission=False)
    first = next(
        msgspec.json.decode(each.payload, type=RelativeEstimate)
        for each in read_messages(tmp_path / "run.mcap", ["echelon/demo/r2/relative"])
    )
    predict = RelativeUkf.predict

    def changed(self: RelativeUkf, dt_s: float, own: WheelMotion, leader: WheelMotion) -> None:
        predict(self, dt_s + 1e-9, own, leader)

    monkeypatch.setattr(RelativeUkf, "predict", changed)
    report = check(tmp_path / "run.mcap")
    assert not report.ok
    found = {robot.robot: robot.difference for robot in report.robots}
    assert found["r1"] is None
    difference = found["r2"]
    assert difference is not None
    assert difference.topic == "echelon/demo/r2/relative"
    assert difference.t_s == pytest.approx(first.t_ns * 1e-9, abs=0.03)
    assert "covariance" in difference.what
    assert f"echelon/demo/r2/relative at {difference.t_s:.3f} s" in to_text(report)


def test_missing_steps_are_a_gap_and_no_difference(tmp_path: Path) -> None:
    decoder = msgspec.json.Decoder(StepRecord)

    def keep(key: str, body: bytes) -> bool:
        address = keys.parse(key)
        dropped = address.topic is topics.STEP and address.robot == "r2"
        return not (dropped and decoder.decode(body).seq in (20, 21))

    _record(tmp_path / "run.mcap", shipped("demo"), mission=False, keep=keep)
    report = check(tmp_path / "run.mcap")
    robots = {robot.robot: robot for robot in report.robots}
    assert robots["r1"].ok
    assert robots["r2"].difference is None
    gap = robots["r2"].gap
    assert gap is not None
    assert (gap.first, gap.last) == (20, 21)
    assert "steps 20 to 21" in to_text(report)
    assert not report.ok


def test_a_message_that_was_not_received_is_still_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unheard = (topics.RELATIVE, topics.STATUS)
    _record(
        tmp_path / "run.mcap",
        shipped("demo"),
        mission=False,
        keep=lambda key, body: keys.parse(key).topic not in unheard,
    )
    assert check(tmp_path / "run.mcap").ok
    estimate = RelativeUkf.estimate

    monkeypatch.setattr(
        RelativeUkf,
        "estimate",
        lambda self: estimate(self)._replace(speed_scale=estimate(self).speed_scale + 1e-9),
    )
    found = [robot.difference for robot in check(tmp_path / "run.mcap").robots]
    assert found[1] is not None
    assert "check sum" in found[1].what


def test_a_recording_without_inputs_cannot_be_replayed(tmp_path: Path) -> None:
    def keep(key: str, body: bytes) -> bool:
        return keys.parse(key).topic not in topics.STEP_RECORD

    _record(tmp_path / "run.mcap", shipped("demo"), mission=False, keep=keep)
    with pytest.raises(GroundError, match="holds no robot's inputs"):
        check(tmp_path / "run.mcap")
