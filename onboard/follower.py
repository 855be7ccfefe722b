"""A follower: estimates its leader from bearings and holds its place beside it."""

import math

from config.angles import wrap
from config.fleet import Fleet, Robot
from config.formations import DEFAULT, place_of, slide_speed_mps
from config.messages import Message, Motion, RelativeEstimate
from config.topics import RELATIVE, Topic
from onboard.control.formation import desired_velocity
from onboard.control.steering import WheelController, WheelSetpoint
from onboard.estimate.beliefs import Innovation, RelativeFilter, RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.estimate.misfit_watch import MisfitWatch
from onboard.estimate.nis_watch import NisWatch
from onboard.estimate.observability_monitor import RangeMonitor
from onboard.leader_messages import NewestFirst, implausible
from onboard.model.vehicle import WheelMotion
from onboard.role import Observation, Odometry, Stamp
from onboard.safety.observations import EstimateSeen, LeaderSeen
from onboard.safety.range_watch import RangeWatch, unobservable
from onboard.sightings import SightingBox

STANDING_MPS = 0.02
SETTLED_RANGE_FRACTION = 0.1
LOST_AFTER_REJECTIONS = 100
# The start poses of the fleet file are a rough guess of where people put the robots.
PRIOR_BEARING_STD_RAD = 0.3
PRIOR_HEADING_STD_RAD = 0.3


