"""The search for a pose that nothing is known of: gathers bearings, says when they tell one pose.

One pose is told when no other fits about as well, it is determined well enough to be linearised
at, and so many bearings agree on it that no single wrong one can have made it up.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from config import fleet
from onboard.estimate.bearing_window import Array, Batch, BearingWindow
from onboard.estimate.global_start import Hypothesis, possible_poses
from onboard.estimate.localiser import KnownRate, LandmarkBearing, Mounting
from onboard.estimate.localiser_motion import Input
from onboard.estimate.pose_worth import Worth, worth

SOLVE_PERIOD_S = 0.5
MIN_LANDMARKS = 2
MIN_ENTRIES = 4
MIN_BEARINGS = 12
MIN_INLIER_SHARE = 0.7
MAX_HEADING_STD_RAD = 0.2
SURE_POSITION_STD_M = 0.1
MAX_POSITION_STD_M = 0.5
MAX_STD_OF_RANGE = 0.1
"""Of the position: always enough, never enough, and enough as a share of the distance to the
landmarks that tell it. A Gaussian filter that starts with more is soon too sure of itself."""

MAX_REACH_SIGMAS = 4.5
"""Poses that fit reach three deviations from the best one, were their spread an ellipse."""

SAME_POSE_SIGMA2 = 16.0
STD_MARGIN = 1.2
"""On what a found pose is worth, for the shape of its spread that an ellipse does not have."""


class Found(NamedTuple):
    """The pose (x, y, eta), a factor (3, 3) of its covariance, and the steering angle there."""

    pose: tuple[float, float, float]
    root: Array
    steering_rad: float

    def agrees(self, other: tuple[float, float, float], position_std_m: float) -> bool:
        """Whether a pose from the same bearings is this one."""
        off = np.subtract(other, self.pose)
        off[2] = math.remainder(off[2], math.tau)
        spread = self.root @ self.root.T
        spread[:2, :2] += position_std_m**2 * np.eye(2)
        return float(off @ np.linalg.solve(spread, off)) < SAME_POSE_SIGMA2


class PoseSearch:
    """`hypotheses` and `reason` tell how the search stands."""

    def __init__(
        self,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Mounting,
        landmarks: Mapping[int, tuple[float, float]],
        known_rate: KnownRate,
        steering_rad: float,
    ) -> None:
        self.hypotheses = 0
        self.reason = "no pose: no bearings to known landmarks yet"
        self._landmarks = dict(landmarks)
        self._window = BearingWindow(settings, wheelbase_m, mounting, known_rate, steering_rad)
        self._fresh = False
        self._wait_s = SOLVE_PERIOD_S

    def predict(self, given: Input) -> None:
        """Carry the window on."""
        self._window.predict(given)
        self._wait_s -= given.dt_s

    def measure_steering(self, steering_rad: float) -> None:
        """The encoder's angle."""
        self._window.measure_steering(steering_rad)

    def add(self, seen: LandmarkBearing) -> None:
        """Gather a bearing to a landmark on the map."""
        self._window.add(seen)
        self._fresh = True

    def due(self) -> bool:
        """Whether there is something new to solve; twice a second at most."""
        return self._fresh and self._wait_s <= 0.0

    def solve(self) -> Found | None:
        """The pose, where the bearings tell one; `reason` says why they do not."""
        self._fresh, self._wait_s = False, SOLVE_PERIOD_S
        self.hypotheses = 0
        found = self._told()
        if isinstance(found, Found):
            return found
        self.reason = f"no pose: {found}"
        return None

    def _told(self) -> Found | str:
        """The pose, or why there is none."""
        batch = self._window.batch(self._landmarks)
        if batch is None:
            return "all bearings are too old"
        if (problem := _too_little(batch)) is not None:
            return problem
        found = possible_poses(batch)
        self.hypotheses = len(found)
        if (problem := _ambiguous(found) or _unsupported(batch, found[0])) is not None:
            return problem
        told = worth(batch, found[0])
        if (problem := _weak(batch, found[0], told)) is not None:
            return problem
        root: Array = np.asarray(np.linalg.cholesky(told.covariance) * STD_MARGIN)
        return Found(told.pose, root, self._window.steering_rad)


def _too_little(batch: Batch) -> str | None:
    landmarks = len(set(batch.landmark_ids.tolist()))
    if landmarks < MIN_LANDMARKS:
        return f"{landmarks} landmark seen, {MIN_LANDMARKS} needed, 3 for a robot that stands"
    bearings = int(batch.counts.sum())
    if len(batch.counts) < MIN_ENTRIES and bearings < MIN_BEARINGS:
        return f"{bearings} bearings, {MIN_BEARINGS} needed, or {MIN_ENTRIES} places"
    return None


def _ambiguous(found: list[Hypothesis]) -> str | None:
    if len(found) == 1:
        return None
    places = ", ".join(f"({h.pose[0]:.1f}, {h.pose[1]:.1f}) m" for h in found[:3])
    return f"the bearings allow {len(found)} poses: {places}; drive on"


def _unsupported(batch: Batch, best: Hypothesis) -> str | None:
    """Too few of the bearings fit even the only pose."""
    share = float(batch.counts[best.inliers].sum()) / float(batch.counts.sum())
    if share < MIN_INLIER_SHARE:
        return f"{share:.0%} of the bearings fit the best pose, {MIN_INLIER_SHARE:.0%} needed"
    if (seen := len(set(batch.landmark_ids[best.inliers].tolist()))) < MIN_LANDMARKS:
        return f"bearings to {seen} landmark fit the best pose, {MIN_LANDMARKS} needed"
    return None


def _weak(batch: Batch, best: Hypothesis, told: Worth) -> str | None:
    """The only pose is not told well enough."""
    position_std = math.sqrt(float(told.covariance[0, 0] + told.covariance[1, 1]))
    heading_std = math.sqrt(float(told.covariance[2, 2]))
    to = batch.landmarks[best.inliers] - told.pose[:2]
    share_m = MAX_STD_OF_RANGE * float(np.median(np.hypot(*to.T)))
    limit = min(MAX_POSITION_STD_M, max(SURE_POSITION_STD_M, share_m))
    geometry = "landmarks in line or on a circle with the robot, or too few; drive on"
    if position_std > limit:
        return f"standard deviation {position_std:.2f} m, limit {limit:.2f} m: {geometry}"
    if heading_std > MAX_HEADING_STD_RAD:
        return f"heading deviation {heading_std:.2f} rad, limit {MAX_HEADING_STD_RAD} rad"
    if told.reach_m > MAX_REACH_SIGMAS * position_std:
        return f"bearings fit poses up to {told.reach_m:.1f} m from the best one: {geometry}"
    return None
