"""A follower: estimates its leader from bearings and holds its place beside it."""

import math

from config.angles import wrap
from config.fleet import Fleet, Robot
from config.messages import Message, Motion, RelativeEstimate
from config.topics import RELATIVE, Topic
from onboard.control.formation import desired_velocity
from onboard.estimate.factory import RelativeEstimator, relative_estimator
from onboard.role import Observation, Odometry, Stamp, Velocity

STANDING_MPS = 0.02
SETTLED_RANGE_FRACTION = 0.1


class Follower:
    """Role of a robot with a leader."""

    def __init__(self, fleet: Fleet, name: str) -> None:
        self._name = name
        self._robot = fleet.robots[name]
        assert self._robot.leader is not None, "a follower has a leader"
        self._leader_name = self._robot.leader
        self._leader = fleet.robots[self._leader_name]
        self._leader_markers = {marker.id: marker for marker in self._leader.markers}
        self._own_markers = {marker.id: marker for marker in self._robot.markers}
        self._filter: RelativeEstimator | None = None
        self._motion: Motion | None = None
        self._used_sighting_ns = 0
        self._driving = False
        self._nis = 0.0

    def hear(self, motion: Motion, at: Stamp) -> None:
        """Keep the leader's newest message."""
        if motion.robot == self._leader_name and (
            self._motion is None or motion.t_ns > self._motion.t_ns
        ):
            self._motion = motion

    def estimate(
        self, at: Stamp, dt_s: float, odometry: Odometry, observations: list[Observation]
    ) -> None:
        """Relative filter: predict with both motions, then every bearing at its capture time."""
        motion = self._motion
        if motion is None:
            return
        if self._filter is None:
            self._filter = relative_estimator(self._robot, self._leader)
        self._filter.predict(
            dt_s,
            odometry.speed_mps,
            odometry.steering_rad,
            motion.speed_mps,
            motion.steering_rad,
        )
        for seen in observations:
            marker = self._leader_markers.get(seen.marker)
            if marker is not None:
                innovation = self._filter.update_leader_marker(
                    seen.body_rad, seen.std_rad, marker, seen.age_s
                )
                self._nis = innovation.nis
        self._use_sightings(self._filter, motion, at)

    def _use_sightings(self, estimator: RelativeEstimator, motion: Motion, at: Stamp) -> None:
        """Mutual bearings: what the leader saw of this robot, each used once."""
        clock_offset_ns = motion.wall_ns - motion.t_ns
        newest_ns = self._used_sighting_ns
        for seen in motion.sightings:
            marker = self._own_markers.get(seen.marker)
            if seen.target != self._name or marker is None or seen.t_ns <= self._used_sighting_ns:
                continue
            age_s = at.wall_s - (seen.t_ns + clock_offset_ns) * 1e-9
            estimator.update_mutual(seen.bearing_rad, seen.std_rad, marker, max(0.0, age_s))
            newest_ns = max(newest_ns, seen.t_ns)
        self._used_sighting_ns = newest_ns

    def start(self) -> None:
        """Wait for the leader to move."""
        self._driving = False

    def drive(self, dt_s: float, odometry: Odometry) -> Velocity:
        """Hold the place once the leader drives; stand before."""
        motion, estimator = self._motion, self._filter
        if motion is None or estimator is None:
            return Velocity(0.0, 0.0)
        if motion.mission_time_s is not None:
            self._driving = True
        if not self._driving:
            return Velocity(0.0, 0.0)
        return desired_velocity(
            estimator.estimate(), motion.speed_mps, motion.steering_rad, self._leader, self._robot
        )

    def ended(self) -> str | None:
        """The leader has driven and stands again, or has given up."""
        motion = self._motion
        if motion is None or not self._driving or motion.mission_time_s is not None:
            return None
        if motion.state == "STOPPING" and abs(motion.speed_mps) > STANDING_MPS:
            return None
        return f"{self._leader_name} stopped: {motion.reason}"

    def mission_time_s(self) -> float | None:
        """The leader's, so that it travels down the chain."""
        return self._motion.mission_time_s if self._motion and self._driving else None

    def not_ready(self) -> list[str]:
        """The range must be known before the robot may move."""
        if self._filter is None:
            return [f"no message from leader {self._leader_name} yet"]
        belief = self._filter.estimate()
        range_std_m = math.sqrt(belief.covariance[0][0])
        limit_m = SETTLED_RANGE_FRACTION * belief.range_m
        if range_std_m > limit_m:
            return [
                f"range to {self._leader_name} not settled: "
                f"standard deviation {range_std_m:.3f} m, limit {limit_m:.3f} m"
            ]
        return []

    def report(self, seq: int, at: Stamp) -> tuple[Topic, Message] | None:
        """Where the leader is believed to be."""
        if self._filter is None:
            return None
        belief = self._filter.estimate()
        return RELATIVE, RelativeEstimate(
            seq=seq,
            t_ns=round(at.now_s * 1e9),
            wall_ns=round(at.wall_s * 1e9),
            robot=self._name,
            leader=self._leader_name,
            range_m=belief.range_m,
            bearing_rad=belief.bearing_rad,
            heading_rad=belief.heading_rad,
            speed_scale=belief.speed_scale,
            covariance=[value for row in belief.covariance for value in row],
            nis=self._nis,
        )


def expected_start(robot: Robot, leader: Robot) -> tuple[float, float, float]:
    """Range [m], bearing and heading [rad] of the leader at the fleet file's start poses."""
    dx, dy = leader.start.x_m - robot.start.x_m, leader.start.y_m - robot.start.y_m
    return (
        math.hypot(dx, dy),
        wrap(math.atan2(dy, dx) - robot.start.heading_rad),
        wrap(leader.start.heading_rad - robot.start.heading_rad),
    )
