"""The leader: drives the mission's schedule and localises itself from bearings to landmarks."""

import math

from config.fleet import Fleet
from config.messages import Message, Motion, PoseEstimate
from config.topics import POSE, Topic
from onboard.control.schedule import LeaderReference
from onboard.estimate.localiser import LandmarkBearing, ParticleLocaliser
from onboard.role import Observation, Odometry, Stamp, Velocity


class Leader:
    """Role of the robot that has no leader."""

    def __init__(self, fleet: Fleet, name: str, seed: int) -> None:
        self._name = name
        self._fleet = fleet
        self._robot = fleet.robots[name]
        landmarks = {mark.id: (mark.x_m, mark.y_m) for mark in fleet.landmarks}
        self._landmarks = landmarks
        self._localiser = ParticleLocaliser(
            self._robot.localiser,
            wheelbase_m=self._robot.vehicle.wheelbase_m,
            mounting=self._robot.bearing_sensor.mounting,
            landmarks=landmarks,
            start=self._robot.start,
            seed=seed,
        )
        self._reference: LeaderReference | None = None

    def hear(self, motion: Motion, at: Stamp) -> None:
        """A leader needs nothing from its followers."""

    def estimate(
        self, at: Stamp, dt_s: float, odometry: Odometry, observations: list[Observation]
    ) -> None:
        """Particle filter (6)-(9) on the bearings to known landmarks."""
        self._localiser.predict(dt_s, odometry.speed_mps, odometry.steering_rate_radps)
        self._localiser.update(
            [
                LandmarkBearing(seen.marker, seen.sensor_rad, seen.std_rad, seen.age_s)
                for seen in observations
                if seen.marker in self._landmarks
            ]
        )

    def start(self) -> None:
        """Begin the schedule at its first segment."""
        self._reference = LeaderReference(
            self._fleet.mission, self._robot.limits, self._robot.vehicle.wheelbase_m
        )

    def drive(self, dt_s: float, odometry: Odometry) -> Velocity:
        """Follow the schedule: speed and reference steering angle, open loop."""
        assert self._reference is not None, "start() comes before drive()"
        speed_mps, steering_rad = self._reference.step(dt_s)
        return Velocity(speed_mps * math.cos(steering_rad), speed_mps * math.sin(steering_rad))

    def ended(self) -> str | None:
        """The schedule's end."""
        if self._reference is not None and self._reference.ended:
            return "mission complete"
        return None

    def mission_time_s(self) -> float | None:
        """Time on the schedule."""
        if self._reference is None or self._reference.ended:
            return None
        return self._reference.time_s

    def not_ready(self) -> list[str]:
        """The known start makes the pose usable at once."""
        return []

    def report(self, seq: int, at: Stamp) -> tuple[Topic, Message] | None:
        """The pose with its covariance."""
        belief = self._localiser.estimate()
        return POSE, PoseEstimate(
            seq=seq,
            t_ns=round(at.now_s * 1e9),
            wall_ns=round(at.wall_s * 1e9),
            robot=self._name,
            x_m=belief.x_m,
            y_m=belief.y_m,
            fork_rad=belief.fork_rad,
            heading_rad=belief.heading_rad,
            covariance=[float(value) for value in belief.covariance.flat],
            effective_particles=belief.effective_particles,
        )
