"""The paper's scenario for its only number: the error of the relative heading alpha, section 4.

Core alone: leader and first follower of the fleet `paper`, noise-free plant, control on the true
state; the filter only listens. Each variant is a filter with its measurements.
"""

import math
import random
from enum import StrEnum

import msgspec

from config import fleet
from groundstation.study.scenario import DT_S, Car, paper_fleet, relative_truth
from onboard.control.formation import desired_velocity
from onboard.control.schedule import LeaderReference, VelocityPlan
from onboard.control.steering import WheelController
from onboard.estimate.beliefs import RelativeBelief, RelativeFilter, RelativePrior
from onboard.estimate.paper_filter import PaperFilter
from onboard.estimate.relative_ukf import RelativeUkf
from onboard.model.vehicle import WheelMotion

LEADER, FOLLOWER = "r1", "r2"
SETTLED_S = 1.0
OUTPUT_STD_RAD = 0.05
ODOMETRY_NOISE = 0.01
KNOWN_START_VARIANCE = 1e-4
START_STD = 0.02


class Variant(StrEnum):
    """Which filter listens, and what is wrong for it.

    PAPER starts from s(0) as known: from its P = 1.13 (PAPER_LITERAL_P) the first outputs, 0.05 rad
    off, are taken at their word, and no filter could then stay within 0.0217 rad.
    """

    PAPER = "paper"
    PAPER_LITERAL_P = "paper_literal_p"
    PAPER_FORK_RATE = "paper_fork_rate"
    DEFAULT = "default"
    DEFAULT_EXACT_ODOMETRY = "default_exact_odometry"
    DEFAULT_EXACT_BEARINGS = "default_exact_bearings"


PAPER_SETTINGS = {
    Variant.PAPER: fleet.PaperFilter(start_variance=KNOWN_START_VARIANCE),
    Variant.PAPER_LITERAL_P: fleet.PaperFilter(),
    Variant.PAPER_FORK_RATE: fleet.PaperFilter(
        start_variance=KNOWN_START_VARIANCE, yaw_rate="fork"
    ),
}


class DirectionResult(msgspec.Struct, frozen=True):
    """Largest |alpha error| [rad] from the start, and once settled; RMS; mean claimed deviation."""

    from_start_rad: float
    settled_rad: float
    settled_rms_rad: float
    claimed_std_rad: float


def drive_direction(variant: Variant, seed: int) -> DirectionResult:
    """Drive the mission once."""
    return _Run(variant, seed).drive()


class _Run:
    def __init__(self, variant: Variant, seed: int) -> None:
        self._variant, self._noise = variant, random.Random(seed)
        source = paper_fleet()
        self._settings = source.robots[LEADER], source.robots[FOLLOWER]
        leader, own = self._settings
        lag_s = source.simulation.steering.lag_s
        self._wheelbases = leader.vehicle.wheelbase_m, own.vehicle.wheelbase_m
        self._leader = Car(leader.start, self._wheelbases[0], lag_s)
        self._own = Car(own.start, self._wheelbases[1], lag_s)
        self._steps = round(source.mission.duration_s / DT_S)
        self._reference = LeaderReference(
            VelocityPlan(source.mission), leader.limits, self._wheelbases[0]
        )
        self._wheels = WheelController(leader.limits), WheelController(own.limits)
        noisy = variant in (Variant.DEFAULT, Variant.DEFAULT_EXACT_BEARINGS)
        self._odometry_noise = ODOMETRY_NOISE if noisy else 0.0
        self._filter = self._made()

    def drive(self) -> DirectionResult:
        errors, variances = [], []
        for _ in range(self._steps):
            own, leader = self._reported(self._own), self._reported(self._leader)
            self._filter.predict(DT_S, own, leader)
            self._measure()
            belief = self._filter.estimate()
            truth = relative_truth(self._own, self._leader)
            errors.append(math.remainder(belief.heading_rad - truth.heading_rad, math.tau))
            variances.append(belief.covariance[10])
            self._move()
        tail = slice(round(SETTLED_S / DT_S), None)
        count = len(errors[tail])
        return DirectionResult(
            from_start_rad=max(map(abs, errors)),
            settled_rad=max(map(abs, errors[tail])),
            settled_rms_rad=math.sqrt(sum(e * e for e in errors[tail]) / count),
            claimed_std_rad=math.sqrt(sum(variances[tail]) / count),
        )

    def _made(self) -> RelativeFilter:
        rho, phi, alpha = relative_truth(self._own, self._leader)
        prior = RelativePrior(rho, START_STD, phi, START_STD, alpha, START_STD)
        bases = self._wheelbases[1], self._wheelbases[0]
        if self._variant not in PAPER_SETTINGS:
            return RelativeUkf.from_prior(self._settings[1].relative_filter, *bases, prior)
        return PaperFilter.from_prior(PAPER_SETTINGS[self._variant], *bases, prior)

    def _reported(self, car: Car) -> WheelMotion:
        """Odometry: exact, or with white noise of 1 % on every sample of the speed."""
        motion = car.motion
        shown = 1.0 + self._noise.gauss(0.0, self._odometry_noise)
        return WheelMotion(motion.speed_mps * shown, motion.steering_rad)

    def _measure(self) -> None:
        if isinstance(self._filter, PaperFilter):
            _, phi, alpha = relative_truth(self._own, self._leader)
            gauss = self._noise.gauss
            self._filter.update_outputs(
                phi + gauss(0.0, OUTPUT_STD_RAD), alpha + gauss(0.0, OUTPUT_STD_RAD)
            )
            return
        exact = self._variant is Variant.DEFAULT_EXACT_BEARINGS
        noise = 0.0 if exact else OUTPUT_STD_RAD
        leader, own = self._settings
        for marker in leader.markers:
            bearing = self._own.bearing_to(self._leader.place(marker))
            seen = bearing + self._noise.gauss(0.0, noise)
            self._filter.update_leader_marker(seen, OUTPUT_STD_RAD, marker, 0.0)
        for marker in own.markers:
            bearing = self._leader.bearing_to(self._own.place(marker))
            seen = bearing + self._noise.gauss(0.0, noise)
            self._filter.update_mutual(seen, OUTPUT_STD_RAD, marker, 0.0)

    def _move(self) -> None:
        """Both robots one step on; the follower's law sees the truth."""
        robot = self._settings[1]
        assert robot.offset is not None, "a follower has a place"
        truth = RelativeBelief(*relative_truth(self._own, self._leader), 0.0, (0.0,) * 16)
        wanted = desired_velocity(
            robot.formation, robot.offset, truth, self._leader.motion, *self._wheelbases
        )
        own = self._wheels[1].follow(DT_S, wanted, self._own.motion.steering_rad)
        self._leader.drive(self._wheels[0].drive(DT_S, *self._reference.step(DT_S)))
        self._own.drive(own)
