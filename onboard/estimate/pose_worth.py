"""What a pose found from nothing is worth: its deviation, and whether that tells the whole story.

Bearings of a window share errors: the drift of the odometry between them, and the sensor's bias.
Counted as independent they would make a pose look better than it is. And near the circle through
three landmarks the poses that fit lie along an arc of metres, which a covariance at one of them
cannot tell: so the arc is followed, heading by heading, to where the bearings end it.
"""

from typing import NamedTuple

import numpy as np

from onboard.estimate.bearing_window import Array, Batch
from onboard.estimate.global_start import Hypothesis, inverse, linearised

WEIGHING_ROUNDS = 3
FOLLOW_ROUNDS = 3
FOLLOW_STEPS = 8
FITS = 9.0
"""A pose fits whose cost is this much above the best one's: three standard deviations."""

NARROWEST_STEP_RAD = 1e-4


class Worth(NamedTuple):
    """The pose (x, y, eta) again, its covariance (3, 3), and how far poses reach that fit [m]."""

    pose: tuple[float, float, float]
    covariance: Array
    reach_m: float


def worth(batch: Batch, hypothesis: Hypothesis) -> Worth:
    """Least squares on the inliers with what they share."""
    told = _Told(batch, hypothesis)
    pose = np.array(hypothesis.pose)
    covariance = hypothesis.covariance
    for _ in range(WEIGHING_ROUNDS):
        residuals, gradients = told.whitened(pose)
        covariance = inverse(gradients.T @ gradients)
        pose = pose - covariance @ (gradients.T @ residuals)
    x, y, fork = pose.tolist()
    step = max(float(np.sqrt(covariance[2, 2])), NARROWEST_STEP_RAD)
    reach = max(_reach(told, pose, step), _reach(told, pose, -step))
    return Worth((x, y, fork), covariance, reach)


class _Told:
    """Residuals of the inliers in units of what they share and do not share."""

    def __init__(self, batch: Batch, hypothesis: Hypothesis) -> None:
        self._batch, self._inliers = batch, hypothesis.inliers
        turned, moved = batch.turn_drifts[self._inliers], batch.drifts[self._inliers]
        _, gradients, _ = linearised(batch, np.array(hypothesis.pose)[None])
        across = gradients[0][self._inliers, :2]
        spread = np.diag(batch.variances[self._inliers]) + batch.bias_variance
        spread += np.minimum.outer(turned, turned)
        spread += np.minimum.outer(moved, moved) * (across @ across.T)
        self._whitener = np.linalg.inv(np.linalg.cholesky(spread))

    def whitened(self, pose: Array) -> tuple[Array, Array]:
        """Residuals (n,) and their gradients (n, 3) by the pose, both of unit variance."""
        residuals, gradients, _ = linearised(self._batch, pose[None])
        return (
            self._whitener @ residuals[0][self._inliers],
            self._whitener @ gradients[0][self._inliers],
        )


def _reach(told: _Told, best: Array, step_rad: float) -> float:
    """Distance from the best pose to the farthest one that fits, turning one way."""
    residuals, _ = told.whitened(best)
    limit = float(residuals @ residuals) + FITS
    pose, reach = best.copy(), 0.0
    for _ in range(FOLLOW_STEPS):
        pose[2] += step_rad
        for _ in range(FOLLOW_ROUNDS):
            residuals, gradients = told.whitened(pose)
            across = gradients[:, :2]
            pose[:2] -= inverse(across.T @ across) @ (across.T @ residuals)
        residuals, _ = told.whitened(pose)
        if float(residuals @ residuals) > limit:
            break
        reach = max(reach, float(np.hypot(*(pose[:2] - best[:2]))))
    return reach
