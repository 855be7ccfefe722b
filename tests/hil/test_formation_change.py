"""Robots change formation while they drive, in virtual time, judged on truth."""

import itertools
import math

import pytest

from config.formations import place_of
from groundstation.lockstep import Lockstep
from tests.hil.fleets import driving, straight

DEMO = straight("demo", 60.0)


def error_m(lockstep: Lockstep, name: str, formation: str) -> float:
    """How far a follower truly is from its place in a formation."""
    leader = DEMO.robots[name].leader
    assert leader is not None
    own, ahead = (lockstep.simulation.robots[each].truth for each in (name, leader))
    dx, dy = own.x_m - ahead.x_m, own.y_m - ahead.y_m
    cos, sin = math.cos(ahead.heading_rad), math.sin(ahead.heading_rad)
    place = place_of(DEMO, name, formation)
    return math.hypot(cos * dx + sin * dy - place.x_m, cos * dy - sin * dx - place.y_m)


@pytest.mark.parametrize("formation", ["wide", "left"])
def test_every_follower_goes_to_its_new_place_and_none_comes_near(formation: str) -> None:
    with driving(DEMO, for_s=8.0) as lockstep:
        for name in DEMO.robots:
            assert lockstep.command(name, "formation", formation=formation).accepted
        nearest_m = math.inf
        for _ in range(100):
            lockstep.run_for(0.1)
            truths = [lockstep.simulation.robots[name].truth for name in DEMO.robots]
            for one, other in itertools.pairwise(truths):
                apart_m = math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
                nearest_m = min(nearest_m, apart_m)
        assert nearest_m > DEMO.mission.acceptance.min_distance_m
        for name in ("r2", "r3"):
            assert error_m(lockstep, name, formation) < 0.06
            assert lockstep.statuses[name].formation == formation
            assert lockstep.statuses[name].state == "RUNNING"


def test_a_formation_that_the_file_does_not_have_is_refused() -> None:
    with Lockstep(DEMO, 1) as lockstep:
        reply = lockstep.command("r2", "formation", formation="star")
    assert not reply.accepted
    assert reply.reason == "no formation 'star' here; known are default, wide, left"
