"""What the robots of a planned mission will see of landmarks and of each other, and what it tells.

The leader's landmarks go through the very monitor that it runs itself; a follower's bearings
through the Gramian of a window: the leader's path is a rigid body whose place and heading at the
window's end, and whose speed scale, are to be told from the bearings between the two robots.
Nothing hides anything here, and nobody errs.
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from config import fleet
from config.angles import wrap
from groundstation.study.mission_findings import MissionFinding, Severity, stretches
from groundstation.study.planned_paths import DT_S, Floats, PlannedPath
from onboard.estimate.observability_monitor import LOOKS, MOVING_MPS, Finding, LandmarkMonitor
from onboard.model.vehicle import VehicleState, WheelMotion
from onboard.model.window_gramian import UNBOUNDED_M


class Told(NamedTuple):
    """How well one robot's state is told along its path, at the instants `instants` of the path.

    `std_m` is infinite where a window says nothing; `seen` counts landmarks, or markers.
    """

    robot: str
    instants: list[int]
    std_m: Floats
    limit_m: Floats
    weak: list[bool]
    seen: list[int]
    direction: list[str]


class _Sight(NamedTuple):
    marker: int
    std_rad: float


def sees(sensor: fleet.BearingSensor, robot: VehicleState, x_m: float, y_m: float) -> bool:
    """Whether a point is in the sensor's field of view."""
    axis = robot.fork_rad if sensor.mounting == "fork" else robot.heading_rad
    direction = math.atan2(y_m - robot.y_m, x_m - robot.x_m)
    return abs(wrap(direction - axis - sensor.yaw_rad)) <= sensor.fov_half_rad


def landmarks_told(plan: fleet.Fleet, name: str, path: PlannedPath) -> Told:
    """The leader's own monitor, run over its path from a window of standing before the start."""
    robot = plan.robots[name]
    marks = {mark.id: (mark.x_m, mark.y_m) for mark in plan.landmarks}
    monitor = LandmarkMonitor(robot, marks)
    std_rad = robot.bearing_sensor.std_rad / math.sqrt(robot.bearing_sensor.rate_hz * DT_S)
    standing = WheelMotion(0.0, float(path.steering_rad[0]))
    told = Told(name, [], np.zeros(0), np.zeros(0), [], [], [])
    std: list[float] = []
    last: Finding | None = None
    for i in range(-round(robot.observability.window_s / DT_S), len(path.time_s)):
        state = path.state(max(i, 0))
        bearings = [_Sight(mark, std_rad) for mark in _in_view(plan, robot, state)]
        motion = standing if i < 0 else path.motion(i)
        monitor.observe(DT_S, motion, bearings, partial(path.state, max(i, 0)))
        if monitor.finding is not None and monitor.finding is not last and i >= 0:
            last = monitor.finding
            told.instants.append(i)
            std.append(math.inf if last.std_m is None else last.std_m)
            told.weak.append(last.weak and float(path.speed_mps[i]) > MOVING_MPS)
            told.seen.append(len(bearings))
            told.direction.append(last.direction)
    limit_m = np.full(len(std), robot.observability.weakest_std_limit_m)
    return told._replace(std_m=np.array(std), limit_m=limit_m)


def _in_view(plan: fleet.Fleet, robot: fleet.Robot, state: VehicleState) -> list[int]:
    range_m = plan.simulation.bearings.range_m
    return [
        mark.id
        for mark in plan.landmarks
        if math.hypot(mark.x_m - state.x_m, mark.y_m - state.y_m) <= range_m
        and sees(robot.bearing_sensor, state, mark.x_m, mark.y_m)
    ]


def range_told(plan: fleet.Fleet, name: str, paths: dict[str, PlannedPath]) -> Told:
    """Standard deviation of the range to the leader from each window of bearings alone."""
    robot = plan.robots[name]
    assert robot.leader is not None, "a follower has a leader"
    leader, own_path, path = plan.robots[robot.leader], paths[name], paths[robot.leader]
    step = max(1, round(robot.observability.window_s / LOOKS / DT_S))
    looks = [
        _look(robot, leader, own_path.state(i), path.state(i), step * DT_S)
        for i in range(0, len(path.time_s), step)
    ]
    told = Told(name, [], np.zeros(0), np.zeros(0), [], [], [])
    std, limits = [], []
    for end in range(len(looks)):
        i = end * step
        own, ahead = own_path.state(i), path.state(i)
        line = np.array([ahead.x_m - own.x_m, ahead.y_m - own.y_m])
        range_m = float(np.hypot(*line))
        window = [row for look in looks[max(0, end + 1 - LOOKS) : end + 1] for row in look]
        std_m = _range_std(window, ahead, line / range_m, robot.relative_filter)
        limit_m = robot.failsafe.range_deviation.limit_fraction * range_m
        told.instants.append(i)
        told.seen.append(len(looks[end]))
        told.weak.append(std_m > limit_m and float(own_path.speed_mps[i]) > MOVING_MPS)
        told.direction.append(f"range to {robot.leader}")
        std.append(std_m)
        limits.append(limit_m)
    return told._replace(std_m=np.array(std), limit_m=np.array(limits))


