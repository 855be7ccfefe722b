"""A follower's unscented Kalman filter on its leader, paper (31)-(33), in plain Python scalars.

Eight sigma points of weight 1/8 at plus and minus sqrt(4) columns of the Cholesky factor (the
scaled unscented transform with alpha 1, beta 0, kappa 0: the cubature rule). With no negative
weight the covariance stays symmetric and positive definite by construction. Points of angles are
taken over wrapped differences to the central point.
"""

from collections.abc import Callable, Iterable
from math import remainder, sqrt, tau
from typing import Self

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import Innovation, RelativeBelief, RelativePrior
from onboard.estimate.cholesky4 import cholesky4
from onboard.estimate.motion_history import MotionHistory
from onboard.estimate.range_information import RangeInformation
from onboard.estimate.relative_model import (
    MIN_RANGE_M,
    Carry,
    Lever,
    Lower,
    Point,
    advance,
    full_matrix,
    leader_marker_bearings,
    own_marker_bearings,
    prior_variances,
    process_noise,
    turned,
)
from onboard.model.vehicle import WheelMotion

Measure = Callable[[Iterable[Point], Carry, Lever], list[float]]


class RelativeUkf:
    """State: range, bearing, relative heading and speed scale of the leader; see RelativeBelief.

    `rejected` counts the bearings that the gate on the NIS refused, `rejected_in_a_row` those
    since the last accepted one.
    """

    def __init__(
        self,
        settings: fleet.RelativeFilter,
        own_wheelbase_m: float,
        leader_wheelbase_m: float,
        mean: Point,
        variances: Lower,
    ) -> None:
        self.rejected = 0
        self.rejected_in_a_row = 0
        self._settings = settings
        self._history = MotionHistory(own_wheelbase_m, leader_wheelbase_m)
        self._range = RangeInformation(leader_wheelbase_m)
        self._mean = mean
        self._variances = variances

    @classmethod
    def from_prior(
        cls,
        settings: fleet.RelativeFilter,
        own_wheelbase_m: float,
        leader_wheelbase_m: float,
        prior: RelativePrior,
    ) -> Self:
        """A filter with independent errors of the prior's standard deviations and scale 0."""
        mean = (max(prior.range_m, MIN_RANGE_M), wrap(prior.bearing_rad), prior.heading_rad, 0.0)
        variances = prior_variances(settings, prior)
        return cls(settings, own_wheelbase_m, leader_wheelbase_m, mean, variances)

    @property
    def range_told(self) -> bool:
        """Whether anything makes the range observable at present."""
        return self._range.available

    def predict(self, dt_s: float, own: WheelMotion, leader: WheelMotion) -> None:
        """Advance by `dt_s`; the motions are kept to carry late bearings back to their capture."""
        noise = process_noise(self._settings, self._mean[0], dt_s)
        motion = self._history.advance(dt_s, own, leader)
        points = _sigma_points(self._mean, cholesky4(self._variances))
        (_, centre_bearing, centre_heading, _), *moved = advance(points, motion)
        deviations = [
            (r, remainder(b - centre_bearing, tau), h - centre_heading, e) for r, b, h, e in moved
        ]
        columns = zip(*deviations, strict=True)
        range_m, bearing, heading, scale = (sum(column) / 8 for column in columns)
        self._mean = (
            max(range_m, MIN_RANGE_M),
            wrap(centre_bearing + bearing),
            wrap(centre_heading + heading),
            scale,
        )
        centred = [(r - range_m, b - bearing, h - heading, e - scale) for r, b, h, e in deviations]
        self._variances = _covariance(centred, noise)
        range_std_m, heading_std_rad = sqrt(self._variances[0]), sqrt(self._variances[5])
        self._range.advance(dt_s, self._mean, range_std_m, heading_std_rad, own, leader)

    def update_leader_marker(
        self, bearing_rad: float, std_rad: float, marker: fleet.Point, age_s: float
    ) -> Innovation:
        """Use a bearing (own body frame, captured `age_s` ago) to a marker of the leader."""
        motion = self._history.back(age_s)
        lever = turned(marker, motion.leader.turn_rad)
        self._range.saw_leader_marker(marker, self._mean)
        return self._update(bearing_rad, std_rad, leader_marker_bearings, motion, lever)

    def update_mutual(
        self, bearing_rad: float, std_rad: float, own_marker: fleet.Point, age_s: float
    ) -> Innovation:
        """Use a bearing that the leader took, in its body frame, to one of the own markers."""
        motion = self._history.back(age_s)
        lever = turned(own_marker, motion.own.turn_rad)
        self._range.saw_own_marker(own_marker, self._mean)
        return self._update(bearing_rad, std_rad, own_marker_bearings, motion, lever)

    def estimate(self) -> RelativeBelief:
        """The present belief."""
        return RelativeBelief(*self._mean, full_matrix(self._variances))

    def _update(
        self,
        bearing_rad: float,
        std_rad: float,
        measure: Measure,
        motion: Carry,
        lever: Lever,
    ) -> Innovation:
        root = cholesky4(self._variances)
        centre, *bearings = measure(_sigma_points(self._mean, root), motion, lever)
        d = [remainder(bearing - centre, tau) for bearing in bearings]
        shift = sum(d) / 8
        variance = sum([(x - shift) ** 2 for x in d]) / 8 + std_rad * std_rad
        residual = remainder(bearing_rad - centre - shift, tau)
        nis = residual * residual / variance
        if not nis <= self._settings.gate_nis:
            self.rejected += 1
            self.rejected_in_a_row += 1
            return Innovation(residual, nis, False)
        self.rejected_in_a_row = 0
        self._correct(_cross_covariance(root, d), residual, variance)
        return Innovation(residual, nis, True)

    def _correct(self, cross: Point, residual: float, variance: float) -> None:
        c0, c1, c2, c3 = cross
        m0, m1, m2, m3 = self._mean
        step = residual / variance
        told = self._range.available
        self._mean = (
            max(m0 + c0 * step, MIN_RANGE_M) if told else m0,
            wrap(m1 + c1 * step),
            wrap(m2 + c2 * step),
            m3 + c3 * step,
        )
        k0, k1, k2, k3 = c0 / variance, c1 / variance, c2 / variance, c3 / variance
        p00, p10, p11, p20, p21, p22, p30, p31, p32, p33 = self._variances
        self._variances = (
            p00 - k0 * c0 if told else p00,
            p10 - k1 * c0,
            p11 - k1 * c1,
            p20 - k2 * c0,
            p21 - k2 * c1,
            p22 - k2 * c2,
            p30 - k3 * c0,
            p31 - k3 * c1,
            p32 - k3 * c2,
            p33 - k3 * c3,
        )


