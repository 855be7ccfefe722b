"""A robot's pose estimates against the motion capture."""

import math
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from config.messages import PoseEstimate
from groundstation.lockstep import Recording

Floats = NDArray[np.float64]

# The truth between two poses of the motion capture is interpolated, unless they lie further apart.
MAX_GAP_S = 0.5
ELLIPSE_95 = 5.991
"""95 % quantile of chi square with 2 degrees of freedom."""


class PoseTrack(NamedTuple):
    """Estimates over the time since the recording's start: (n,) each, covariance (n, 3, 3).

    The direction is that of the fork, eta, which is the recorded robot's heading.
    """

    t_s: Floats
    x_m: Floats
    y_m: Floats
    direction_rad: Floats
    covariance: Floats


class TruthTrack(NamedTuple):
    """The motion capture's poses at the times of a `PoseTrack`; `usable` where there are any."""

    x_m: Floats
    y_m: Floats
    direction_rad: Floats
    usable: NDArray[np.bool_]


class Errors(NamedTuple):
    """Estimate against truth at the judged instants."""

    t_s: Floats
    position_m: Floats
    heading_rad: Floats
    position_std_m: Floats
    heading_std_rad: Floats
    nees: Floats
    inside: NDArray[np.bool_]


class RobotScore(msgspec.Struct, frozen=True, kw_only=True):
    """One robot's result, judged where it trusts its pose, from `judged_from_s` on.

    NEES is that of (x, y, heading), 3 degrees of freedom: a consistent filter's median is 2.4.
    `coverage` is the share of time in which the truth lies inside the 95 % ellipse of the
    position. `bearings_used` counts the bearings to landmarks in all `seconds`, but for those that
    the robot rejected. `trusted_from_s` is from when on the robot trusted its pose to the end, and
    `trusted_share` the share of the judged time in which it trusted one.
    """

    position_rms_m: float
    position_median_m: float
    position_max_m: float
    heading_rms_rad: float
    nees_median: float
    coverage: float
    bearings_used: int
    bearings_rejected: int
    unknown_barcodes: dict[int, int]
    seconds: float
    judged_from_s: float
    times_real_time: float
    trusted_from_s: float | None
    trusted_share: float


def pose_track(poses: list[tuple[float, PoseEstimate]]) -> PoseTrack:
    """Estimates with their times since the recording's start."""
    rows = np.array(
        [(t_s, p.x_m, p.y_m, p.fork_rad) for t_s, p in poses], dtype=np.float64
    ).reshape(-1, 4)
    covariance = np.array([p.covariance for _, p in poses], dtype=np.float64).reshape(-1, 4, 4)
    t_s, x_m, y_m, direction_rad = rows.T
    return PoseTrack(t_s, x_m, y_m, direction_rad, covariance[:, :3, :3])


def truth_at(recording: Recording, t_s: Floats) -> TruthTrack:
    """The motion capture at times since the recording's start."""
    truth = np.array(recording.truth, dtype=np.float64)
    times = truth[:, 0] - recording.start_s
    after = np.clip(np.searchsorted(times, t_s), 1, max(1, len(times) - 1))
    usable = (t_s >= times[0]) & (t_s <= times[-1])
    if len(times) > 1:
        usable &= times[after] - times[after - 1] <= MAX_GAP_S
    return TruthTrack(
        np.interp(t_s, times, truth[:, 1]),
        np.interp(t_s, times, truth[:, 2]),
        np.interp(t_s, times, np.unwrap(truth[:, 3])),
        usable,
    )


def pose_errors(track: PoseTrack, truth: TruthTrack, from_s: float) -> Errors:
    """Errors where there is truth, from `from_s` on."""
    rows = truth.usable & (track.t_s >= from_s)
    east = track.x_m[rows] - truth.x_m[rows]
    north = track.y_m[rows] - truth.y_m[rows]
    turn = _wrapped(track.direction_rad[rows] - truth.direction_rad[rows])
    covariance = track.covariance[rows]
    position = np.stack([east, north], axis=1)
    squares = _mahalanobis(np.stack([east, north, turn], axis=1), covariance)
    return Errors(
        track.t_s[rows],
        np.hypot(east, north),
        turn,
        np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1]),
        np.sqrt(covariance[:, 2, 2]),
        squares,
        _mahalanobis(position, covariance[:, :2, :2]) <= ELLIPSE_95,
    )


def score(
    recording: Recording,
    errors: Errors,
    *,
    seconds: float,
    judged_from_s: float,
    times_real_time: float,
    trusted_from_s: float | None,
    trusted_share: float,
    rejected: int,
) -> RobotScore:
    """The numbers of one robot; there must be at least one error."""
    landmarks, end_s = recording.landmark_subjects, recording.start_s + seconds
    played = sum(
        recording.start_s <= seen.t_s <= end_s and seen.subject in landmarks
        for seen in recording.bearings
    )
    return RobotScore(
        position_rms_m=_rms(errors.position_m),
        position_median_m=float(np.median(errors.position_m)),
        position_max_m=float(errors.position_m.max()),
        heading_rms_rad=_rms(errors.heading_rad),
        nees_median=float(np.median(errors.nees)),
        coverage=float(errors.inside.mean()),
        bearings_used=played - rejected,
        bearings_rejected=rejected,
        unknown_barcodes=recording.unknown_barcodes,
        seconds=seconds,
        judged_from_s=judged_from_s,
        times_real_time=times_real_time,
        trusted_from_s=trusted_from_s,
        trusted_share=trusted_share,
    )


def _mahalanobis(errors: Floats, covariance: Floats) -> Floats:
    """Squared Mahalanobis distance of each row: (n, k) and (n, k, k)."""
    solved = np.linalg.solve(covariance, errors[:, :, None])[:, :, 0]
    squares: Floats = np.einsum("ij,ij->i", errors, solved)
    return squares


def _rms(values: Floats) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def _wrapped(angles: Floats) -> Floats:
    wrapped: Floats = angles - math.tau * np.round(angles / math.tau)
    return wrapped
