"""The paper's particle filter of a robot that sees landmarks, (6)-(9).

State of each particle: (x, y, eta, theta) of (3). The proposal is the motion model, so the weights
(7) are multiplied by the likelihood of the bearings alone; they are kept as logarithms. Systematic
resampling, which satisfies (9), when the effective number of particles falls below half.

The steering encoder is not used: at 500 particles it makes the filter worse (impoverishment).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import PoseBelief
from onboard.estimate.localiser import (
    STANDING_MPS,
    STANDING_NOISE,
    KnownRate,
    LandmarkBearing,
    Mounting,
    Trust,
    UpdateOutcome,
    UpdateResult,
)

Array = NDArray[np.float64]

X, Y, FORK, HEADING = range(4)

DIVERGED_SIGMA = 5.0
"""If the likeliest particle is further than this from every bearing, the bearings are not used."""

LOST_LOOKS = 50
"""The pose is lost after so many looks in a row that fit no particle."""


class ParticleLocaliser:
    """See the module; no clock and no global random numbers: the same seed gives the same run."""

    def __init__(
        self,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Mounting,
        landmarks: dict[int, tuple[float, float]],
        start: fleet.Pose,
        seed: int,
        start_steering_rad: float = 0.0,
        known_rate: KnownRate = "steering",
    ) -> None:
        """Spread the particles around `start` by `start_std_*`; the fork as its encoder says.

        `landmarks` maps ids to (x, y) [m].
        """
        self.time_s = 0.0
        self._lost_looks = 0
        self._known_rate = known_rate
        self._settings = settings
        self._wheelbase_m = wheelbase_m
        self._seen_from = FORK if mounting == "fork" else HEADING
        self._landmarks = dict(landmarks)
        self._rng = np.random.Generator(np.random.SFC64(seed))
        n = settings.particles
        self._states: Array = self._rng.standard_normal((4, n))
        spread = (settings.start_std_m, settings.start_std_m, 0.0, settings.start_std_rad)
        centre = (start.x_m, start.y_m, 0.0, start.heading_rad)
        self._states *= np.reshape(spread, (4, 1))
        self._states += np.reshape(centre, (4, 1))
        self._states[FORK] = self._states[HEADING] + start_steering_rad
        self._rates: Array = np.zeros((4, n))
        self._noise: Array = np.empty((4, n))
        self._log_weights: Array = np.zeros(n)
        self._weights: Array = np.full(n, 1.0 / n)

    def predict(self, dt_s: float, speed_mps: float, rate_radps: float) -> None:
        """Advance by `dt_s` with (3) and add the process noise.

        A robot knows d delta/dt, the difference of two encoder readings over the time between
        them, which makes eta' = d delta/dt + theta'; the paper's input is eta' itself.
        """
        self.time_s += dt_s
        s, rates = self._states, self._rates
        steering = s[FORK] - s[HEADING]
        if self._known_rate == "fork":
            steering += (rate_radps - speed_mps / self._wheelbase_m * np.sin(steering)) * dt_s / 2
        else:
            steering += rate_radps * dt_s / 2
        np.sin(steering, out=rates[HEADING])
        rates[HEADING] *= speed_mps / self._wheelbase_m
        if self._known_rate == "fork":
            rates[FORK] = rate_radps
        else:
            np.add(rates[HEADING], rate_radps, out=rates[FORK])
        middle = rates[FORK] * (dt_s / 2)
        middle += s[FORK]
        np.cos(middle, out=rates[X])
        np.sin(middle, out=rates[Y])
        rates[:2] *= speed_mps
        np.multiply(rates, dt_s, out=self._noise)
        s += self._noise
        self._add_noise(dt_s, abs(speed_mps) < STANDING_MPS)

    def measure_steering(self, steering_rad: float) -> None:
        """Not used, see the module."""

    def update(self, bearings: Sequence[LandmarkBearing]) -> UpdateResult:
        """Multiply the weights by the likelihood of the bearings (5), and resample if needed.

        A late bearing is compared with where each particle was, along its last motion.
        """
        known = [b for b in bearings if b.landmark_id in self._landmarks]
        unknown = tuple(b.landmark_id for b in bearings if b.landmark_id not in self._landmarks)
        if not known:
            return UpdateResult(UpdateOutcome.NO_BEARINGS, unknown, self._effective())
        residuals = self._residuals(known)
        precisions = np.array([-0.5 / (b.std_rad * b.std_rad) for b in known])
        log_likelihood = precisions @ np.square(residuals)
        nearest = residuals[:, np.argmax(log_likelihood)].tolist()
        limits = [DIVERGED_SIGMA * b.std_rad for b in known]
        if not any(abs(r) <= limit for r, limit in zip(nearest, limits, strict=True)):
            self._lost_looks += 1
            return UpdateResult(UpdateOutcome.DIVERGED, unknown, self._effective())
        self._lost_looks = 0
        self._log_weights += log_likelihood
        self._normalise()
        effective = self._effective()
        if effective < self._settings.particles / 2:
            self._resample()
            return UpdateResult(UpdateOutcome.RESAMPLED, unknown, effective)
        return UpdateResult(UpdateOutcome.UPDATED, unknown, effective)

    def estimate(self) -> PoseBelief:
        """Weighted mean and covariance of the particles.

        Angles are averaged over wrapped differences to one particle: right wherever the mean
        lies, as long as the particles' directions spread over less than half a turn.
        """
        reference = self._states[:, :1].copy()
        deviations = self._states - reference
        _wrap_in_place(deviations[FORK:])
        shift = deviations @ self._weights
        deviations -= shift[:, None]
        covariance = (deviations * self._weights) @ deviations.T
        x, y, fork, heading = (reference[:, 0] + shift).tolist()
        return PoseBelief(
            x, y, wrap(fork), wrap(heading), tuple(covariance.ravel().tolist()), self._effective()
        )

    def trust(self) -> Trust:
        """A known start is trusted until look after look fits no particle."""
        lost = self._lost_looks >= LOST_LOOKS
        reason = (
            f"pose lost: the last {self._lost_looks} looks fit no particle, limit {LOST_LOOKS}; "
            "check the landmarks' places and ids, carry it to its start and give `echelon at-start`"
        )
        return Trust(
            trusted=not lost,
            reason=reason if lost else "",
            since_s=None if lost else 0.0,
            lost=lost,
            hypotheses=1,
            rejected=0,
            nis_median=None,
            bias_rad=0.0,
        )

    def particles(self, count: int) -> list[tuple[float, float]]:
        """Places [m] of `count` particles drawn by their weights, systematically."""
        marks = (np.arange(count) + 0.5) / count
        chosen = np.searchsorted(np.cumsum(self._weights), marks)
        chosen = np.minimum(chosen, self._weights.size - 1)
        return [(float(x), float(y)) for x, y in self._states[: Y + 1, chosen].T]

    def _add_noise(self, dt_s: float, standing: bool) -> None:
        factor = math.sqrt(dt_s) * (STANDING_NOISE if standing else 1.0)
        position = self._settings.position_noise_m * factor
        heading = self._settings.heading_noise_rad * factor
        noise = self._rng.standard_normal(out=self._noise)
        noise *= np.array([[position], [position], [heading], [heading]])
        self._states += noise

    def _residuals(self, known: list[LandmarkBearing]) -> Array:
        """Measured minus predicted bearing, wrapped, (bearings, particles)."""
        columns = np.array([(*self._landmarks[b[0]], b.bearing_rad, b.age_s) for b in known])
        x, y, bearing, age = columns.T[:, :, None]
        s, rates, axis = self._states, self._rates, self._seen_from
        east = age * rates[X]
        east += x
        east -= s[X]
        north = age * rates[Y]
        north += y
        north -= s[Y]
        residuals: Array = np.arctan2(north, east, out=north)
        np.subtract(bearing, residuals, out=residuals)
        residuals += s[axis]
        residuals -= np.multiply(age, rates[axis], out=east)
        _wrap_in_place(residuals)
        return residuals

    def _normalise(self) -> None:
        """Weights from their logarithms; the largest is taken out first, so none underflows all."""
        self._log_weights -= self._log_weights.max()
        np.exp(self._log_weights, out=self._weights)
        self._weights /= self._weights.sum()

    def _effective(self) -> float:
        return 1.0 / float(self._weights @ self._weights)

    def _resample(self) -> None:
        chosen = systematic_resample(self._weights, float(self._rng.random()))
        self._states = np.take(self._states, chosen, axis=1, mode="clip")
        self._rates = np.take(self._rates, chosen, axis=1, mode="clip")
        self._log_weights.fill(0.0)
        self._weights.fill(1.0 / self._settings.particles)


def systematic_resample(weights: Array, offset: float) -> NDArray[np.intp]:
    """Indices of the particles to keep, paper (8): N evenly spaced picks from the weights.

    `offset` is uniform in [0, 1). Each particle is chosen N w times rounded up or down, and N w
    times on average (9).
    """
    n = len(weights)
    cumulative = np.cumsum(weights)
    picks = (np.arange(n) + offset) * (cumulative[-1] / n)
    chosen: NDArray[np.intp] = np.searchsorted(cumulative, picks, side="right")
    return np.minimum(chosen, n - 1, out=chosen)


def _wrap_in_place(angles: Array) -> None:
    turns = angles * (1.0 / math.tau)
    np.rint(turns, out=turns)
    turns *= math.tau
    angles -= turns
