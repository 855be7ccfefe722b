"""What must hold between the parts of a fleet, beyond the range of each value.

Every check yields the path of the value to change and what is wrong with it.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from itertools import combinations

from config.can.plan import BEARING_SENSOR_NODES, STEERING_ENCODER_NODE
from config.fleet import Fleet, Marker, Point
from config.formations import DEFAULT, formation_names, nearest_on_the_way, place_of
from config.runtime import PLACEHOLDERS, expand_channel, unknown_placeholders
from config.yaml_tree import Path

Finding = tuple[Path, str]

MIN_AXLE_DISTANCE = 0.3
"""Of a wheelbase: how far the leader must stay ahead of a `polar` follower's rear axle."""

_ROBOT_NAME = re.compile(r"[a-z][a-z0-9_-]*")
_RESERVED_NAMES = frozenset({"all", "alive", "ground", "sim"})
_ENDPOINT = re.compile(r"tcp/(\[[0-9a-fA-F:.]+\]|[^\s/:\[\]]+):([0-9]{1,5})")
_LOCAL_INTERFACES = frozenset({"simcan", "virtual"})


def findings(fleet: Fleet) -> list[Finding]:
    """Everything that the checks find, none of it excusable."""
    return [finding for check in CHECKS for finding in check(fleet)]


def leader_chain(fleet: Fleet, robot: str) -> list[str]:
    """The robot, its leader, its leader's leader ...; ends with a repeated name in a cycle."""
    chain = [robot]
    while (leader := fleet.robots[chain[-1]].leader) in fleet.robots:
        assert leader is not None
        chain.append(leader)
        if leader in chain[:-1]:
            break
    return chain


def in_cycle(fleet: Fleet, robot: str) -> bool:
    """True where following leaders from this robot never ends."""
    chain = leader_chain(fleet, robot)
    return chain[-1] in chain[:-1]


def _robot_names(fleet: Fleet) -> Iterator[Finding]:
    for name in fleet.robots:
        if name in _RESERVED_NAMES:
            yield ("robots", name), "this name has a meaning of its own: choose another"
        elif not _ROBOT_NAME.fullmatch(name):
            yield ("robots", name), "must start with a-z and go on with a-z, 0-9, _ or -"


