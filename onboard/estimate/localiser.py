"""Particle filter of a robot that sees landmarks, paper (6)-(9).

State of each particle: (x, y, eta, theta) of (3). The proposal is the motion model, so the weights
(7) are multiplied by the likelihood of the bearings alone; they are kept as logarithms. Systematic
resampling, which satisfies (9), when the effective number of particles falls below half.

Bearings are in the body frame where the sensor is mounted on the body, and in the fork frame where
it is mounted on the fork: the raw reading plus the mounting yaw. The encoder is not added, since
its error would enter a second time: the particles hold the fork's direction themselves.
"""

import math
from collections.abc import Sequence
from enum import Enum
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config import fleet
from config.angles import wrap
from onboard.estimate.beliefs import PoseBelief

Array = NDArray[np.float64]

X, Y, FORK, HEADING = range(4)

STANDING_MPS = 0.01
"""Below this speed a robot counts as standing."""

STANDING_NOISE = 0.1
"""Factor on the process noise of a standing robot, whose fork no bearing can see."""

DIVERGED_SIGMA = 5.0
"""If the likeliest particle is further than this from every bearing, the bearings are not used."""


class LandmarkBearing(NamedTuple):
    """A bearing [rad] to a landmark, captured `age_s` before the last prediction's end."""

    landmark_id: int
    bearing_rad: float
    std_rad: float
    age_s: float


class UpdateOutcome(Enum):
    """What became of a batch of bearings."""

    UPDATED = "the weights were updated"
    RESAMPLED = "the weights were updated and the particles resampled"
    NO_BEARINGS = "no bearing belongs to a known landmark"
    DIVERGED = "no particle agrees with any bearing: bearings not used"


class UpdateResult(NamedTuple):
    """Outcome, ids in the batch that are not on the map, and the effective number of particles."""

    outcome: UpdateOutcome
    unknown_ids: tuple[int, ...]
    effective_particles: float


class ParticleLocaliser:
    """See the module; no clock and no global random numbers: the same seed gives the same run."""

    def __init__(
        self,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Literal["body", "fork"],
        landmarks: dict[int, tuple[float, float]],
        start: fleet.Pose,
        seed: int,
        start_steering_rad: float = 0.0,
    ) -> None:
        """Spread the particles around `start` by `start_std_*`; the fork as its encoder says.

        `landmarks` maps ids to (x, y) [m].
        """
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

    def predict(self, dt_s: float, speed_mps: float, steering_rate_radps: float) -> None:
        """Advance by `dt_s` with (3) and add the process noise.

        The input is the hardware's: front-wheel speed and d delta/dt, the difference of two
        encoder readings over the time between them, which makes eta' = d delta/dt + theta'.
        """
        s, rates = self._states, self._rates
        steering = s[FORK] - s[HEADING]
        steering += steering_rate_radps * dt_s / 2
        np.sin(steering, out=rates[HEADING])
        rates[HEADING] *= speed_mps / self._wheelbase_m
        np.add(rates[HEADING], steering_rate_radps, out=rates[FORK])
        middle = rates[FORK] * (dt_s / 2)
        middle += s[FORK]
        np.cos(middle, out=rates[X])
        np.sin(middle, out=rates[Y])
        rates[:2] *= speed_mps
        np.multiply(rates, dt_s, out=self._noise)
        s += self._noise
        self._add_noise(dt_s, abs(speed_mps) < STANDING_MPS)

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
            return UpdateResult(UpdateOutcome.DIVERGED, unknown, self._effective())
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
