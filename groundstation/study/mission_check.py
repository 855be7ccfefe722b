"""A planned mission judged before it starts, on the core alone: `echelon doctor --mission`."""

import math

import msgspec
import numpy as np

from config import fleet
from groundstation.study.formation_check import circle_findings, limit_findings, servo_findings
from groundstation.study.mission_findings import MissionFinding
from groundstation.study.planned_paths import PlannedPath, planned_paths
from groundstation.study.sight_check import (
    Told,
    landmarks_told,
    range_told,
    start_findings,
    weak_findings,
)
from onboard.estimate.observability_monitor import MOVING_MPS


class RobotFigures(msgspec.Struct, frozen=True, kw_only=True):
    """The extremes of one robot's planned path.

    `worst_std_m` is that of the weakest direction (leader), or of the range (follower), while
    moving, and None where a window says nothing; `least_seen` counts landmarks, or bearings
    between follower and leader.
    """

    length_m: float
    speed_max_mps: float
    steering_max_rad: float
    worst_std_m: float | None
    worst_at_s: float
    weak_direction: str
    weak_s: float
    least_seen: int

    @property
    def weakest(self) -> str:
        """Where the least is told, in words."""
        std = "unbounded" if self.worst_std_m is None else f"{self.worst_std_m:.3f} m"
        return (
            f"weakest at {self.worst_at_s:.1f} s: {self.weak_direction}, standard deviation {std}"
        )


class MissionReport(msgspec.Struct, frozen=True, kw_only=True):
    """What the doctor says of a mission. `method` says what the figures rest on."""

    fleet: str
    ok: bool
    method: str
    seconds: float
    findings: list[MissionFinding]
    robots: dict[str, RobotFigures]


class MissionCheck(msgspec.Struct, frozen=True):
    """The report and what a picture of it needs."""

    report: MissionReport
    paths: dict[str, PlannedPath]
    told: dict[str, Told]


def check_mission(plan: fleet.Fleet) -> MissionCheck:
    """Judge the whole mission: sight, limits, circles, steering loops; errors come first."""
    paths = planned_paths(plan)
    told: dict[str, Told] = {}
    found: list[MissionFinding] = []
    for name, path in paths.items():
        if plan.robots[name].leader is None:
            told[name] = landmarks_told(plan, name, path)
            found += start_findings(plan, path, name)
        else:
            told[name] = range_told(plan, name, paths)
        found += weak_findings(plan, path, told[name])
    found += circle_findings(plan)
    found += limit_findings(plan, paths)
    found += servo_findings(plan, paths)
    found.sort(key=lambda finding: finding.severity != "error")
    report = MissionReport(
        fleet=plan.name,
        ok=all(finding.severity != "error" for finding in found),
        method="core alone: planned paths, exact knowledge, no occlusion",
        seconds=float(next(iter(paths.values())).time_s[-1]),
        findings=found,
        robots={name: _figures(paths[name], told[name]) for name in plan.robots},
    )
    return MissionCheck(report, paths, told)


def _figures(path: PlannedPath, told: Told) -> RobotFigures:
    index = np.array(told.instants)
    moving = path.speed_mps[index] > MOVING_MPS
    share = np.where(moving, told.std_m / told.limit_m, 0.0)
    worst = int(np.argmax(share))
    std_m = float(told.std_m[worst])
    step_s = float(np.median(np.diff(path.time_s[index]))) if len(index) > 1 else 0.0
    return RobotFigures(
        length_m=float(np.sum(np.hypot(np.diff(path.x_m), np.diff(path.y_m)))),
        speed_max_mps=float(path.speed_mps.max()),
        steering_max_rad=float(np.abs(path.steering_rad).max()),
        worst_std_m=None if math.isinf(std_m) else std_m,
        worst_at_s=float(path.time_s[index[worst]]),
        weak_direction=told.direction[worst],
        weak_s=step_s * sum(told.weak),
        least_seen=min(told.seen),
    )
