"""Named formations: who goes where, how fast, and which changes a fleet file may not offer."""

import math

import pytest

from config.checks import findings
from config.fleet import Fleet, Point
from config.formations import (
    DEFAULT,
    formation_names,
    nearest_on_the_way,
    place_of,
    slide_speed_mps,
)
from config.loader import load_fleet, shipped_fleet_path

DEMO = load_fleet(shipped_fleet_path("demo")).fleet


def having(**formations: dict[str, Point]) -> Fleet:
    return DEMO.model_copy(update={"formations": formations})


def test_the_robots_own_offsets_are_the_default_formation() -> None:
    assert formation_names(DEMO) == [DEFAULT, "wide", "left"]
    assert place_of(DEMO, "r2", DEFAULT) == DEMO.robots["r2"].offset
    assert place_of(DEMO, "r2", "wide") == Point(x_m=-0.5, y_m=-0.5)


def test_a_robot_that_a_formation_does_not_name_stays_where_it_is() -> None:
    fleet = having(near={"r3": Point(x_m=-0.3, y_m=-0.3)})
    assert place_of(fleet, "r2", "near") == fleet.robots["r2"].offset
    assert slide_speed_mps(fleet, "r2", DEFAULT, "near") == 0.0
    assert slide_speed_mps(fleet, "r3", DEFAULT, "near") == fleet.formation_change_mps


def test_all_robots_take_the_same_time() -> None:
    fleet = having(
        far={"r2": Point(x_m=-1.3182, y_m=-0.3182), "r3": Point(x_m=-0.8182, y_m=-0.3182)}
    )
    assert slide_speed_mps(fleet, "r2", DEFAULT, "far") == pytest.approx(0.2)
    assert slide_speed_mps(fleet, "r3", DEFAULT, "far") == pytest.approx(0.1)


def test_the_nearest_point_on_the_way_is_that_of_many_steps() -> None:
    before = {"a": (0.0, 0.0), "b": (-1.0, -1.0)}
    after = {"a": (0.5, 0.0), "b": (-0.2, 1.5)}
    ((_, _, nearest),) = nearest_on_the_way(before, after)
    shares = [step / 10_000 for step in range(10_001)]
    stepped = min(
        math.hypot(1.0 + share * (0.7 - 1.0), 1.0 + share * (-1.5 - 1.0)) for share in shares
    )
    assert nearest == pytest.approx(stepped, abs=1e-6)


def test_a_change_in_which_two_robots_would_meet_is_refused() -> None:
    meeting = having(mirror={"r2": Point(x_m=0.3182, y_m=0.3182)})
    texts = [f"{path}: {text}" for path, text in findings(meeting)]
    assert any("'mirror'" in text and "r1 and r2 come within 0.00 m" in text for text in texts)


def test_a_formation_may_place_followers_only() -> None:
    wrong = having(odd={"r1": Point(x_m=0, y_m=0), "r9": Point(x_m=-1, y_m=0)})
    texts = [text for _, text in findings(wrong)]
    assert "no follower 'r1'; followers are r2, r3" in texts
    assert "no follower 'r9'; followers are r2, r3" in texts


def test_the_shipped_formations_are_fine() -> None:
    assert findings(DEMO) == []
