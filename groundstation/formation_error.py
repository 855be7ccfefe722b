"""What truth says about a formation: how far each follower is from its place, and from the others.

All functions take truth of several robots at the same instants.
"""

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from config.fleet import Point
from groundstation.series import Floats, Sightline, Times, Track


class FormationError(NamedTuple):
    """A follower's error over time: in its leader's body axes, and in what it sees."""

    t_ns: Times
    position_m: Floats
    range_m: Floats
    bearing_rad: Floats


def wrap(angle_rad: Floats) -> Floats:
    """Wrap angles [rad] into [-pi, pi)."""
    wrapped: Floats = np.mod(angle_rad + math.pi, math.tau) - math.pi
    return wrapped


def at_common_times(first: Track, second: Track) -> tuple[Track, Track]:
    """Both tracks at the instants that they share."""
    _, rows, others = np.intersect1d(first.t_ns, second.t_ns, return_indices=True)
    return first.at(rows), second.at(others)


def interpolated(track: Track, t_ns: Times) -> Track:
    """A track at other times within its span; headings turn the short way and stay unwrapped.

    Raises ValueError when the track is empty.
    """
    if not track.t_ns.size:
        raise ValueError("an empty track has no values in between")
    origin = track.t_ns[0]
    known, wanted = (track.t_ns - origin).astype(float), (t_ns - origin).astype(float)
    heading = np.unwrap(track.heading_rad)
    return Track(
        t_ns,
        np.interp(wanted, known, track.x_m),
        np.interp(wanted, known, track.y_m),
        np.interp(wanted, known, heading),
    )


def sightline(follower: Track, leader: Track) -> Sightline:
    """The leader's front point seen from the follower's, in the follower's body frame."""
    dx, dy = leader.x_m - follower.x_m, leader.y_m - follower.y_m
    bearing = wrap(np.arctan2(dy, dx) - follower.heading_rad)
    alpha = wrap(leader.heading_rad - follower.heading_rad)
    return Sightline(follower.t_ns, np.hypot(dx, dy), bearing, alpha)


def desired_sightline(offset: Point) -> tuple[float, float]:
    """Range [m] and bearing [rad] at which a follower in its place sees its leader."""
    return math.hypot(offset.x_m, offset.y_m), math.atan2(-offset.y_m, -offset.x_m)


def formation_error(follower: Track, leader: Track, offset: Point) -> FormationError:
    """Errors of a follower against its desired offset in the leader's body axes."""
    dx, dy = follower.x_m - leader.x_m, follower.y_m - leader.y_m
    cos, sin = np.cos(leader.heading_rad), np.sin(leader.heading_rad)
    forward, left = cos * dx + sin * dy, cos * dy - sin * dx
    seen = sightline(follower, leader)
    desired_range, desired_bearing = desired_sightline(offset)
    return FormationError(
        follower.t_ns,
        np.hypot(forward - offset.x_m, left - offset.y_m),
        seen.range_m - desired_range,
        wrap(seen.bearing_rad - desired_bearing),
    )


class Proximity(NamedTuple):
    """The smallest distance between any two robots, and how often two came too close."""

    min_distance_m: float | None
    collisions: int


def proximity(truth: dict[str, Track], limit_m: float) -> Proximity:
    """Distances between front points over the whole run; an episode below the limit counts once."""
    smallest, episodes = math.inf, 0
    for first, second in combinations(truth.values(), 2):
        one, other = at_common_times(first, second)
        distance = np.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
        if distance.size:
            smallest = min(smallest, float(distance.min()))
            near = distance < limit_m
            episodes += int(near[0]) + int(np.count_nonzero(near[1:] & ~near[:-1]))
    return Proximity(smallest if math.isfinite(smallest) else None, episodes)
