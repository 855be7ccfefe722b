"""Where can a robot be that took these bearings? Poses from nothing, by odometry-linked bearings.

For a given heading every bearing is a linear constraint on the position, also after moving by
odometry: the landmark lies on a line through the robot. So headings are tried all around, the
position follows by weighted least squares with robust weights, the best headings are refined by
Gauss-Newton, and what remains are the poses that the bearings allow. Three bearings from one place
are the classical resection; on the circle through the landmarks, and in line with them, the
covariance says that the pose is not determined.
"""

from typing import NamedTuple

import numpy as np

from onboard.estimate.bearing_window import Array, Batch

HEADINGS = 72
POSITION_ROUNDS = 4
REFINED = 8
REFINE_ROUNDS = 10
CAUCHY = 9.0
"""Squared normalised residual at which a bearing's weight is halved."""

MAX_COST = 25.0
"""No bearing costs more, however wrong it is."""

INLIER_NIS = 9.0
PRIOR_SHARE = 1e-3
"""Weight of a prior at the landmarks' middle, as a share of one bearing's: keeps it solvable."""

POSSIBLE_COST = 16.0
"""A pose whose cost is this much above the best one's is out: odds of one in 3000."""

SAME_POSE_SIGMA2 = 25.0


class Hypothesis(NamedTuple):
    """A possible pose (x, y, eta) with the covariance (3, 3) that its bearings give it.

    `cost` is the sum of its squared normalised residuals, `inliers` says which entries fit.
    """

    pose: tuple[float, float, float]
    covariance: Array
    cost: float
    inliers: Array


def possible_poses(batch: Batch) -> list[Hypothesis]:
    """Poses that fit the batch about as well as the best one, which comes first."""
    poses = _refined(batch, _scanned(batch))
    found: list[Hypothesis] = []
    for hypothesis in sorted((_judged(batch, pose) for pose in poses), key=lambda h: h.cost):
        if found and hypothesis.cost > found[0].cost + POSSIBLE_COST:
            break
        if not any(_same(hypothesis, other) for other in found):
            found.append(hypothesis)
    return found


def _scanned(batch: Batch) -> Array:
    """The best of all headings with their positions, (candidates, 3)."""
    headings: Array = np.asarray(np.arange(HEADINGS) * (2 * np.pi / HEADINGS) - np.pi)
    angles = headings[:, None] + batch.directions
    c, s = np.cos(angles), np.sin(angles)
    targets = batch.landmarks - _rotated(headings, batch.places)
    offset = targets[..., 1] * c - targets[..., 0] * s
    middle = batch.landmarks.mean(axis=0)
    extent2 = float(np.mean(np.sum((batch.landmarks - middle) ** 2, axis=1))) + 1.0
    variances = _direction_variances(batch)
    weights = np.broadcast_to(1.0 / (variances * extent2 + batch.drifts), angles.shape)
    for _ in range(POSITION_ROUNDS):
        prior = PRIOR_SHARE * weights.max(axis=1) * 0.1
        a = (weights * s * s).sum(axis=1) + prior
        b = -(weights * s * c).sum(axis=1)
        d = (weights * c * c).sum(axis=1) + prior
        p = -(weights * s * offset).sum(axis=1) + prior * middle[0]
        q = (weights * c * offset).sum(axis=1) + prior * middle[1]
        det = a * d - b * b
        x, y = (d * p - b * q) / det, (a * q - b * p) / det
        east, north = targets[..., 0] - x[:, None], targets[..., 1] - y[:, None]
        square = east * east + north * north + 1e-4
        residuals = np.arctan2(c * north - s * east, c * east + s * north)
        nis = residuals**2 / (variances + batch.drifts / square)
        weights = 1.0 / ((1.0 + nis / CAUCHY) * (variances * square + batch.drifts))
    cost = np.minimum(nis, MAX_COST).sum(axis=1)
    low = (cost <= np.roll(cost, 1)) & (cost <= np.roll(cost, -1))
    best = np.flatnonzero(low)[np.argsort(cost[low])][:REFINED]
    return np.column_stack([x[best], y[best], headings[best]])


def _direction_variances(batch: Batch) -> Array:
    return batch.variances + batch.turn_drifts + batch.bias_variance


def _rotated(headings: Array, places: Array) -> Array:
    """Places (n, 2) turned by each heading, (headings, n, 2)."""
    c, s = np.cos(headings)[:, None], np.sin(headings)[:, None]
    x, y = places[:, 0], places[:, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def inverse(information: Array) -> Array:
    """Symmetric inverse, finite where nothing is told in some direction."""
    lifted = information + 1e-9 * (np.trace(information) + 1.0) * np.eye(len(information))
    inverted: Array = np.asarray(np.linalg.inv((lifted + lifted.T) / 2))
    return (inverted + inverted.T) / 2


def linearised(batch: Batch, poses: Array) -> tuple[Array, Array, Array]:
    """Residuals (poses, n), their gradients by the pose (poses, n, 3), and their variances."""
    moved = _rotated(poses[:, 2], batch.places)
    to = batch.landmarks - moved - poses[:, None, :2]
    square = np.sum(to**2, axis=2) + 1e-4
    angles = poses[:, 2:] + batch.directions
    c, s = np.cos(angles), np.sin(angles)
    east, north = to[..., 0], to[..., 1]
    residuals = np.arctan2(s * east - c * north, c * east + s * north)
    turning = 1.0 + (east * moved[..., 0] + north * moved[..., 1]) / square
    gradients = np.stack([-north / square, east / square, turning], axis=2)
    return residuals, gradients, _direction_variances(batch) + batch.drifts / square


def _refined(batch: Batch, poses: Array) -> Array:
    """Gauss-Newton on the robust cost, all candidates at once, with a little damping."""
    for _ in range(REFINE_ROUNDS):
        residuals, gradients, variances = linearised(batch, poses)
        weights = 1.0 / (variances * (1.0 + residuals**2 / variances / CAUCHY))
        weighted = gradients * weights[..., None]
        normal = np.swapaxes(gradients, 1, 2) @ weighted
        trace = np.trace(normal, axis1=1, axis2=2)
        normal += (1e-6 * trace)[:, None, None] * np.eye(3)
        right = np.einsum("kni,kn->ki", weighted, residuals)
        poses = poses - np.linalg.solve(normal, right[..., None])[..., 0]
    return poses


def _judged(batch: Batch, pose: Array) -> Hypothesis:
    """Cost and covariance of a pose, as if no entry shared anything with another."""
    residuals, gradients, variances = (each[0] for each in linearised(batch, pose[None]))
    nis = residuals**2 / variances
    inliers = nis < INLIER_NIS
    rows = gradients[inliers] / np.sqrt(variances[inliers])[:, None]
    x, y, fork = pose.tolist()
    cost = float(np.minimum(nis, MAX_COST).sum())
    return Hypothesis((x, y, fork), inverse(rows.T @ rows), cost, inliers)


def _same(one: Hypothesis, other: Hypothesis) -> bool:
    apart = np.subtract(one.pose, other.pose)
    apart[2] = np.remainder(apart[2] + np.pi, 2 * np.pi) - np.pi
    return float(apart @ np.linalg.solve(other.covariance, apart)) < SAME_POSE_SIGMA2
