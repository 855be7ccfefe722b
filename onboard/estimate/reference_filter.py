"""The relative filter on filterpy's UnscentedKalmanFilter: slow, and an independent judge.

Imported only where a fleet file says `relative_filter.kind: reference`: filterpy brings scipy.
"""

import math
from typing import Self

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import Innovation, RelativeBelief, RelativePrior
from onboard.estimate.motion_history import MotionHistory
from onboard.estimate.range_information import RangeInformation
from onboard.estimate.relative_model import (
    MIN_RANGE_M,
    Carry,
    Lever,
    Point,
    advance,
    full_matrix,
    leader_marker_bearings,
    own_marker_bearings,
    prior_variances,
    process_noise,
    turned,
)
from onboard.estimate.relative_ukf import Measure
from onboard.model.vehicle import WheelMotion

Array = NDArray[np.float64]


class ReferenceFilter:
    """Same states, sigma points, gate and methods as RelativeUkf."""

    def __init__(
        self,
        settings: fleet.RelativeFilter,
        own_wheelbase_m: float,
        leader_wheelbase_m: float,
        mean: Array,
        covariance: Array,
    ) -> None:
        self.rejected = 0
        self.rejected_in_a_row = 0
        self._settings = settings
        self._history = MotionHistory(own_wheelbase_m, leader_wheelbase_m)
        self._range = RangeInformation(leader_wheelbase_m)
        self._points = MerweScaledSigmaPoints(4, 1.0, 0.0, 0.0, subtract=_difference)
        self._ukf = UnscentedKalmanFilter(
            4,
            1,
            1.0,
            None,
            None,
            self._points,
            x_mean_fn=_mean_state,
            z_mean_fn=_mean_bearing,
            residual_x=_difference,
            residual_z=_bearing_difference,
            state_add=_corrected,
        )
        self._ukf.x = mean
        self._ukf.P = covariance

    @classmethod
    def from_prior(
        cls,
        settings: fleet.RelativeFilter,
        own_wheelbase_m: float,
        leader_wheelbase_m: float,
        prior: RelativePrior,
    ) -> Self:
        """A filter with independent errors of the prior's standard deviations and scale 0."""
        mean = np.array(
            [max(prior.range_m, MIN_RANGE_M), wrap(prior.bearing_rad), prior.heading_rad, 0.0]
        )
        covariance = np.array(full_matrix(prior_variances(settings, prior))).reshape(4, 4)
        return cls(settings, own_wheelbase_m, leader_wheelbase_m, mean, covariance)

    @property
    def range_told(self) -> bool:
        """Whether anything makes the range observable at present."""
        return self._range.available

    def predict(self, dt_s: float, own: WheelMotion, leader: WheelMotion) -> None:
        """Advance by `dt_s`; the motions are kept to carry late bearings back to their capture."""
        motion = self._history.advance(dt_s, own, leader)

        def moved(point: Array, _dt: float) -> Array:
            return np.array(advance([_point(point)], motion)[0])

        noise = full_matrix(process_noise(self._settings, float(self._ukf.x[0]), dt_s))
        self._ukf.Q = np.array(noise).reshape(4, 4)
        self._ukf.predict(fx=moved)
        range_std_m, _, heading_std_rad = map(math.sqrt, self._ukf.P.diagonal().tolist()[:3])
        self._range.advance(dt_s, _point(self._ukf.x), range_std_m, heading_std_rad, own, leader)

    def update_leader_marker(
        self, bearing_rad: float, std_rad: float, marker: fleet.Point, age_s: float
    ) -> Innovation:
        """Use a bearing (own body frame, captured `age_s` ago) to a marker of the leader."""
        motion = self._history.back(age_s)
        self._range.saw_leader_marker(marker, _point(self._ukf.x))
        lever = turned(marker, motion.leader.turn_rad)
        return self._update(bearing_rad, std_rad, leader_marker_bearings, motion, lever)

    def update_mutual(
        self, bearing_rad: float, std_rad: float, own_marker: fleet.Point, age_s: float
    ) -> Innovation:
        """Use a bearing that the leader took, in its body frame, to one of the own markers."""
        motion = self._history.back(age_s)
        self._range.saw_own_marker(own_marker, _point(self._ukf.x))
        lever = turned(own_marker, motion.own.turn_rad)
        return self._update(bearing_rad, std_rad, own_marker_bearings, motion, lever)

    def estimate(self) -> RelativeBelief:
        """The present belief."""
        covariance = tuple(self._ukf.P.ravel().tolist())
        return RelativeBelief(*_point(self._ukf.x), covariance)

    def _update(
        self,
        bearing_rad: float,
        std_rad: float,
        measure: Measure,
        motion: Carry,
        lever: Lever,
    ) -> Innovation:
        before = self._ukf.x.copy(), self._ukf.P.copy()
        self._ukf.sigmas_f = self._points.sigma_points(*before)

        def measured(point: Array) -> Array:
            return np.array(measure([_point(point)], motion, lever))

        self._ukf.update(np.array([bearing_rad]), R=std_rad**2, hx=measured)
        residual = float(self._ukf.y[0])
        nis = residual**2 / float(self._ukf.S[0, 0])
        if not nis <= self._settings.gate_nis:
            self._ukf.x, self._ukf.P = before
            self.rejected += 1
            self.rejected_in_a_row += 1
            return Innovation(residual, nis, False)
        self.rejected_in_a_row = 0
        if not self._range.available:
            self._ukf.x[0], self._ukf.P[0, 0] = before[0][0], before[1][0, 0]
        return Innovation(residual, nis, True)


def _point(state: Array) -> Point:
    range_m, bearing, heading, scale = state.tolist()
    return range_m, bearing, heading, scale


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, math.tau)


def _difference(a: Array, b: Array) -> Array:
    d = np.subtract(a, b)
    d[1], d[2] = _wrapped(d[1]), _wrapped(d[2])
    return d


def _bearing_difference(a: Array, b: Array) -> Array:
    return np.array([_wrapped((a - b).item())])


def _mean_state(points: Array, weights: Array) -> Array:
    deviations = np.array([_difference(point, points[0]) for point in points])
    return _corrected(points[0], weights @ deviations)


def _mean_bearing(points: Array, weights: Array) -> Array:
    deviations = [_wrapped((point - points[0]).item()) for point in points]
    return np.array([points[0].item() + float(weights @ np.array(deviations))])


def _corrected(state: Array, step: Array) -> Array:
    x = state + step
    return np.array([max(x[0], MIN_RANGE_M), wrap(x[1]), wrap(x[2]), x[3]])
