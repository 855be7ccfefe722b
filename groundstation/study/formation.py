"""Leader and followers on the core alone: filters, laws and limits on a simulated plant.

Against the whole stack this leaves out buses, devices, latency and start-up. Robots have steering
lag, a constant odometry scale error of random sign, encoder noise and bearing noise as the fleet
file's `simulation` section says.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from config import fleet
from groundstation import formation_tree
from groundstation.study.scenario import DT_S, Car, Floats, relative_truth
from onboard.control.formation import desired_velocity
from onboard.control.schedule import LeaderReference, VelocityPlan
from onboard.control.steering import WheelController, WheelSetpoint
from onboard.estimate.beliefs import RelativeBelief, RelativeFilter, RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.model.relative import RelativeState
from onboard.model.vehicle import WheelMotion

PRIOR_RANGE_FRACTION, PRIOR_ANGLE_STD_RAD = 0.3, 0.3


class Seen(NamedTuple):
    """One follower at one step."""

    truth: RelativeState
    estimate: RelativeState
    offset_error_m: float
    nees: float
    nis: float
    motion: WheelMotion


@dataclass
class FormationRun:
    """What happened: front points (steps, 2) per robot, and per follower one entry per step."""

    paths: dict[str, list[tuple[float, float]]]
    seen: dict[str, list[Seen]] = field(default_factory=dict)

    def column(self, follower: str, value: Callable[[Seen], float]) -> Floats:
        """One quantity of a follower over time."""
        return np.array([value(each) for each in self.seen[follower]])


class _Robot:
    """Plant and odometry of one robot."""

    def __init__(self, settings: fleet.Robot, errors: fleet.Simulation, noise: random.Random):
        wheelbase = settings.vehicle.wheelbase_m
        self.settings, self.wheelbase_m = settings, wheelbase
        self.car = Car(settings.start, wheelbase, errors.steering.lag_s)
        self.scale = 1.0 + noise.choice((-1.0, 1.0)) * errors.odometry_scale_error
        self._encoder_std, self._noise = errors.steering_encoder_std_rad, noise
        self.report = WheelMotion(0.0, 0.0)

    def drive(self, setpoint: WheelSetpoint) -> None:
        """The drive regulates what its own odometer shows."""
        speed = setpoint.speed_mps / self.scale
        self.car.drive(WheelSetpoint(setpoint.steering_rad, speed))
        angle = self.car.motion.steering_rad + self._noise.gauss(0.0, self._encoder_std)
        self.report = WheelMotion(setpoint.speed_mps, angle)


class _Follower:
    """Filter, law and limits of one follower."""

    def __init__(
        self,
        me: _Robot,
        leader: _Robot,
        simulated: fleet.Simulation,
        on_truth: bool,
    ) -> None:
        self.me, self.leader, self._on_truth = me, leader, on_truth
        self._std = simulated.bearings.std_rad
        start = relative_truth(me.car, leader.car)
        prior = RelativePrior(
            start.range_m,
            PRIOR_RANGE_FRACTION * start.range_m,
            start.bearing_rad,
            PRIOR_ANGLE_STD_RAD,
            start.heading_rad,
            PRIOR_ANGLE_STD_RAD,
        )
        self._filter: RelativeFilter = make_relative_filter(
            me.settings.relative_filter, me.wheelbase_m, leader.wheelbase_m, prior
        )
        self._wheels = WheelController(me.settings.limits)
        assert me.settings.offset is not None, "a follower has a place"
        self._offset = me.settings.offset

    def setpoint(self) -> WheelSetpoint:
        """What law and limits make of the belief."""
        heard = self.leader.car.motion if self._on_truth else self.leader.report
        wanted = desired_velocity(
            self.me.settings.formation,
            self._offset,
            self._belief(),
            heard,
            self.leader.wheelbase_m,
            self.me.wheelbase_m,
        )
        return self._wheels.follow(DT_S, wanted, self.me.report.steering_rad)

    def observe(self, noise: random.Random) -> Seen:
        """Predict, use every bearing of this step, and compare with truth."""
        nis = []
        self._filter.predict(DT_S, self.me.report, self.leader.report)
        for marker in self.leader.settings.markers:
            bearing = self.me.car.bearing_to(self.leader.car.place(marker))
            noisy = bearing + noise.gauss(0.0, self._std)
            nis.append(self._filter.update_leader_marker(noisy, self._std, marker, 0.0).nis)
        for marker in self.me.settings.markers:
            bearing = self.leader.car.bearing_to(self.me.car.place(marker))
            noisy = bearing + noise.gauss(0.0, self._std)
            nis.append(self._filter.update_mutual(noisy, self._std, marker, 0.0).nis)
        return self._judged(sum(nis) / len(nis))

    def _judged(self, nis: float) -> Seen:
        belief, truth = self._filter.estimate(), relative_truth(self.me.car, self.leader.car)
        estimate = RelativeState(belief.range_m, belief.bearing_rad, belief.heading_rad)
        error = np.array(
            [
                estimate.range_m - truth.range_m,
                np.remainder(estimate.bearing_rad - truth.bearing_rad + np.pi, 2 * np.pi) - np.pi,
                np.remainder(estimate.heading_rad - truth.heading_rad + np.pi, 2 * np.pi) - np.pi,
            ]
        )
        covariance = np.reshape(belief.covariance, (4, 4))[:3, :3]
        place_x, place_y = self.leader.car.place(self._offset)
        here = self.me.car.state
        return Seen(
            truth,
            estimate,
            float(np.hypot(place_x - here.x_m, place_y - here.y_m)),
            float(error @ np.linalg.solve(covariance, error)),
            nis,
            self.me.car.motion,
        )

    def _belief(self) -> RelativeBelief:
        if not self._on_truth:
            return self._filter.estimate()
        return RelativeBelief(*relative_truth(self.me.car, self.leader.car), 0.0, (0.0,) * 16)


def drive_formation(
    source: fleet.Fleet,
    seed: int,
    control_on_truth: bool = False,
) -> FormationRun:
    """Drive the fleet's mission from a standing start; the leader ramps up within its limits.

    With `control_on_truth` the laws see the true relative state and the filters only listen.
    """
    noise = random.Random(seed)
    simulated = source.simulation
    robots = {name: _Robot(each, simulated, noise) for name, each in source.robots.items()}
    first = formation_tree.leader_of(source)
    limits, wheelbase = source.robots[first].limits, robots[first].wheelbase_m
    reference = LeaderReference(VelocityPlan(source.mission), limits, wheelbase)
    followers = {
        name: _Follower(robots[name], robots[leader], simulated, control_on_truth)
        for name in formation_tree.followers(source)
        if (leader := source.robots[name].leader) is not None
    }
    run = FormationRun({name: [] for name in robots}, {name: [] for name in followers})
    for _ in range(round(source.mission.duration_s / DT_S)):
        setpoints = {name: follower.setpoint() for name, follower in followers.items()}
        setpoints[first] = reference.step(DT_S)
        for name, robot in robots.items():
            robot.drive(setpoints[name])
            run.paths[name].append((robot.car.state.x_m, robot.car.state.y_m))
        for name, follower in followers.items():
            run.seen[name].append(follower.observe(noise))
    return run