class _Row(NamedTuple):
    """One bearing between two robots: its gradient by the leader's place, what it hangs on.

    `gradient` is d(bearing)/d(place of the point on the leader), `point` that point, `at` the
    leader's front, `turned` -1 for a bearing that turns with the leader, else 0.
    """

    gradient: tuple[float, float]
    point: tuple[float, float]
    at: tuple[float, float]
    turned: float
    weight: float


def _look(
    robot: fleet.Robot, leader: fleet.Robot, own: VehicleState, ahead: VehicleState, span_s: float
) -> list[_Row]:
    rows, at = [], (ahead.x_m, ahead.y_m)
    for marker in leader.markers:
        point = _on(ahead, marker)
        if sees(robot.bearing_sensor, own, *point):
            gradient = _bearing_gradient(point[0] - own.x_m, point[1] - own.y_m)
            rows.append(_Row(gradient, point, at, 0.0, _weight(robot, span_s)))
    for marker in robot.markers:
        target = _on(own, marker)
        if sees(leader.bearing_sensor, ahead, *target):
            nx, ny = _bearing_gradient(target[0] - at[0], target[1] - at[1])
            rows.append(_Row((-nx, -ny), at, at, -1.0, _weight(leader, span_s)))
    return rows


def _weight(robot: fleet.Robot, span_s: float) -> float:
    return robot.bearing_sensor.rate_hz * span_s / robot.bearing_sensor.std_rad**2


def _on(state: VehicleState, marker: fleet.Point) -> tuple[float, float]:
    c, s = math.cos(state.heading_rad), math.sin(state.heading_rad)
    return (
        state.x_m + c * marker.x_m - s * marker.y_m,
        state.y_m + s * marker.x_m + c * marker.y_m,
    )


def _bearing_gradient(dx: float, dy: float) -> tuple[float, float]:
    square = dx * dx + dy * dy
    return -dy / square, dx / square


def _range_std(
    window: list[_Row], end: VehicleState, along: Floats, settings: fleet.RelativeFilter
) -> float:
    """Deviation along the line of sight; errors are (x, y, heading) at the end and the scale."""
    gramian = np.zeros((4, 4))
    gramian[3, 3] = 1.0 / settings.speed_scale_start_std**2
    for (nx, ny), (px, py), (ax, ay), turned, weight in window:
        turn = ny * (px - end.x_m) - nx * (py - end.y_m) + turned
        row = np.array([nx, ny, turn, nx * (ax - end.x_m) + ny * (ay - end.y_m)])
        gramian += weight * np.outer(row, row)
    values, vectors = np.linalg.eigh(gramian)
    shares = (along @ vectors[:2]) ** 2
    std_m = math.sqrt(float(np.sum(shares / np.maximum(values, UNBOUNDED_M**-2))))
    return std_m if std_m < UNBOUNDED_M / 2 else math.inf


def weak_findings(plan: fleet.Fleet, path: PlannedPath, told: Told) -> Iterator[MissionFinding]:
    """The stretches on which too little is told; an error where they outlast `hold_s`."""
    robot = plan.robots[told.robot]
    for stretch in stretches(told.weak):
        index = told.instants[stretch]
        from_s, to_s = float(path.time_s[index[0]]), float(path.time_s[index[-1]])
        worst = int(np.argmax(told.std_m[stretch] / told.limit_m[stretch])) + stretch.start
        value = float(told.std_m[worst])
        hold_s = robot.observability.hold_s
        severity: Severity = "error" if to_s - from_s > hold_s else "warning"
        yield MissionFinding(
            severity=severity,
            robot=told.robot,
            check="landmarks" if robot.leader is None else "range",
            from_s=from_s,
            to_s=to_s,
            value=None if math.isinf(value) else value,
            limit=float(told.limit_m[worst]),
            unit="m",
            text=f"unobservable, standard deviation: {told.direction[worst]}",
            advice=_advice(plan, told, worst),
        )


def _advice(plan: fleet.Fleet, told: Told, worst: int) -> str:
    robot = plan.robots[told.robot]
    if robot.leader is None:
        return (
            f"{told.seen[worst]} landmarks in view: add or move landmarks so that two or more are "
            "in view off the line of motion, or turn"
        )
    return (
        f"{told.seen[worst]} bearings in view: give {robot.leader} or {told.robot} a second marker "
        "that appears beside the first (off the axis when directly behind), or move the place "
        "sideways"
    )


def start_findings(plan: fleet.Fleet, path: PlannedPath, name: str) -> Iterator[MissionFinding]:
    """Landmarks in view from the start pose; with too few the leader refuses to arm."""
    robot = plan.robots[name]
    seen, needed = len(_in_view(plan, robot, path.state(0))), robot.observability.min_landmarks
    if seen < needed:
        yield MissionFinding(
            severity="error",
            robot=name,
            check="start",
            from_s=0.0,
            to_s=0.0,
            value=seen,
            limit=needed,
            unit="",
            text="landmarks in view from the start pose, at least",
            advice="add landmarks, turn the start pose, or lower observability.min_landmarks",
        )
