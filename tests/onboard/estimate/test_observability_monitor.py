"""The online monitor: what it calls weak, in which words, and when it speaks up."""

import math
from collections.abc import Callable
from typing import NamedTuple

import pytest

from config.fleet import Point, Robot
from config.loader import load_fleet, shipped_fleet_path
from onboard.estimate.observability_monitor import LandmarkMonitor, RangeMonitor
from onboard.model.vehicle import VehicleState, WheelMotion, displacement

FLEET = load_fleet(shipped_fleet_path("demo")).fleet
ROBOT = FLEET.robots["r1"]
LANDMARKS = {mark.id: (mark.x_m, mark.y_m) for mark in FLEET.landmarks}
DT_S = 0.01


class _Seen(NamedTuple):
    marker: int
    std_rad: float = 0.05


class _Drive:
    """A robot that drives, and its monitor."""

    def __init__(
        self, robot: Robot = ROBOT, landmarks: dict[int, tuple[float, float]] = LANDMARKS
    ) -> None:
        self.monitor = LandmarkMonitor(robot, landmarks)
        self.pose = VehicleState(0.0, 0.0, 0.6, 0.6)

    def drive(
        self, seconds: float, seen: list[int], speed_mps: float = 1.0, steering_rad: float = 0.05
    ) -> None:
        motion = WheelMotion(speed_mps, steering_rad)
        for _ in range(round(seconds / DT_S)):
            forward, left, turn = displacement(motion, 0.25, DT_S)
            x, y, _, theta = self.pose
            c, s = math.cos(theta), math.sin(theta)
            x, y, theta = x + c * forward - s * left, y + s * forward + c * left, theta + turn
            self.pose = VehicleState(x, y, theta + steering_rad, theta)
            self.monitor.observe(DT_S, motion, [_Seen(mark) for mark in seen], lambda: self.pose)

    @property
    def words(self) -> str:
        assert self.monitor.finding is not None
        return self.monitor.finding.direction


def test_four_landmarks_are_plenty_standing_and_moving() -> None:
    robot = _Drive()
    for speed_mps in (0.0, 1.0):
        robot.drive(5.0, [101, 102, 103, 104], speed_mps)
        finding = robot.monitor.finding
        assert finding is not None
        assert not finding.weak
        assert finding.std_m is not None
        assert finding.std_m < 0.2
        assert finding.landmarks == (101, 102, 103, 104)
        assert robot.monitor.problem() is None
        assert robot.monitor.not_ready() == []


def test_standing_with_two_landmarks_is_weak_but_the_known_start_lets_the_robot_arm() -> None:
    robot = _Drive()
    robot.drive(20.0, [101, 103], speed_mps=0.0)
    assert robot.monitor.finding is not None
    assert robot.monitor.finding.weak
    assert robot.monitor.not_ready() == []
    assert robot.monitor.problem() is None
    robot.drive(4.0, [101, 103])
    assert not robot.monitor.finding.weak, "driving makes two landmarks enough"


def test_one_landmark_keeps_the_robot_from_arming_and_says_why() -> None:
    robot = _Drive()
    robot.drive(1.0, [103], speed_mps=0.0)
    (reason,) = robot.monitor.not_ready()
    assert reason == (
        "landmarks in view: 103; 2 needed (observability.min_landmarks), or driving leaves "
        "unobservable: heading about landmark 103 and the distance to it"
    )


def test_losing_all_but_one_landmark_is_a_problem_after_the_hold_time() -> None:
    robot = _Drive()
    robot.drive(6.0, [101, 102, 103, 104])
    window_s, hold_s = ROBOT.observability.window_s, ROBOT.observability.hold_s
    robot.drive(window_s + 0.5 * hold_s, [103])
    assert robot.words == "heading about landmark 103"
    assert robot.monitor.degraded
    assert robot.monitor.problem() is None
    robot.drive(0.6 * hold_s, [103])
    problem = robot.monitor.problem()
    assert problem is not None
    assert "heading about landmark 103: standard deviation unbounded" in problem
    assert robot.monitor.not_ready()[0] == problem
    robot.drive(2.0, [101, 102, 103, 104])
    assert robot.monitor.problem() is None, "good geometry ends it"


def test_standing_blind_does_not_count() -> None:
    robot = _Drive()
    robot.drive(60.0, [], speed_mps=0.0)
    assert robot.words == "position and heading: no landmark in view"
    assert robot.monitor.weak_for_s == 0.0


def test_driving_at_landmarks_in_one_line_leaves_the_place_along_it() -> None:
    c, s = math.cos(0.6), math.sin(0.6)
    robot = _Drive(landmarks={7: (20 * c, 20 * s), 8: (30 * c, 30 * s)})
    robot.drive(5.0, [7, 8], steering_rad=0.0)
    assert robot.words.startswith("position along the line to landmark")


def test_a_pose_that_is_not_known_yet_postpones_the_judgement() -> None:
    monitor = LandmarkMonitor(ROBOT, LANDMARKS)
    for _ in range(100):
        monitor.observe(DT_S, WheelMotion(0.0, 0.0), [_Seen(101)], lambda: None)
    assert monitor.finding is None
    assert monitor.not_ready() == []


class _Belief(NamedTuple):
    range_std_m: float
    range_m: float = 0.45
    bearing_rad: float = 0.785
    heading_rad: float = 0.0


def _told(belief: _Belief) -> Callable[[], _Belief]:
    return lambda: belief


def test_a_follower_tells_its_range_s_deviation_and_the_transverse_speed() -> None:
    monitor = RangeMonitor(FLEET.robots["r2"], FLEET.robots["r1"], "r1")
    slow, fast = WheelMotion(1.0, 0.0), WheelMotion(2.0, 0.0)
    for _ in range(50):
        monitor.observe(DT_S, slow, fast, _told(_Belief(0.01)))
    finding = monitor.finding
    assert finding is not None
    assert (finding.weak, finding.direction) == (False, "range to r1")
    assert finding.transverse_mps == pytest.approx(math.sin(0.785), abs=1e-9)
    for _ in range(200):
        monitor.observe(DT_S, slow, slow, _told(_Belief(0.1)))
    finding = monitor.finding
    assert finding is not None
    assert finding.weak
    assert finding.transverse_mps == pytest.approx(0.0)
    assert monitor.degraded
    assert str(finding) == "range to r1: standard deviation 0.10 m, limit 0.07 m"


def test_places_are_points_of_the_fleet_file() -> None:
    """Guards the fixture: the monitor above is judged at the shipped spacing."""
    offset = FLEET.robots["r2"].offset
    assert isinstance(offset, Point)
    assert math.hypot(offset.x_m, offset.y_m) == pytest.approx(0.45, abs=1e-3)
