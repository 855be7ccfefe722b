"""A follower on a long straight, on the core alone: there one bearing does not tell the range.

The onboard role itself (filter, law, range watch) drives a simulated car in closed loop on its own
estimate. Left out are buses and devices. Own bearings come one cycle late, the leader's message one
cycle late and the bearings in it two. Both odometers have a constant scale error.
"""

import random

import msgspec

from config import fleet
from config.messages import Motion, RelativeEstimate, Sighting
from groundstation.study.scenario import DT_S, Car, Inputs, paper_fleet, relative_truth
from onboard.control.steering import WheelController
from onboard.follower import Follower
from onboard.role import Observation, Odometry, Stamp

LEADER, FOLLOWER = "r1", "r2"
SPEED_MPS = 4.0
LAG_S = 0.03
START_RANGE_FRACTION = 0.05
TAIL_S = 10.0


class Leg(msgspec.Struct, frozen=True):
    """What is driven. Scale errors are of opposite signs, or of random ones, robot by robot."""

    scale_error: float
    opposite: bool = True
    markers: int = 2
    mutual: bool = True
    seconds: float = 60.0


class LegResult(msgspec.Struct, frozen=True):
    """One run. Errors are estimate minus truth; `tail_*` are means over its last 10 s of driving.

    `covered` is the share of the time in which three deviations cover the range's error.
    `reported_s` is when the robot first said that the range is uncertain, `stopped_s` when it began
    its stop and `reason` why.
    """

    tail_squared_m2: float
    tail_variance_m2: float
    covered: float
    min_range_m: float
    max_range_m: float
    nis_mean: float | None
    reported_s: float | None
    stopped_s: float | None
    reason: str


def leg_fleet(leg: Leg) -> fleet.Fleet:
    """The shipped fleet `paper` with the leg's markers and a start range known to 5 %."""
    source = paper_fleet()
    robots = dict(source.robots)
    for name in (LEADER, FOLLOWER):
        robot = robots[name]
        known = robot.relative_filter.model_copy(
            update={"start_range_fraction": START_RANGE_FRACTION}
        )
        changes = {"markers": robot.markers[: leg.markers], "relative_filter": known}
        robots[name] = robot.model_copy(update=changes)
    place = robots[FOLLOWER].offset
    assert place is not None, "a follower has a place"
    start = fleet.Pose(x_m=place.x_m, y_m=place.y_m)
    robots[LEADER] = robots[LEADER].model_copy(update={"start": fleet.Pose(x_m=0.0, y_m=0.0)})
    robots[FOLLOWER] = robots[FOLLOWER].model_copy(update={"start": start})
    return source.model_copy(update={"robots": robots})


def drive_leg(leg: Leg, seed: int) -> LegResult:
    """One run, until the leg's end or until the follower stands."""
    return _Run(leg, seed).drive()


