"""The formations that a fleet may change between: the robots' own offsets, and named ones."""

import math
from collections.abc import Iterator, Mapping
from itertools import combinations

from config.fleet import Fleet, Point

DEFAULT = "default"
"""The formation that the robots' `offset` describe, and that they begin in."""

Places = Mapping[str, tuple[float, float]]


def formation_names(fleet: Fleet) -> list[str]:
    """Every formation of the fleet file, the default one first."""
    return [DEFAULT, *fleet.formations]


def place_of(fleet: Fleet, robot: str, formation: str) -> Point:
    """A follower's place in its leader's body axes. A formation may leave robots where they are.

    Raises KeyError for an unknown formation and for a robot that follows nobody.
    """
    named = {} if formation == DEFAULT else fleet.formations[formation]
    offset = named.get(robot, fleet.robots[robot].offset)
    if offset is None:
        raise KeyError(f"{robot} follows nobody")
    return offset


def slide_speed_mps(fleet: Fleet, robot: str, source: str, target: str) -> float:
    """Speed of a follower's place on its way between two formations.

    The longest way is gone at `formation_change_mps`, the others so that all arrive together.
    """
    ways = {
        name: _way_m(fleet, name, source, target)
        for name, settings in fleet.robots.items()
        if settings.leader is not None
    }
    longest_m = max(ways.values())
    return fleet.formation_change_mps * ways[robot] / longest_m if longest_m > 0 else 0.0


def nearest_on_the_way(source: Places, target: Places) -> Iterator[tuple[str, str, float]]:
    """Per pair of robots the least distance [m] while all go from place to place in step."""
    for one, other in combinations(source, 2):
        before = _difference(source[one], source[other])
        after = _difference(target[one], target[other])
        yield one, other, _nearest_to_origin(before, after)


def _way_m(fleet: Fleet, robot: str, source: str, target: str) -> float:
    start, end = place_of(fleet, robot, source), place_of(fleet, robot, target)
    return math.hypot(end.x_m - start.x_m, end.y_m - start.y_m)


def _difference(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    return one[0] - other[0], one[1] - other[1]


def _nearest_to_origin(start: tuple[float, float], end: tuple[float, float]) -> float:
    """Distance of the straight line between two points from the origin."""
    dx, dy = _difference(end, start)
    length_squared = dx * dx + dy * dy
    share = 0.0
    if length_squared > 0:
        share = min(1.0, max(0.0, -(start[0] * dx + start[1] * dy) / length_squared))
    return math.hypot(start[0] + share * dx, start[1] + share * dy)
