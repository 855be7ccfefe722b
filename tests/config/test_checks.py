"""What must hold between the parts of a fleet."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.advice import warnings
from config.loader import FleetFileError
from tests.config.fleet_files import loaded, small

Spoil = Callable[[dict[str, Any]], object]


def put(path: str, value: object) -> Spoil:
    """Set the value at a dotted path."""

    def spoil(data: dict[str, Any]) -> None:
        *owners, last = path.split(".")
        section = data
        for key in owners:
            section = section.setdefault(key, {})
        section[last] = value

    return spoil


def drop(*path: str) -> Spoil:
    """Remove the value at a path."""

    def spoil(data: dict[str, Any]) -> None:
        section = data
        for key in path[:-1]:
            section = section[key]
        del section[path[-1]]

    return spoil


MARKER_11 = [{"id": 11, "x_m": 0, "y_m": 0}]

CASES: list[tuple[Spoil, str, str]] = [
    (put("robots.r2.leader", "r9"), "robots.r2.leader", "no robot 'r9'; robots are r1, r2, r3"),
    (put("robots.r2.leader", "r2"), "robots.r2.leader", "a robot cannot follow itself"),
    (put("robots.r2.leader", "r3"), "robots.r2.leader", "form a cycle: r2 -> r3 -> r2"),
    (drop("robots", "r2", "offset"), "robots.r2", "a follower needs both"),
    (put("robots.r1.offset", {"x_m": -1, "y_m": 0}), "robots.r1", "a follower needs both"),
    (put("landmarks", MARKER_11), "robots.r1.markers[0].id", "id 11 is taken by a landmark"),
    (
        put("robots.r3.markers", MARKER_11),
        "robots.r3.markers[0].id",
        "id 11 is taken by a marker of r1",
    ),
    (drop("landmarks"), "landmarks", "`landmarks` is missing"),
    (
        put("robots.r1.localiser.start", "unknown"),
        "robots.r1.localiser.start",
        "an unknown pose is found by landmarks and `landmarks` is empty",
    ),
    (put("defaults.can.channel", "x.sock"), "defaults.can.channel", "has the same channel"),
    (put("defaults.can.channel", "{robto}"), "defaults.can.channel", "placeholder {robto}; known"),
    (
        put("types.car.vehicle.drive.node", 1),
        "types.car.vehicle.drive.node",
        "node 1 is the steering's too",
    ),
    (
        put("types.car.vehicle.drive.node", 3),
        "types.car.vehicle.drive.node",
        "node 3 is the steering encoder",
    ),
    (
        put("types.car.vehicle.steering.node", 10),
        "types.car.vehicle.steering.node",
        "reserved for bearing sensors",
    ),
    (put("ground", "127.0.0.1:7447"), "ground", "write tcp/HOST:PORT"),
    (put("ground", "tcp/host:99999"), "ground", "is no endpoint"),
    (
        put("robots.r2.listen", "tcp/127.0.0.1:7447"),
        "robots.r2.listen",
        "the ground station listens on tcp/127.0.0.1:7447 too",
    ),
    (put("mission.acceptance.from_s", 20), "mission.acceptance.from_s", "the mission lasts 20 s"),
    (
        put("robots.r3.limits.speed_mps", 0.5),
        "robots.r3.limits.speed_mps",
        "0.5 m/s is less than the mission's 1 m/s",
    ),
    (put("robots.r2.offset.x_m", -0.1), "robots.r2.offset", "only 0.10 m from r1's place"),
    (put("robots.r3.offset.x_m", 0.5), "robots.r3.offset", "only 0.00 m from r1's place"),
    (put("robots.r2.start.x_m", 0.1), "robots.r2.start", "only 0.10 m from r1's place"),
    (put("robots.all", {}), "robots.all", "is missing"),
]


@pytest.mark.parametrize(("spoil", "path", "words"), CASES, ids=[case[2] for case in CASES])
def test_contradictions_are_placed_and_explained(
    tmp_path: Path, spoil: Spoil, path: str, words: str
) -> None:
    data = small()
    spoil(data)
    with pytest.raises(FleetFileError) as caught:
        loaded(tmp_path, data)
    assert any(p.path == path and words in p.text for p in caught.value.problems), caught.value


def test_two_robots_that_follow_nobody_are_one_too_many(tmp_path: Path) -> None:
    data = small()
    drop("robots", "r3", "leader")(data)
    drop("robots", "r3", "offset")(data)
    with pytest.raises(FleetFileError, match=r"robots\.r3: has no `leader`, but r1 leads already"):
        loaded(tmp_path, data)


@pytest.mark.parametrize("name", ["all", "ground", "R1", "a/b", "r*"])
def test_names_that_would_break_the_topics_are_refused(tmp_path: Path, name: str) -> None:
    data = small()
    data["robots"][name] = data["robots"].pop("r3")
    with pytest.raises(FleetFileError, match=r"choose another|must start with a-z"):
        loaded(tmp_path, data)


def test_real_robots_may_all_call_their_bus_can0(tmp_path: Path) -> None:
    data = small()
    data["defaults"]["can"] = {"interface": "socketcan", "channel": "can0"}
    assert loaded(tmp_path, data).robots["r3"].can.channel == "can0"


@pytest.mark.parametrize(("ahead_m", "allowed"), [(0.17, True), (0.18, False)])
def test_a_polar_follower_keeps_its_leader_ahead_of_its_rear_axle(
    tmp_path: Path, ahead_m: float, allowed: bool
) -> None:
    """L = d - x must exceed 0.3 d, with d = 0.25 m."""
    data = small()
    data["robots"]["r2"] |= {
        "offset": {"x_m": ahead_m, "y_m": 0.5},
        "formation": {"law": "polar"},
    }
    if allowed:
        assert loaded(tmp_path, data)
        return
    with pytest.raises(FleetFileError, match=r"too far ahead for law `polar`, at most 0\.175 m"):
        loaded(tmp_path, data)


def test_a_gain_beyond_the_steering_rule_brings_a_warning(tmp_path: Path) -> None:
    """tau <= 1 / (2 (k + V/L)): with tau 0.05 s, V 1 m/s and L 0.25 m that is k <= 6."""
    data = small()
    data["simulation"] = {"steering": {"lag_s": 0.05}}
    data["defaults"]["formation"] = {"gain_per_s": 5.9}
    assert warnings(loaded(tmp_path, data)) == []
    data["robots"]["r2"]["formation"] = {"gain_per_s": 6.1}
    (warning,) = warnings(loaded(tmp_path, data))
    assert warning.startswith("robots.r2.formation.gain_per_s: 6.1/s is high")
    assert "at most 6/s" in warning


def test_driving_on_the_papers_filter_brings_a_warning_for_each_follower(tmp_path: Path) -> None:
    data = small()
    data["simulation"] = {"steering": {"lag_s": 0.05}}
    data["defaults"]["relative_filter"] = {"kind": "paper"}
    found = warnings(loaded(tmp_path, data))
    followers = [name for name, robot in data["robots"].items() if "leader" in robot]
    assert [warning.partition(":")[0] for warning in found] == [
        f"robots.{name}.relative_filter.kind" for name in followers
    ]
    assert all("`ukf` is the filter for robots" in warning for warning in found)