class _Run:
    def __init__(self, leg: Leg, seed: int) -> None:
        self._noise = random.Random(seed)
        self._leg, self._source = leg, leg_fleet(leg)
        self._leader_scale, self._own_scale = self._scales(seed)
        leader, own = (self._source.robots[name] for name in (LEADER, FOLLOWER))
        self._robots = leader, own
        self._leader = Car(leader.start, leader.vehicle.wheelbase_m, LAG_S)
        self._own = Car(self._misplaced(own), own.vehicle.wheelbase_m, LAG_S)
        self._leader.speed_mps = self._own.speed_mps = SPEED_MPS
        self._role = Follower(self._source, FOLLOWER)
        self._wheels = WheelController(own.limits)
        self._wheels.reset(0.0, SPEED_MPS * self._own_scale)
        self._posted: list[Motion] = []
        self._sightings: list[Sighting] = []
        self._observations: list[Observation] = []
        self._now_s = 100.0
        self._step = 0

    def drive(self) -> LegResult:
        judge = _Judge()
        self._role.start(0.0)
        for step in range(round(self._leg.seconds / DT_S)):
            self._step = step
            self._look()
            seen = self._role.estimate_seen(Stamp(self._now_s, self._now_s))
            self._role.restrain(slow=False, hold_distance=seen.range_uncertain is not None)
            problem = seen.lost or seen.too_near or seen.nis
            estimate = self._report()
            time_s = step * DT_S
            if judge.stopped_s is None and problem is not None:
                judge.stopped_s, judge.reason = time_s, problem
            judge.look(time_s, estimate, relative_truth(self._own, self._leader).range_m)
            if judge.stopped_s is not None and self._own.speed_mps < 0.01:
                break
            self._move(stopping=judge.stopped_s is not None)
        return judge.result()

    def _scales(self, seed: int) -> tuple[float, float]:
        """What each odometer shows of one metre."""
        error = self._leg.scale_error
        sign = 1.0 if seed % 2 else -1.0
        if self._leg.opposite:
            return 1.0 + sign * error, 1.0 - sign * error
        first, second = self._noise.choice((-1.0, 1.0)), self._noise.choice((-1.0, 1.0))
        return 1.0 + first * error, 1.0 + second * error

    def _misplaced(self, own: fleet.Robot) -> fleet.Pose:
        """The true start, as far from where the fleet file has it as the filter is told."""
        place = own.start
        share = 1.0 + self._noise.gauss(0.0, START_RANGE_FRACTION)
        return fleet.Pose(x_m=place.x_m * share, y_m=place.y_m * share)

    def _look(self) -> None:
        """Estimate from what has come in: each thing one cycle after it was taken."""
        at = Stamp(self._now_s, self._now_s)
        for message in self._posted:
            self._role.hear(at, message)
        motion = self._own.motion
        odometry = Odometry(motion.speed_mps * self._own_scale, motion.steering_rad, 0.0)
        self._role.estimate(at, DT_S, odometry, self._observations)
        self._posted = [self._message()]
        self._observe()

    def _message(self) -> Motion:
        now_ns = round(self._now_s * 1e9)
        return Motion(
            seq=self._step,
            t_ns=now_ns,
            wall_ns=now_ns,
            robot=LEADER,
            state="RUNNING",
            reason="",
            mission_time_s=self._step * DT_S,
            speed_mps=SPEED_MPS * self._leader_scale,
            steering_rad=0.0,
            sightings=self._sightings,
        )

    def _observe(self) -> None:
        """Bearings of now, to be used in the next cycle."""
        std_rad = self._source.simulation.bearings.std_rad
        leader, own = self._robots
        self._observations = []
        for marker in leader.markers:
            bearing = self._own.bearing_to(self._leader.place(marker))
            seen = bearing + self._noise.gauss(0.0, std_rad)
            self._observations.append(Observation(marker.id, seen, seen, std_rad, DT_S))
        if not self._leg.mutual:
            return
        self._sightings = [
            Sighting(
                FOLLOWER,
                marker.id,
                self._leader.bearing_to(self._own.place(marker)) + self._noise.gauss(0.0, std_rad),
                std_rad,
                round(self._now_s * 1e9),
            )
            for marker in own.markers
        ]

    def _report(self) -> RelativeEstimate | None:
        reported = self._role.report(self._step, Stamp(self._now_s, self._now_s))
        if reported is None:
            return None
        message = reported[1]
        assert isinstance(message, RelativeEstimate), "a follower reports its leader"
        return message

    def _move(self, stopping: bool) -> None:
        motion = self._own.motion
        odometry = Odometry(motion.speed_mps * self._own_scale, motion.steering_rad, 0.0)
        if stopping:
            setpoint = self._wheels.stop(DT_S)
        else:
            setpoint = self._role.drive(DT_S, self._wheels, odometry)
        if self._step == 0:  # no message yet: the car rolls on
            self._wheels.reset(0.0, SPEED_MPS * self._own_scale)
            setpoint = self._wheels.last
        self._own.drive(setpoint._replace(speed_mps=setpoint.speed_mps / self._own_scale))
        self._leader.apply(Inputs(SPEED_MPS, 0.0))
        self._now_s += DT_S


class _Judge:
    """Keeps what the result needs."""

    def __init__(self) -> None:
        self.stopped_s: float | None = None
        self.reason = ""
        self._reported_s: float | None = None
        self._errors: list[tuple[float, float]] = []
        self._nis: list[float] = []
        self._ranges: list[float] = []

    def look(self, time_s: float, estimate: RelativeEstimate | None, range_m: float) -> None:
        """One step; errors count until the stop begins."""
        self._ranges.append(range_m)
        if estimate is None:
            return
        if self._reported_s is None and (
            estimate.range_state != "ok" or self.stopped_s is not None
        ):
            self._reported_s = time_s
        if self.stopped_s is None or not self._errors:
            self._errors.append((estimate.range_m - range_m, estimate.covariance[0]))
            if estimate.nis_mean is not None:
                self._nis.append(estimate.nis_mean)

    def result(self) -> LegResult:
        tail = self._errors[-round(TAIL_S / DT_S) :]
        covered = [error * error <= 9.0 * variance for error, variance in self._errors]
        return LegResult(
            tail_squared_m2=sum(error * error for error, _ in tail) / len(tail),
            tail_variance_m2=sum(variance for _, variance in tail) / len(tail),
            covered=sum(covered) / len(covered),
            min_range_m=min(self._ranges),
            max_range_m=max(self._ranges),
            nis_mean=sum(self._nis) / len(self._nis) if self._nis else None,
            reported_s=self._reported_s,
            stopped_s=self.stopped_s,
            reason=self.reason,
        )