def _leaders_exist(fleet: Fleet) -> Iterator[Finding]:
    for name, robot in fleet.robots.items():
        if robot.leader is None:
            continue
        if robot.leader == name:
            yield ("robots", name, "leader"), "a robot cannot follow itself"
        elif robot.leader not in fleet.robots:
            near = get_close_matches(robot.leader, fleet.robots, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"robots are {', '.join(fleet.robots)}"
            yield ("robots", name, "leader"), f"no robot {robot.leader!r}; {hint}"


def _no_leader_cycle(fleet: Fleet) -> Iterator[Finding]:
    reported: set[str] = set()
    for name, robot in fleet.robots.items():
        if name in reported or robot.leader == name or not in_cycle(fleet, name):
            continue
        chain = leader_chain(fleet, name)
        cycle = chain[chain.index(chain[-1]) :]
        reported.update(chain)
        if len(cycle) > 2 and name in cycle:
            text = f"leaders form a cycle: {' -> '.join(cycle)}; one of them must lead the fleet"
            yield ("robots", name, "leader"), text


def _one_root(fleet: Fleet) -> Iterator[Finding]:
    roots = [name for name, robot in fleet.robots.items() if robot.leader is None]
    for name in roots[1:]:
        text = f"has no `leader`, but {roots[0]} leads already: give it a `leader` and an `offset`"
        yield ("robots", name), text


def _identifiers_unique(fleet: Fleet) -> Iterator[Finding]:
    owners: dict[int, str] = {}
    for path, marker in _markers(fleet):
        owner = "a landmark" if path[0] == "landmarks" else f"a marker of {path[1]}"
        if marker.id in owners:
            yield (*path, "id"), f"id {marker.id} is taken by {owners[marker.id]}: ids are unique"
        owners.setdefault(marker.id, owner)


def _markers(fleet: Fleet) -> Iterator[tuple[Path, Marker]]:
    for index, landmark in enumerate(fleet.landmarks):
        yield ("landmarks", index), landmark
    for name, robot in fleet.robots.items():
        for index, marker in enumerate(robot.markers):
            yield ("robots", name, "markers", index), marker


def _landmarks_given(fleet: Fleet) -> Iterator[Finding]:
    if "landmarks" not in fleet.model_fields_set:
        yield (
            ("landmarks",),
            "`landmarks` is missing: the leading robot localises by them "
            "(write `landmarks: []` to drive by odometry alone)",
        )
    if fleet.landmarks:
        return
    for name, robot in fleet.robots.items():
        if robot.leader is None and robot.localiser.start == "unknown":
            yield (
                ("robots", name, "localiser", "start"),
                "an unknown pose is found by landmarks and `landmarks` is empty: list at least 2, "
                "or write `start: known`",
            )


def _channels_differ(fleet: Fleet) -> Iterator[Finding]:
    """On one machine; real robots may each have a `can0` of their own."""
    owners: dict[tuple[str, str], str] = {}
    for name, robot in fleet.robots.items():
        path = ("robots", name, "can", "channel")
        for unknown in unknown_placeholders(robot.can.channel):
            known = ", ".join(f"{{{word}}}" for word in PLACEHOLDERS)
            yield path, f"unknown placeholder {{{unknown}}}; known are {known}"
        key = robot.can.interface, expand_channel(fleet, name)
        if robot.can.interface in _LOCAL_INTERFACES and key in owners:
            yield path, f"{owners[key]} has the same channel: put {{robot}} into it"
        owners.setdefault(key, name)


def _nodes_free(fleet: Fleet) -> Iterator[Finding]:
    for name, robot in fleet.robots.items():
        vehicle = robot.vehicle
        for axis, node in (("steering", vehicle.steering.node), ("drive", vehicle.drive.node)):
            path = ("robots", name, "vehicle", axis, "node")
            if node == STEERING_ENCODER_NODE:
                yield path, f"node {node} is the steering encoder: choose another"
            elif node in BEARING_SENSOR_NODES:
                yield path, f"node {node} is reserved for bearing sensors: choose another"
        if vehicle.steering.node == vehicle.drive.node:
            path = ("robots", name, "vehicle", "drive", "node")
            yield path, f"node {vehicle.drive.node} is the steering's too: each drive needs its own"


def _endpoints(fleet: Fleet) -> Iterator[Finding]:
    paths: list[tuple[Path, str]] = [(("ground",), fleet.ground)]
    paths += [(("robots", name, "listen"), robot.listen) for name, robot in fleet.robots.items()]
    owners: dict[str, str] = {}
    for path, endpoint in paths:
        found = _ENDPOINT.fullmatch(endpoint)
        if not found or int(found[2]) > 65535:
            text = f"{endpoint!r} is no endpoint: write tcp/HOST:PORT, e.g. tcp/127.0.0.1:7447"
            yield path, text
        elif int(found[2]) != 0 and endpoint in owners:
            yield path, f"{owners[endpoint]} listens on {endpoint} too: change one of the ports"
        owners.setdefault(endpoint, str(path[1] if len(path) > 1 else "the ground station"))


def _mission_long_enough(fleet: Fleet) -> Iterator[Finding]:
    acceptance = fleet.mission.acceptance
    if fleet.mission.duration_s <= acceptance.from_s:
        yield (
            ("mission", "acceptance", "from_s"),
            f"judging starts at {acceptance.from_s:g} s, but the mission lasts "
            f"{fleet.mission.duration_s:g} s: start earlier",
        )


def _speed_within_limits(fleet: Fleet) -> Iterator[Finding]:
    fastest = max(segment.speed_mps for segment in fleet.mission.segments)
    for name, robot in fleet.robots.items():
        if robot.limits.speed_mps < fastest:
            text = f"{robot.limits.speed_mps:g} m/s is less than the mission's {fastest:g} m/s"
            yield ("robots", name, "limits", "speed_mps"), text


def _places_apart(fleet: Fleet) -> Iterator[Finding]:
    minimum = fleet.mission.acceptance.min_distance_m
    starts = {name: (r.start.x_m, r.start.y_m) for name, r in fleet.robots.items()}
    for key, places in (("start", starts), ("offset", desired_places(fleet))):
        for (one, at), (other, there) in combinations(places.items(), 2):
            distance = math.dist(at, there)
            if distance < minimum:
                late = other if key == "start" or fleet.robots[other].offset else one
                early = one if late == other else other
                yield (
                    ("robots", late, key),
                    f"only {distance:.2f} m from {early}'s place, "
                    f"acceptance.min_distance_m is {minimum:g} m",
                )


def _formations_safe(fleet: Fleet) -> Iterator[Finding]:
    """Named formations place followers only, and no two robots meet on the way between two."""
    for name, places in fleet.formations.items():
        yield from _formation_names(fleet, name, places)
    usable = [name for name in formation_names(fleet) if _known(fleet, name)]
    minimum = fleet.mission.acceptance.min_distance_m
    for before, after in combinations(usable, 2):
        ways = nearest_on_the_way(desired_places(fleet, before), desired_places(fleet, after))
        for one, other, nearest_m in ways:
            if nearest_m < minimum:
                yield (
                    ("formations", after),
                    f"on the way from or to {before}, {one} and {other} come within "
                    f"{nearest_m:.2f} m, acceptance.min_distance_m is {minimum:g} m",
                )


def _formation_names(fleet: Fleet, name: str, places: Mapping[str, Point]) -> Iterator[Finding]:
    if name == DEFAULT or not _ROBOT_NAME.fullmatch(name):
        text = f"must start with a-z, go on with a-z, 0-9, _ or -, and not be {DEFAULT!r}"
        yield ("formations", name), text
    followers = [each for each, robot in fleet.robots.items() if robot.offset is not None]
    for robot in places:
        if robot not in followers:
            text = f"no follower {robot!r}; followers are {', '.join(followers) or 'none'}"
            yield ("formations", name, robot), text


def _known(fleet: Fleet, name: str) -> bool:
    return name == DEFAULT or fleet.formations[name].keys() <= fleet.robots.keys()


def desired_places(fleet: Fleet, formation: str = DEFAULT) -> dict[str, tuple[float, float]]:
    """Every robot's desired place [m] on a straight, in the axes of the robot that leads all."""
    places: dict[str, tuple[float, float]] = {}
    for name in fleet.robots:
        chain = leader_chain(fleet, name)
        if chain[-1] in chain[:-1] or fleet.robots[chain[-1]].leader is not None:
            continue
        offsets = [place_of(fleet, link, formation) for link in chain if fleet.robots[link].offset]
        places[name] = sum(o.x_m for o in offsets), sum(o.y_m for o in offsets)
    return places


def _polar_leader_ahead(fleet: Fleet) -> Iterator[Finding]:
    """L = d + rho cos(phi) of the paper's outputs must stay clear of zero."""
    for name, robot in fleet.robots.items():
        if robot.offset is None or robot.formation.law != "polar":
            continue
        limit = (1 - MIN_AXLE_DISTANCE) * robot.vehicle.wheelbase_m
        places: list[tuple[Path, Point]] = [(("robots", name, "offset", "x_m"), robot.offset)]
        for formation, named in fleet.formations.items():
            if name in named:
                places.append((("formations", formation, name, "x_m"), named[name]))
        for path, place in places:
            if place.x_m <= limit:
                continue
            yield (
                path,
                f"{place.x_m:g} m is too far ahead for law `polar`, at most {limit:.3g} m "
                "for this wheelbase: move it back or use `law: leader_frame`",
            )


CHECKS: tuple[Callable[[Fleet], Iterator[Finding]], ...] = (
    _robot_names,
    _leaders_exist,
    _no_leader_cycle,
    _one_root,
    _identifiers_unique,
    _landmarks_given,
    _channels_differ,
    _nodes_free,
    _endpoints,
    _mission_long_enough,
    _speed_within_limits,
    _places_apart,
    _formations_safe,
    _polar_leader_ahead,
)
