"""Whether robots can drive what a mission and a formation ask: limits, circles, steering loops."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from config import fleet
from groundstation.study.mission_findings import MissionFinding, Severity, stretches
from groundstation.study.planned_paths import DT_S, Floats, PlannedPath

SLACK = 1.02
"""A need within this factor of a limit counts as met."""

BRIEF_S = 0.5
"""A need of more steering rate or acceleration for less than this is only a warning."""


def limit_findings(plan: fleet.Fleet, paths: dict[str, PlannedPath]) -> Iterator[MissionFinding]:
    """Speed, steering angle, steering rate and acceleration that the ideal paths need."""
    for name, path in paths.items():
        limits = plan.robots[name].limits
        moving = path.speed_mps > 0.05 * limits.speed_mps
        rate = np.gradient(path.steering_rad, DT_S) * moving
        change = np.gradient(path.speed_mps, DT_S)
        needs = (
            ("speed", path.speed_mps, limits.speed_mps, "m/s", 0.0, "drive slower"),
            (
                "steering angle",
                path.steering_rad * moving,
                limits.steering_rad,
                "rad",
                0.0,
                "turn wider",
            ),
            ("steering rate", rate, limits.steering_rate_radps, "rad/s", BRIEF_S, "turn slower"),
            ("acceleration", change, limits.acceleration_mps2, "m/s^2", BRIEF_S, "speed up slower"),
            ("braking", -change, limits.deceleration_mps2, "m/s^2", BRIEF_S, "slow down slower"),
        )
        for what, values, limit, unit, brief_s, advice in needs:
            size = values if what in ("acceleration", "braking") else np.abs(values)
            yield from _beyond(name, path, what, size, limit, unit, brief_s, advice)
    yield from _segment_speeds(plan)


def _beyond(
    name: str,
    path: PlannedPath,
    what: str,
    size: Floats,
    limit: float,
    unit: str,
    brief_s: float,
    advice: str,
) -> Iterator[MissionFinding]:
    for stretch in stretches(size > SLACK * limit):
        from_s, to_s = float(path.time_s[stretch][0]), float(path.time_s[stretch][-1])
        severity: Severity = "error" if to_s - from_s >= brief_s else "warning"
        yield MissionFinding(
            severity=severity,
            robot=name,
            check=what.replace(" ", "_"),
            from_s=from_s,
            to_s=to_s,
            value=float(size[stretch].max()),
            limit=limit,
            unit=unit,
            text=f"{what} needed to keep the path",
            advice=f"{advice}, change the place in the formation, or raise limits of {name}",
        )


def _segment_speeds(plan: fleet.Fleet) -> Iterator[MissionFinding]:
    """What the schedule asks of its leader beyond the speed limit; the path is clipped there."""
    for name, robot in plan.robots.items():
        begin_s = 0.0
        for segment in plan.mission.segments if robot.leader is None else ():
            end_s = begin_s + segment.duration_s
            if segment.speed_mps > robot.limits.speed_mps:
                yield MissionFinding(
                    severity="error",
                    robot=name,
                    check="speed",
                    from_s=begin_s,
                    to_s=end_s,
                    value=segment.speed_mps,
                    limit=robot.limits.speed_mps,
                    unit="m/s",
                    text="speed that the schedule asks for",
                    advice="drive slower, or raise limits.speed_mps",
                )
            begin_s = end_s


class _Circle(NamedTuple):
    """A steady circle of one robot: front-wheel speed, yaw rate, steering angle."""

    speed_mps: float
    yaw_rate_radps: float
    steering_rad: float


def circle_findings(plan: fleet.Fleet) -> Iterator[MissionFinding]:
    """Steady circle of every segment and hop; a circle that does not exist ends its branch.

    A follower's rear axle must keep a radius that its steering allows. Law `polar` (leader point
    at L ahead of its rear axle) needs |w| L <= |V|, law `leader_frame` |w| d <= |V| of its place.
    """
    begin_s = 0.0
    for segment in plan.mission.segments:
        end_s = begin_s + segment.duration_s
        if segment.speed_mps > 0 and segment.fork_rate_radps != 0:
            for name, robot in plan.robots.items():
                if robot.leader is None:
                    first = _leader_circle(segment, robot)
                    if isinstance(first, _Circle):
                        yield from _hops(plan, name, first, begin_s, end_s)
                    else:
                        yield _circle_finding(name, begin_s, end_s, first)
        begin_s = end_s


def _hops(
    plan: fleet.Fleet, leader: str, circle: _Circle, begin_s: float, end_s: float
) -> Iterator[MissionFinding]:
    for name in plan.followers_of(leader):
        found = _follower_circle(plan.robots[name], plan.robots[leader], circle)
        if isinstance(found, _Circle):
            yield from _hops(plan, name, found, begin_s, end_s)
        else:
            yield _circle_finding(name, begin_s, end_s, found)


class _Infeasible(NamedTuple):
    value: float
    limit: float
    unit: str
    text: str


def _circle_finding(name: str, begin_s: float, end_s: float, why: _Infeasible) -> MissionFinding:
    return MissionFinding(
        severity="error",
        robot=name,
        check="circle",
        from_s=begin_s,
        to_s=end_s,
        value=why.value,
        limit=why.limit,
        unit=why.unit,
        text=why.text,
        advice="turn wider, or move the place outwards or nearer to the leader",
    )


def _leader_circle(segment: fleet.Segment, robot: fleet.Robot) -> _Circle | _Infeasible:
    speed, rate = segment.speed_mps, segment.fork_rate_radps
    radius = speed / abs(rate)
    wheelbase_m = robot.vehicle.wheelbase_m
    least = wheelbase_m / math.sin(robot.limits.steering_rad)
    if radius < least:
        return _Infeasible(radius, least, "m", "radius of the front wheel's circle, at least")
    return _Circle(speed, rate, math.asin(rate * wheelbase_m / speed))


def _follower_circle(
    robot: fleet.Robot, leader: fleet.Robot, circle: _Circle
) -> _Circle | _Infeasible:
    offset, wheelbase_m = robot.offset, robot.vehicle.wheelbase_m
    assert offset is not None, "a follower has a place"
    rate = abs(circle.yaw_rate_radps)
    if robot.formation.law == "polar":
        point_mps, beside_m = circle.speed_mps, math.copysign(1.0, circle.yaw_rate_radps)
        beside_m *= -offset.y_m
        lever_m = wheelbase_m - offset.x_m
    else:
        ahead = circle.speed_mps * math.cos(circle.steering_rad)
        ahead -= circle.yaw_rate_radps * offset.y_m
        left = circle.yaw_rate_radps * (leader.vehicle.wheelbase_m + offset.x_m)
        point_mps, beside_m, lever_m = math.hypot(ahead, left), 0.0, wheelbase_m
        if ahead <= 0:
            return _Infeasible(
                ahead, 0.0, "m/s", "forward speed of the place, beyond the centre of the turn"
            )
    if rate * lever_m > point_mps:
        return _Infeasible(
            rate * lever_m / point_mps, 1.0, "", "no steady circle: |w| L / |V| of this hop"
        )
    radius = math.sqrt((point_mps / rate) ** 2 - lever_m**2) + beside_m
    least = wheelbase_m / math.tan(robot.limits.steering_rad)
    if radius < least:
        return _Infeasible(radius, least, "m", "radius of the rear axle's circle, at least")
    steering = math.copysign(math.atan2(wheelbase_m, radius), circle.yaw_rate_radps)
    return _Circle(rate * math.hypot(radius, wheelbase_m), circle.yaw_rate_radps, steering)


def servo_findings(plan: fleet.Fleet, paths: dict[str, PlannedPath]) -> Iterator[MissionFinding]:
    """Gain and steering lag at each follower's highest speed: stable, damped, fit for a chain.

    The lag is the one that the `simulation` section assumes of the steering. Stable up to
    1/k + L/V (Routh), well damped up to half of 1/(k + V/L), string gain 1 up to a quarter.
    """
    lag_s = plan.simulation.steering.lag_s
    for name, robot in plan.robots.items():
        if robot.offset is None or robot.leader is None:
            continue
        path = paths[name]
        fastest = int(np.argmax(path.speed_mps))
        speed = float(path.speed_mps[fastest])
        polar = robot.formation.law == "polar"
        lever_m = robot.vehicle.wheelbase_m - (robot.offset.x_m if polar else 0.0)
        gain = robot.formation.gain_per_s
        rate = gain + speed / lever_m
        chained = bool(plan.followers_of(name)) or plan.robots[robot.leader].leader is not None
        bars: list[tuple[Severity, float, str]] = [
            ("error", 1 / gain + lever_m / speed, "unstable: steering lag"),
            ("warning", 0.5 / rate, "badly damped: steering lag"),
        ]
        if chained:
            bars.append(("warning", 0.25 / rate, "errors grow along the chain: steering lag"))
        for severity, limit, text in bars:
            if lag_s > limit:
                yield MissionFinding(
                    severity=severity,
                    robot=name,
                    check="steering_loop",
                    from_s=float(path.time_s[fastest]),
                    to_s=float(path.time_s[fastest]),
                    value=lag_s,
                    limit=limit,
                    unit="s",
                    text=f"{text} at {speed:.2g} m/s with a gain of {gain:g}/s",
                    advice="drive slower, lower formation.gain_per_s, or steer faster",
                )
                break
