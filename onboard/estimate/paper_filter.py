"""The paper's own filter on filterpy: three states, two outputs (32), Euler (33), its noise.

Per step of T_c the covariance grows by T_c^2 P_L (33); the outputs bearing phi and heading alpha
have the covariance P_N; it starts from P. The kinematics are the corrected (29) between the front
points. Imported only where a fleet file says `relative_filter.kind: paper`: filterpy brings scipy.
"""

import math
from typing import Self

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import Innovation, RelativeBelief, RelativePrior
from onboard.estimate.relative_model import MIN_RANGE_M
from onboard.model.relative import front_velocity, heading_from_mutual, rotated
from onboard.model.vehicle import WheelMotion, yaw_rate

Array = NDArray[np.float64]

_UNUSED = Innovation(0.0, 0.0, accepted=False)


class PaperFilter:
    """State: range, bearing and relative heading of the leader.

    It knows neither ages nor other markers than the front points: a front bearing waits for the
    next mutual one, and both make the outputs (phi, alpha). A belief's speed scale is 0, exactly.
    """

    rejected = 0
    rejected_in_a_row = 0

    def __init__(
        self,
        settings: fleet.PaperFilter,
        own_wheelbase_m: float,
        leader_wheelbase_m: float,
        mean: Array,
    ) -> None:
        self._settings = settings
        self._own_yaw = _YawRate(own_wheelbase_m, settings.yaw_rate)
        self._leader_yaw = _YawRate(leader_wheelbase_m, settings.yaw_rate)
        self._bearing_rad: float | None = None
        self._points = MerweScaledSigmaPoints(3, 1.0, 0.0, 0.0, subtract=_difference)
        self._ukf = UnscentedKalmanFilter(
            3,
            2,
            1.0,
            _outputs,
            None,
            self._points,
            x_mean_fn=_mean,
            z_mean_fn=_mean_outputs,
            residual_x=_difference,
            residual_z=_output_difference,
            state_add=_corrected,
        )
        self._ukf.x = mean
        self._ukf.P = settings.start_variance * np.eye(3)
        self._ukf.R = settings.output_variance * np.eye(2)

    @classmethod
    def from_prior(
        cls,
        settings: fleet.PaperFilter,
        own_wheelbase_m: float,
        leader_wheelbase_m: float,
        prior: RelativePrior,
    ) -> Self:
        """A filter that starts at the prior's mean with the paper's P."""
        mean = np.array([prior.range_m, wrap(prior.bearing_rad), wrap(prior.heading_rad)])
        return cls(settings, own_wheelbase_m, leader_wheelbase_m, mean)

    @property
    def range_told(self) -> bool:
        """The paper's filter does not ask."""
        return True

    def predict(self, dt_s: float, own: WheelMotion, leader: WheelMotion) -> None:
        """One Euler step (33) of `dt_s`."""
        leader_front, own_front = front_velocity(leader), front_velocity(own)
        own_turn, leader_turn = self._own_yaw(own, dt_s), self._leader_yaw(leader, dt_s)

        def moved(point: Array, _dt: float) -> Array:
            rho, phi, alpha = point.tolist()
            point_velocity = rotated(leader_front, alpha)
            x = point_velocity.forward_mps - own_front.forward_mps
            y = point_velocity.left_mps - own_front.left_mps
            c, s = math.cos(phi), math.sin(phi)
            turning = (y * c - x * s) / _nonzero(rho) - own_turn
            return np.array(
                [
                    rho + dt_s * (x * c + y * s),
                    phi + dt_s * turning,
                    alpha + dt_s * (leader_turn - own_turn),
                ]
            )

        self._ukf.Q = dt_s**2 * self._settings.process_variance * np.eye(3)
        self._ukf.predict(fx=moved)

    def update_leader_marker(
        self, bearing_rad: float, std_rad: float, marker: fleet.Point, age_s: float
    ) -> Innovation:
        """Keep a bearing to the leader's front point for the next mutual one."""
        if marker.x_m == 0.0 and marker.y_m == 0.0:
            self._bearing_rad = bearing_rad
        return _UNUSED

    def update_mutual(
        self, bearing_rad: float, std_rad: float, own_marker: fleet.Point, age_s: float
    ) -> Innovation:
        """With a bearing back to the own front point, alpha = phi - zeta + pi is an output too."""
        seen = self._bearing_rad
        if seen is None or own_marker.x_m != 0.0 or own_marker.y_m != 0.0:
            return _UNUSED
        self._bearing_rad = None
        return self.update_outputs(seen, heading_from_mutual(seen, bearing_rad))

    def update_outputs(self, bearing_rad: float, heading_rad: float) -> Innovation:
        """Use y = (phi, alpha) of (32). The NIS returned is halved: a mean of 1, as for others."""
        self._ukf.sigmas_f = self._points.sigma_points(self._ukf.x, self._ukf.P)
        self._ukf.update(np.array([bearing_rad, heading_rad]))
        residual = self._ukf.y
        nis = float(residual @ np.linalg.solve(self._ukf.S, residual)) / 2
        return Innovation(float(residual[0]), nis, accepted=True)

    def estimate(self) -> RelativeBelief:
        """The present belief."""
        covariance = np.zeros((4, 4))
        covariance[:3, :3] = self._ukf.P
        rho, phi, alpha = self._ukf.x.tolist()
        return RelativeBelief(rho, phi, alpha, 0.0, tuple(covariance.ravel().tolist()))


class _YawRate:
    """What a robot's motion is taken for in (29): its yaw rate, or by mistake the fork's rate."""

    def __init__(self, wheelbase_m: float, kind: str) -> None:
        self._wheelbase_m, self._kind = wheelbase_m, kind
        self._last_steering_rad: float | None = None

    def __call__(self, motion: WheelMotion, dt_s: float) -> float:
        true_radps = yaw_rate(motion, self._wheelbase_m)
        last = self._last_steering_rad
        self._last_steering_rad = motion.steering_rad
        if self._kind == "body" or last is None or dt_s <= 0.0:
            return true_radps
        return true_radps + (motion.steering_rad - last) / dt_s


def _nonzero(range_m: float) -> float:
    """Sigma points may lie at negative ranges, but none at the leader."""
    return math.copysign(max(abs(range_m), MIN_RANGE_M), range_m)


def _outputs(point: Array) -> Array:
    return point[1:]


def _wrapped(angles: Array) -> Array:
    return np.array([math.remainder(angle, math.tau) for angle in angles.tolist()])


def _difference(a: Array, b: Array) -> Array:
    d = np.subtract(a, b)
    d[1:] = _wrapped(d[1:])
    return d


def _output_difference(a: Array, b: Array) -> Array:
    return _wrapped(np.subtract(a, b))


def _mean(points: Array, weights: Array) -> Array:
    return _corrected(points[0], weights @ np.array([_difference(p, points[0]) for p in points]))


def _mean_outputs(points: Array, weights: Array) -> Array:
    steps = np.array([_output_difference(p, points[0]) for p in points])
    mean: Array = points[0] + weights @ steps
    return mean


def _corrected(state: Array, step: Array) -> Array:
    rho, phi, alpha = (state + step).tolist()
    return np.array([max(rho, MIN_RANGE_M), wrap(phi), wrap(alpha)])