def _sigma_points(mean: Point, root: Lower) -> tuple[Point, ...]:
    """The mean, then plus and minus two columns of the factor around it, in pairs."""
    m0, m1, m2, m3 = mean
    l00, l10, l11, l20, l21, l22, l30, l31, l32, l33 = root
    l00, l10, l20, l30 = l00 + l00, l10 + l10, l20 + l20, l30 + l30
    l11, l21, l31 = l11 + l11, l21 + l21, l31 + l31
    l22, l32, l33 = l22 + l22, l32 + l32, l33 + l33
    return (
        mean,
        (m0 + l00, m1 + l10, m2 + l20, m3 + l30),
        (m0 - l00, m1 - l10, m2 - l20, m3 - l30),
        (m0, m1 + l11, m2 + l21, m3 + l31),
        (m0, m1 - l11, m2 - l21, m3 - l31),
        (m0, m1, m2 + l22, m3 + l32),
        (m0, m1, m2 - l22, m3 - l32),
        (m0, m1, m2, m3 + l33),
        (m0, m1, m2, m3 - l33),
    )


def _covariance(centred: list[Point], noise: Lower) -> Lower:
    """Point outer product of the deviations, plus the process noise."""
    x0, x1, x2, x3 = zip(*centred, strict=True)
    q00, q10, q11, q20, q21, q22, q30, q31, q32, q33 = noise
    return (
        _dot(x0, x0) / 8 + q00,
        _dot(x1, x0) / 8 + q10,
        _dot(x1, x1) / 8 + q11,
        _dot(x2, x0) / 8 + q20,
        _dot(x2, x1) / 8 + q21,
        _dot(x2, x2) / 8 + q22,
        _dot(x3, x0) / 8 + q30,
        _dot(x3, x1) / 8 + q31,
        _dot(x3, x2) / 8 + q32,
        _dot(x3, x3) / 8 + q33,
    )


def _dot(u: tuple[float, ...], v: tuple[float, ...]) -> float:
    u0, u1, u2, u3, u4, u5, u6, u7 = u
    v0, v1, v2, v3, v4, v5, v6, v7 = v
    return u0 * v0 + u1 * v1 + u2 * v2 + u3 * v3 + u4 * v4 + u5 * v5 + u6 * v6 + u7 * v7


def _cross_covariance(root: Lower, d: list[float]) -> Point:
    """State-measurement covariance: each pair of points differs by four columns of the factor."""
    l00, l10, l11, l20, l21, l22, l30, l31, l32, l33 = root
    g0, g1, g2, g3 = (
        (d[0] - d[1]) / 4,
        (d[2] - d[3]) / 4,
        (d[4] - d[5]) / 4,
        (d[6] - d[7]) / 4,
    )
    return (
        l00 * g0,
        l10 * g0 + l11 * g1,
        l20 * g0 + l21 * g1 + l22 * g2,
        l30 * g0 + l31 * g1 + l32 * g2 + l33 * g3,
    )
