"""The mission as planned, on the core alone: the leader's reference and ideal followers behind it.

Nobody errs here: estimates are exact, wheels obey at once, and only the leader's acceleration is
limited. What the paths then need of speed and steering can be held against each robot's limits.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config import fleet
from config.angles import wrap
from onboard.control.formation import desired_velocity
from onboard.control.schedule import LeaderReference, VelocityPlan
from onboard.control.steering import MIN_DIRECTED_MPS
from onboard.estimate.beliefs import RelativeBelief
from onboard.model.vehicle import VehicleState, WheelMotion, displacement

Floats = NDArray[np.float64]

DT_S = 0.02
ANY_STEERING_RAD = 1.55
ANY_RATE_RADPS = 1e6


class PlannedPath(NamedTuple):
    """One robot's way: arrays over the mission's instants, from its first to its last motion."""

    time_s: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats
    steering_rad: Floats
    speed_mps: Floats

    def state(self, i: int) -> VehicleState:
        """State (3) at one instant."""
        heading = float(self.heading_rad[i])
        return VehicleState(
            float(self.x_m[i]), float(self.y_m[i]), heading + float(self.steering_rad[i]), heading
        )

    def motion(self, i: int) -> WheelMotion:
        """What the front wheel does at one instant."""
        return WheelMotion(float(self.speed_mps[i]), float(self.steering_rad[i]))


def planned_paths(plan: fleet.Fleet) -> dict[str, PlannedPath]:
    """Paths of all robots, leaders before their followers."""
    paths: dict[str, PlannedPath] = {}
    waiting = dict(plan.robots)
    while waiting:
        for name, robot in list(waiting.items()):
            if robot.leader is None:
                paths[name] = _leader_path(robot, plan.mission)
            elif robot.leader in paths:
                paths[name] = _follower_path(robot, plan.robots[robot.leader], paths[robot.leader])
            else:
                continue
            del waiting[name]
    return paths


def _leader_path(robot: fleet.Robot, mission: fleet.Mission) -> PlannedPath:
    """The schedule with its true need of steering, at the speed that the limits allow."""
    free = {"steering_rad": ANY_STEERING_RAD, "steering_rate_radps": ANY_RATE_RADPS}
    limits, wheelbase_m = robot.limits.model_copy(update=free), robot.vehicle.wheelbase_m
    reference = LeaderReference(VelocityPlan(mission), limits, wheelbase_m)
    start = robot.start
    pose = (start.x_m, start.y_m, start.heading_rad)
    motion = WheelMotion(0.0, 0.0)
    rows = [(0.0, *pose, 0.0, 0.0)]
    while not reference.ended:
        steering_rad, speed_mps = reference.step(DT_S)
        middle = WheelMotion(
            (motion.speed_mps + speed_mps) / 2, (motion.steering_rad + steering_rad) / 2
        )
        pose = _moved(pose, middle, wheelbase_m)
        motion = WheelMotion(speed_mps, steering_rad)
        rows.append((reference.time_s, *pose, steering_rad, speed_mps))
    return PlannedPath(*np.array(rows).T)


def _follower_path(robot: fleet.Robot, leader: fleet.Robot, path: PlannedPath) -> PlannedPath:
    """A follower that begins in its place and holds it by its law, with exact knowledge."""
    offset, wheelbase_m = robot.offset, robot.vehicle.wheelbase_m
    assert offset is not None, "a follower has a place"
    x, y, heading, _ = _place(path, offset)
    pose, steering_rad, rows = (x, y, heading), 0.0, []
    for i, time_s in enumerate(path.time_s.tolist()):
        belief = _exact(pose, path.state(i))
        forward, left = desired_velocity(
            robot.formation, offset, belief, path.motion(i), leader.vehicle.wheelbase_m, wheelbase_m
        )
        speed_mps = math.hypot(forward, left)
        if speed_mps < MIN_DIRECTED_MPS or path.speed_mps[i] == 0.0:
            speed_mps = 0.0
        else:
            steering_rad = math.atan2(left, forward)
        rows.append((time_s, *pose, steering_rad, speed_mps))
        pose = _moved(pose, WheelMotion(speed_mps, steering_rad), wheelbase_m)
    return PlannedPath(*np.array(rows).T)


def _place(path: PlannedPath, offset: fleet.Point) -> VehicleState:
    x, y, _, heading = path.state(0)
    c, s = math.cos(heading), math.sin(heading)
    return VehicleState(
        x + c * offset.x_m - s * offset.y_m, y + s * offset.x_m + c * offset.y_m, heading, heading
    )


def _exact(pose: tuple[float, float, float], leader: VehicleState) -> RelativeBelief:
    dx, dy = leader.x_m - pose[0], leader.y_m - pose[1]
    bearing = wrap(math.atan2(dy, dx) - pose[2])
    return RelativeBelief(
        math.hypot(dx, dy), bearing, wrap(leader.heading_rad - pose[2]), 0.0, (0.0,) * 16
    )


def _moved(
    pose: tuple[float, float, float], motion: WheelMotion, wheelbase_m: float
) -> tuple[float, float, float]:
    x, y, heading = pose
    forward, left, turn = displacement(motion, wheelbase_m, DT_S)
    c, s = math.cos(heading), math.sin(heading)
    return x + c * forward - s * left, y + s * forward + c * left, heading + turn
