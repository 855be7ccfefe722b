"""Extended Kalman filter of one pose hypothesis, in square-root form.

The covariance is kept as a factor L with P = L L^T: it stays symmetric and positive semidefinite
whatever is computed, and definite in the pose's four states, to which every step adds noise.
Predictions triangularise by QR, scalar measurements use Potter's update. With the paper's noise an
unscented filter is no better (mathematics, section 10).
"""

import math
from collections.abc import Mapping
from typing import Self

import numpy as np

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import Innovation, PoseBelief
from onboard.estimate.localiser import KnownRate, LandmarkBearing, Mounting
from onboard.estimate.localiser_motion import (
    BIAS,
    FORK,
    HEADING,
    LOSS,
    NOISES,
    SPEED,
    STATES,
    TURN,
    Array,
    Input,
    Mean,
    X,
    Y,
    advance,
    noise_rows,
    predicted_bearing,
)
from onboard.estimate.rate_history import RateHistory

FORK_START_STD_RAD = 0.001
"""Of the steering angle at the start, where no encoder is used afterwards."""


class PoseFilter:
    """One Gaussian belief; see the module. `landmarks` maps ids to (x, y) [m]."""

    def __init__(
        self,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Mounting,
        landmarks: Mapping[int, tuple[float, float]],
        known_rate: KnownRate,
        mean: Mean,
        root: Array,
    ) -> None:
        """`root` (8, 8) is a factor of the covariance at `mean`."""
        self._settings = settings
        self._wheelbase_m = wheelbase_m
        self._mounting = mounting
        self._landmarks = landmarks
        self._known_rate: KnownRate = known_rate
        self._mean = mean
        self._root = root
        self._history = RateHistory()
        self._stacked: Array = np.zeros((STATES + NOISES, STATES))

    @classmethod
    def around(
        cls,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Mounting,
        landmarks: Mapping[int, tuple[float, float]],
        known_rate: KnownRate,
        pose: tuple[float, float, float],
        pose_root: Array,
        steering_rad: float,
    ) -> Self:
        """Start at (x, y, eta) with a factor (3, 3) of its covariance, the fork as it stands."""
        mean = (*pose, pose[2] - steering_rad, 0.0, 0.0, 0.0, 0.0)
        root = np.zeros((STATES, STATES))
        root[:HEADING, :HEADING] = pose_root
        root[HEADING, :HEADING] = pose_root[FORK]
        root[HEADING, HEADING] = settings.encoder_std_rad or FORK_START_STD_RAD
        root[BIAS, BIAS] = settings.bias_std_rad
        root[SPEED, SPEED] = settings.speed_scale_std
        root[TURN, TURN] = settings.turn_scale_std
        root[LOSS, LOSS] = settings.turn_loss_std
        return cls(settings, wheelbase_m, mounting, landmarks, known_rate, mean, root)

    @property
    def steering_rad(self) -> float:
        """eta - theta."""
        return wrap(self._mean[FORK] - self._mean[HEADING])

    @property
    def bias_rad(self) -> float:
        """Estimated bias of the bearings."""
        return self._mean[BIAS]

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y and eta."""
        return self._mean[X], self._mean[Y], self._mean[FORK]

    @property
    def position_std_m(self) -> float:
        """Deviation of the position along its worst axis, at most."""
        rows = self._root[:FORK]
        return math.sqrt(float(np.vdot(rows, rows)))

    @property
    def heading_std_rad(self) -> float:
        """Deviation of the body's heading."""
        row = self._root[HEADING]
        return math.sqrt(float(row @ row))

    def predict(self, given: Input) -> None:
        """Advance by one step."""
        self._mean, f, rates = advance(self._mean, given, self._wheelbase_m, self._known_rate)
        self._history.advance(given.dt_s, rates)
        np.matmul(self._root.T, f.T, out=self._stacked[:STATES])
        noise_rows(self._settings, given, rates, self._stacked[STATES:])
        upper: Array = np.asarray(np.linalg.qr(self._stacked, mode="r"))
        self._root = upper.T

    def measure_steering(self, steering_rad: float) -> None:
        """The encoder's delta = eta - theta; left out where its deviation is 0."""
        std = self._settings.encoder_std_rad
        if std > 0.0 and math.isfinite(steering_rad):
            residual = wrap(steering_rad - self.steering_rad)
            self._correct(self._root[FORK] - self._root[HEADING], residual, std)

    def update(self, seen: LandmarkBearing) -> Innovation:
        """Use a bearing to a landmark on the map, unless the gate refuses it."""
        landmark = self._landmarks[seen.landmark_id]
        predicted, gradient = predicted_bearing(
            self._mean, self._history.over(seen.age_s), seen, landmark, self._mounting
        )
        residual = math.remainder(seen.bearing_rad - predicted, math.tau)
        row: Array = gradient @ self._root
        nis = residual * residual / (float(row @ row) + seen.std_rad * seen.std_rad)
        if not nis <= self._settings.gate_nis:
            return Innovation(residual, nis, False)
        self._correct(row, residual, seen.std_rad)
        return Innovation(residual, nis, True)

    def estimate(self) -> PoseBelief:
        """The pose and its covariance."""
        rows = self._root[: HEADING + 1]
        covariance = tuple((rows @ rows.T).ravel().tolist())
        mean = self._mean
        return PoseBelief(mean[X], mean[Y], wrap(mean[FORK]), wrap(mean[HEADING]), covariance)

    def _correct(self, row: Array, residual: float, std: float) -> None:
        """Potter: `row` is h^T L of a scalar measurement with deviation `std`."""
        variance = float(row @ row) + std * std
        cross: Array = self._root @ row
        step = (cross * (residual / variance)).tolist()
        x, y, fork, heading, bias, speed, turn, loss = self._mean
        self._mean = (
            x + step[X],
            y + step[Y],
            fork + step[FORK],
            heading + step[HEADING],
            bias + step[BIAS],
            speed + step[SPEED],
            turn + step[TURN],
            loss + step[LOSS],
        )
        share = 1.0 / (variance + std * math.sqrt(variance))
        self._root = self._root - np.multiply.outer(cross * share, row)
