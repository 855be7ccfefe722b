"""The leader: drives the mission's schedule and localises itself from bearings to landmarks."""

from config.fleet import Fleet
from config.formations import DEFAULT
from config.messages import Message, Motion, PoseEstimate
from config.topics import POSE, Topic
from onboard.control.schedule import LeaderReference, VelocityPlan
from onboard.control.steering import WheelController, WheelSetpoint
from onboard.estimate.localiser import LandmarkBearing, Localiser
from onboard.estimate.localiser_factory import make_localiser
from onboard.estimate.observability_monitor import LandmarkMonitor
from onboard.role import Observation, Odometry, Stamp
from onboard.safety.observations import EstimateSeen, LeaderSeen

PARTICLES_TOLD = 100


class Leader:
    """Role of the robot that has no leader."""

    def __init__(self, fleet: Fleet, name: str, seed: int) -> None:
        self._name = name
        self._robot = fleet.robots[name]
        self._landmarks = {mark.id: (mark.x_m, mark.y_m) for mark in fleet.landmarks}
        self._seed = seed
        self._plan = VelocityPlan(fleet.mission)
        self._localiser: Localiser | None = None
        self._reference: LeaderReference | None = None
        self._pace = 1.0
        self.formation = DEFAULT
        self.observability = LandmarkMonitor(self._robot, self._landmarks)

    def hear(self, at: Stamp, motion: Motion) -> None:
        """A leader needs nothing from its followers."""

    def estimate(
        self, at: Stamp, dt_s: float, odometry: Odometry, observations: list[Observation]
    ) -> None:
        """Localise: the motion, the steering encoder, the bearings to known landmarks."""
        localiser = self._localiser
        if localiser is None:
            localiser = self._localiser = make_localiser(
                self._robot, self._landmarks, self._seed, odometry.steering_rad
            )
        localiser.predict(dt_s, odometry.speed_mps, odometry.steering_rate_radps)
        localiser.measure_steering(odometry.steering_rad)
        localiser.update(
            [
                LandmarkBearing(seen.marker, seen.sensor_rad, seen.std_rad, seen.age_s)
                for seen in observations
                if seen.marker in self._landmarks
            ]
        )
        self.observability.observe(dt_s, odometry, observations, localiser.estimate)

    def begin_anew(self) -> None:
        """The next encoder reading starts the localiser as the fleet file's `start` says."""
        self._localiser = None
        self.observability = LandmarkMonitor(self._robot, self._landmarks)

    def start(self, steering_rad: float) -> None:
        """Begin the schedule at its first segment."""
        self._reference = LeaderReference(
            self._plan, self._robot.limits, self._robot.vehicle.wheelbase_m, steering_rad
        )

    def finish(self) -> None:
        """Forget the schedule; the next start begins it anew."""
        self._reference = None

    def drive(self, dt_s: float, wheels: WheelController, odometry: Odometry) -> WheelSetpoint:
        """Follow the schedule, open loop."""
        assert self._reference is not None, "start() comes before drive()"
        return wheels.drive(dt_s, *self._reference.step(dt_s, self._pace))

    def ended(self) -> str | None:
        """The schedule's end."""
        if self._reference is not None and self._reference.ended:
            return "mission complete"
        return None

    def mission_time_s(self) -> float | None:
        """Time on the schedule, the ramp down after its end included."""
        return None if self._reference is None else self._reference.time_s

    def watches(self, marker: int) -> bool:
        """A leader lives on its landmarks, where its map has any."""
        return marker in self._landmarks

    @property
    def lives_on_bearings(self) -> bool:
        """Not with an empty map: that asks for driving by odometry alone."""
        return bool(self._landmarks)

    def leader_seen(self, at: Stamp) -> LeaderSeen | None:
        """A leader has no leader."""
        return None

    def estimate_seen(self, at: Stamp) -> EstimateSeen:
        """The pose is lost, or the landmarks have told too little for too long."""
        return EstimateSeen(lost=self.estimate_problem(), unobservable=self.observability.problem())

    def restrain(self, slow: bool, hold_distance: bool) -> None:
        """Nobody is ahead to fall back from: either way the schedule runs at a slower pace."""
        self._pace = self._robot.failsafe.slow_factor if slow or hold_distance else 1.0

    def estimate_problem(self) -> str | None:
        """The localiser does not trust its pose."""
        trust = None if self._localiser is None else self._localiser.trust()
        return None if trust is None or trust.trusted else trust.reason

    def not_ready(self) -> list[str]:
        """A pose that is trusted, which a known start is from the first encoder reading on."""
        if self._localiser is None:
            return ["no pose before the first encoder reading"]
        problem = self.estimate_problem()
        return [] if problem is None else [problem]

    def particles(self) -> list[tuple[float, float]]:
        """Those of a particle filter."""
        return [] if self._localiser is None else self._localiser.particles(PARTICLES_TOLD)

    def change_formation(self, name: str) -> None:
        """Those behind move; the leader only says so."""
        self.formation = name

    def report(self, seq: int, at: Stamp) -> tuple[Topic, Message] | None:
        """The pose with its covariance; valid once it is trusted."""
        belief = None if self._localiser is None else self._localiser.estimate()
        if self._localiser is None or belief is None:
            return None
        trust = self._localiser.trust()
        since_s = None
        if trust.since_s is not None:
            since_s = at.now_s - (self._localiser.time_s - trust.since_s)
        return POSE, PoseEstimate(
            seq=seq,
            t_ns=round(at.now_s * 1e9),
            wall_ns=round(at.wall_s * 1e9),
            valid=trust.trusted,
            robot=self._name,
            x_m=belief.x_m,
            y_m=belief.y_m,
            fork_rad=belief.fork_rad,
            heading_rad=belief.heading_rad,
            covariance=list(belief.covariance),
            effective_particles=belief.effective_particles,
            trusted=trust.trusted,
            trusted_since_s=since_s,
            rejected=trust.rejected,
            nis_median=trust.nis_median,
            bias_rad=trust.bias_rad,
        )
