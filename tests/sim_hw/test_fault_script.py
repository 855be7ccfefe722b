"""Scripted faults: mistakes are named with their place, times count from motion or power-up."""

from pathlib import Path

import pytest

from config.fault_script import load_faults
from config.faults import FaultScript
from config.problems import FleetFileError
from sim_hw.fleet import SimulatedFleet
from tests.sim_hw.fleets import database, fleet

ROBOTS = ("r1", "r2")
GOOD = """\
version: 1
faults:
  - {at: 0.5, for: 0.2, robot: r2, device: bearing, kind: stuck}
  - {at: 1, robot: r1, device: drive, kind: undervolt, value: 9}
"""


def loaded(folder: Path, text: str) -> FaultScript:
    path = folder / "faults.yaml"
    path.write_text(text, encoding="utf-8")
    return load_faults(path, ROBOTS)


def test_a_file_is_read_with_its_defaults(tmp_path: Path) -> None:
    script = loaded(tmp_path, GOOD)
    assert script.clock == "motion"
    first, second = script.faults
    assert (first.at_s, first.for_s, first.robot, first.kind) == (0.5, 0.2, "r2", "stuck")
    assert (second.for_s, second.value) == (None, 9.0)


@pytest.mark.parametrize(
    ("right", "wrong", "place", "named"),
    [
        ("robot: r2", "robot: r3", "3:32", "no robot 'r3'"),
        ("bearing", "bearin", "3:44", "did you mean 'bearing'"),
        ("kind: stuck", "kind: stick", "3:59", "no fault of bearing 'stick'; did you mean 'stuck'"),
        ("value: 9", "value: 99", "4:63", "99 is not allowed for undervolt: 0 to 60 V"),
        ("for: 0.2", "form: 0.2", "3:15", "unknown key; did you mean `for`"),
        ("for: 0.2", "for: -1", "3:20", "-1 is not allowed"),
        ("at: 0.5", "at: soon", "3:10", "'soon' is not allowed"),
        ("robot: r1, ", "", "4:5", "`robot` is missing"),
        ("version: 1", "version: 2", "1:10", "2 is not allowed"),
        ("version: 1", "version: 1\nclock: noon", "2:8", "'noon' is not allowed"),
    ],
)
def test_a_mistake_is_shown_in_its_place(
    tmp_path: Path, right: str, wrong: str, place: str, named: str
) -> None:
    assert right in GOOD
    with pytest.raises(FleetFileError) as refusal:
        loaded(tmp_path, GOOD.replace(right, wrong, 1))
    assert f"faults.yaml:{place}: " in str(refusal.value)
    assert named in str(refusal.value)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FleetFileError, match="cannot be read"):
        load_faults(tmp_path / "none.yaml", ROBOTS)
    with pytest.raises(FleetFileError, match="starts with `version: 1`"):
        loaded(tmp_path, "")


def test_times_count_from_power_up_where_the_file_says_so(tmp_path: Path) -> None:
    sim = SimulatedFleet(fleet(2), 1, 100.0, database())
    sim.play(loaded(tmp_path, GOOD.replace("faults:", "clock: power\nfaults:")))
    sim.advance(100.49)
    assert sim.take_notes() == []
    sim.advance(100.501)
    assert sim.robots["r2"].active_faults("bearing") == ["stuck"]
    sim.advance(100.701)
    assert sim.robots["r2"].active_faults("bearing") == []
    sim.advance(101.001)
    assert sim.take_notes() == [
        "r2 bearing: stuck for 0.2 s",
        "r2 bearing: stuck ends",
        "r1 drive: undervolt 9 V",
    ]


def test_times_count_from_the_first_motion_otherwise(tmp_path: Path) -> None:
    sim = SimulatedFleet(fleet(2), 1, 100.0, database())
    sim.play(loaded(tmp_path, GOOD))
    sim.advance(102.0)
    assert sim.take_notes() == []
    sim.robots["r1"].drive.axis.motor.velocity_rps = 3.0
    sim.advance(102.49)
    assert sim.take_notes() == []
    sim.advance(102.51)
    assert sim.take_notes() == ["r2 bearing: stuck for 0.2 s"]