class Follower:
    """Role of a robot with a leader."""

    def __init__(self, fleet: Fleet, name: str) -> None:
        self._name = name
        self._robot = fleet.robots[name]
        assert self._robot.leader is not None, "a follower has a leader"
        self._leader_name, self._fleet = self._robot.leader, fleet
        self.formation = DEFAULT
        self._leader = fleet.robots[self._leader_name]
        self._leader_markers = {marker.id: marker for marker in self._leader.markers}
        self._own_markers = {marker.id: marker for marker in self._robot.markers}
        self._filter: RelativeFilter | None = None
        self._broken: str | None = None
        self._motion: Motion | None = None
        self._leader_wheel = WheelMotion(0.0, 0.0)
        self._sightings = SightingBox(name)
        self._order = NewestFirst()
        self._mutual_s: float | None = None
        self._driving = False
        self._nis = 0.0
        self.observability = RangeMonitor(self._robot, self._leader, self._leader_name)
        self._nis_watch = NisWatch()
        self._own_misfits, self._mutual_misfits = _misfit_watches(self._leader_name)
        self._range_watch = RangeWatch(
            self._robot, self._leader_name, place_of(fleet, name, DEFAULT)
        )

    def hear(self, at: Stamp, motion: Motion) -> None:
        """Keep the leader's newest message, and from every message what it saw of this robot."""
        if motion.robot != self._leader_name:
            return
        self._sightings.put(motion)
        if not self._order.is_news(motion.t_ns, at.now_s):
            return
        self._motion = motion
        if motion.valid and implausible(motion) is None:
            self._leader_wheel = WheelMotion(motion.speed_mps, motion.steering_rad)

    def estimate(
        self, at: Stamp, dt_s: float, odometry: Odometry, observations: list[Observation]
    ) -> None:
        """Relative filter: predict with both motions, then every bearing at its capture time."""
        motion = self._motion
        if motion is None:
            return
        if self._filter is None or (not self._driving and self._lost() is not None):
            self._filter, self._broken = self._new_filter(), None
            self._nis_watch = NisWatch()
            self._own_misfits, self._mutual_misfits = _misfit_watches(self._leader_name)
        try:
            self._advance(self._filter, at, dt_s, odometry, observations)
        except ArithmeticError as error:
            self._filter, self._broken = None, str(error)

    def _advance(
        self,
        estimator: RelativeFilter,
        at: Stamp,
        dt_s: float,
        odometry: Odometry,
        observations: list[Observation],
    ) -> None:
        estimator.predict(
            dt_s,
            WheelMotion(odometry.speed_mps, odometry.steering_rad),
            self._leader_wheel,
        )
        for seen in observations:
            marker = self._leader_markers.get(seen.marker)
            if marker is not None:
                innovation = estimator.update_leader_marker(
                    seen.body_rad, seen.std_rad, marker, seen.age_s
                )
                self._count(innovation, self._own_misfits)
        self._use_sightings(estimator, at)
        self.observability.observe(dt_s, odometry, self._leader_wheel, estimator.estimate)
        self._range_watch.slide(dt_s)
        if self._driving:
            belief, told = estimator.estimate(), estimator.range_told
            self._range_watch.look(dt_s, belief, told, odometry.speed_mps)

    def _count(self, innovation: Innovation, misfits: MisfitWatch) -> None:
        self._nis = innovation.nis
        self._nis_watch.add(innovation)
        misfits.add(innovation.accepted)

    def _new_filter(self) -> RelativeFilter:
        return make_relative_filter(
            self._robot.relative_filter,
            self._robot.vehicle.wheelbase_m,
            self._leader.vehicle.wheelbase_m,
            expected_start(self._robot, self._leader),
        )

    def _use_sightings(self, estimator: RelativeFilter, at: Stamp) -> None:
        """Mutual bearings: what the leader saw of this robot, each used once."""
        for seen, age_s in self._sightings.take(at.wall_s):
            marker = self._own_markers.get(seen.marker)
            if marker is not None:
                innovation = estimator.update_mutual(seen.bearing_rad, seen.std_rad, marker, age_s)
                self._count(innovation, self._mutual_misfits)
                self._mutual_s = at.now_s

    def begin_anew(self) -> None:
        """The next step starts the filter at the place that the fleet file gives."""
        self._filter = None

    def start(self, steering_rad: float) -> None:
        """Wait for the leader to move."""
        self._driving = False
        self._range_watch.reset()

    def finish(self) -> None:
        """Stop following; the filter goes on."""
        self._driving = False

    def drive(self, dt_s: float, wheels: WheelController, odometry: Odometry) -> WheelSetpoint:
        """Hold the place once the leader drives; stand before."""
        motion, estimator = self._motion, self._filter
        if motion is None or estimator is None:
            return wheels.stop(dt_s)
        if motion.mission_time_s is not None:
            self._driving = True
        if not self._driving:
            return wheels.stop(dt_s)
        wanted = desired_velocity(
            self._robot.formation,
            self._range_watch.place,
            estimator.estimate(),
            self._leader_wheel,
            self._leader.vehicle.wheelbase_m,
            self._robot.vehicle.wheelbase_m,
        )
        return wheels.follow(dt_s, wanted, odometry.steering_rad)

    def ended(self) -> str | None:
        """The leader has driven and stands again, or has given up."""
        motion = self._motion
        if motion is None or not self._driving or motion.state == "RUNNING":
            return None
        if motion.state == "STOPPING" and abs(motion.speed_mps) > STANDING_MPS:
            return None
        return f"{self._leader_name} stopped: {motion.reason}"

    def mission_time_s(self) -> float | None:
        """The leader's, so that it travels down the chain."""
        return self._motion.mission_time_s if self._motion and self._driving else None

    def watches(self, marker: int) -> bool:
        """A follower lives on what it sees of its leader."""
        return marker in self._leader_markers

    @property
    def lives_on_bearings(self) -> bool:
        """Always: it keeps its place by them."""
        return True

    def leader_seen(self, at: Stamp) -> LeaderSeen | None:
        """Age by the content, so that a backlog delivered late does not count as news."""
        motion = self._motion
        if motion is None:
            return LeaderSeen(self._leader_name, None, None)
        age_s = at.wall_s - motion.wall_ns * 1e-9
        return LeaderSeen(self._leader_name, age_s, motion.state, self._unfit(motion, age_s))

    def _unfit(self, motion: Motion, age_s: float) -> str | None:
        """Why the leader's newest message is of no use although it came in time."""
        if not motion.valid:
            return f"does not know its own motion ({motion.reason})"
        limit_s = self._robot.failsafe.leader_stale.after_s
        if age_s < -limit_s:
            return f"sends messages from {-age_s:.3g} s ahead of this clock, limit {limit_s:.2f} s"
        return implausible(motion)

    def estimate_seen(self, at: Stamp) -> EstimateSeen:
        """The leader is lost, or the range or the filter's own claims are not to be trusted."""
        watch, mutual_s = self._range_watch, self._mutual_s
        return EstimateSeen(
            lost=self._lost() or self._misfit(),
            unobservable=self.observability.problem(),
            nis=self._nis_watch.problem(),
            range_uncertain=watch.uncertain if self._driving else None,
            too_near=watch.problem if self._driving else None,
            mutual_age_s=None if mutual_s is None else at.now_s - mutual_s,
        )

    def restrain(self, slow: bool, hold_distance: bool) -> None:
        """A slower follower would lose its leader: either way it falls back."""
        self._range_watch.fall_back = slow or hold_distance

    def _lost(self) -> str | None:
        """The filter has broken down, or believes none of the leader's bearings any more."""
        if self._broken is not None:
            return f"lost {self._leader_name}: {self._broken}"
        rejected = 0 if self._filter is None else self._filter.rejected_in_a_row
        if rejected < LOST_AFTER_REJECTIONS:
            return None
        return (
            f"lost {self._leader_name}: the last {rejected} bearings do not fit the estimate, "
            f"limit {LOST_AFTER_REJECTIONS}"
        )

    def _misfit(self) -> str | None:
        """One source of bearings contradicts the rest."""
        return self._own_misfits.problem() or self._mutual_misfits.problem()

    def not_ready(self) -> list[str]:
        """The range must be known before the robot may move."""
        if self._filter is None:
            return [self._lost() or f"no message from leader {self._leader_name} yet"]
        belief = self._filter.estimate()
        limit_m = SETTLED_RANGE_FRACTION * belief.range_m
        if belief.range_std_m > limit_m:
            cause = "" if self._filter.range_told else f"; {unobservable(self._leader_name)}"
            return [
                f"range to {self._leader_name} not settled: "
                f"standard deviation {belief.range_std_m:.3f} m, limit {limit_m:.3f} m{cause}"
            ]
        problems = (
            self._range_watch.too_near(belief),
            self._nis_watch.problem(),
            self._misfit(),
        )
        return [problem for problem in problems if problem is not None]

    def particles(self) -> list[tuple[float, float]]:
        """The relative filter has none."""
        return []

    def change_formation(self, name: str) -> None:
        """Let the place slide to the one in the formation, all robots taking the same time."""
        speed_mps = slide_speed_mps(self._fleet, self._name, self.formation, name)
        self.formation = name
        self._range_watch.go_to(place_of(self._fleet, self._name, name), speed_mps)

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
            covariance=list(belief.covariance),
            nis=self._nis,
            nis_mean=self._nis_watch.mean,
            nis_low=self._nis_watch.limits.low,
            nis_high=self._nis_watch.limits.high,
            nis_state=self._nis_watch.state,
            range_told=self._filter.range_told,
            range_state=self._range_watch.state,
            range_reason=self._range_watch.reason,
            place_x_m=self._range_watch.place.x_m,
            place_y_m=self._range_watch.place.y_m,
        )


def _misfit_watches(leader: str) -> tuple[MisfitWatch, MisfitWatch]:
    """For what the robot sees of its leader, and for what that sees of the robot."""
    return MisfitWatch(f"bearings to {leader}"), MisfitWatch(f"bearings from {leader}")


def expected_start(robot: Robot, leader: Robot) -> RelativePrior:
    """Where the leader stands at the fleet file's start poses, seen from the follower."""
    dx_m, dy_m = leader.start.x_m - robot.start.x_m, leader.start.y_m - robot.start.y_m
    range_m = math.hypot(dx_m, dy_m)
    return RelativePrior(
        range_m=range_m,
        range_std_m=robot.relative_filter.start_range_fraction * range_m,
        bearing_rad=wrap(math.atan2(dy_m, dx_m) - robot.start.heading_rad),
        bearing_std_rad=PRIOR_BEARING_STD_RAD,
        heading_rad=wrap(leader.start.heading_rad - robot.start.heading_rad),
        heading_std_rad=PRIOR_HEADING_STD_RAD,
    )
