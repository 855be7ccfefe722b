"""The direction of the state that a window of bearings tells least about, in words."""

import math
from collections.abc import Mapping

from config.angles import wrap
from onboard.model.window_gramian import Weakness

ALONG_RAD = 0.35
"""A direction this close to the line to a landmark is named after it."""

ABOUT_FRACTION = 0.2
"""A centre of rotation this close to a landmark, in its distances, is named after it."""


def in_words(
    weakest: Weakness,
    place_m: tuple[float, float],
    seen: Mapping[int, tuple[float, float]],
) -> str:
    """What cannot be told well, e.g. "heading about landmark 103".

    `seen` are the landmarks in the window, by id.
    """
    if not seen:
        return "position and heading: no landmark in view"
    if len(seen) == 1 and weakest.blind:
        (mark,) = seen
        distance = " and the distance to it" if weakest.blind > 1 else ""
        return f"heading about landmark {mark}{distance}"
    x, y, theta, delta = weakest.direction
    shift = math.hypot(x, y)
    if abs(delta) > max(shift, abs(theta)):
        return "fork direction"
    if abs(theta) * _farthest(place_m, seen) > shift / 2:
        return _rotation(x / theta, y / theta, place_m, seen)
    return _translation(math.atan2(y, x), place_m, seen)


def _farthest(place_m: tuple[float, float], seen: Mapping[int, tuple[float, float]]) -> float:
    return max(math.dist(place_m, mark) for mark in seen.values())


def _rotation(
    x: float, y: float, place_m: tuple[float, float], seen: Mapping[int, tuple[float, float]]
) -> str:
    """A turn by 1 that moves the robot by (x, y) is one about the point beside it."""
    centre = (place_m[0] - y, place_m[1] + x)
    mark, error = min(
        ((mark, math.dist(centre, at) / math.dist(place_m, at)) for mark, at in seen.items()),
        key=lambda pair: pair[1],
    )
    if error < ABOUT_FRACTION:
        return f"heading about landmark {mark}"
    return f"heading about the point ({centre[0]:.1f}, {centre[1]:.1f}) m"


def _translation(
    course_rad: float, place_m: tuple[float, float], seen: Mapping[int, tuple[float, float]]
) -> str:
    def off(mark: int) -> float:
        x, y = seen[mark]
        line = math.atan2(y - place_m[1], x - place_m[0])
        return abs(math.remainder(course_rad - line, math.pi))

    mark = min(seen, key=off)
    if off(mark) < ALONG_RAD:
        return f"position along the line to landmark {mark}"
    return f"position towards {math.degrees(wrap(course_rad)):.0f} deg"
