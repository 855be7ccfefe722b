"""Bearings of a driven stretch, linked by odometry: what a search for the pose works on.

The robot's own frame begins where the window does. Bearings to one landmark from one place are
averaged, so a standing robot's window does not grow but gets better.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config import fleet
from onboard.estimate.localiser import STANDING_NOISE, KnownRate, LandmarkBearing, Mounting
from onboard.estimate.localiser_motion import Input, Mean, advance, stands
from onboard.estimate.rate_history import RateHistory

Array = NDArray[np.float64]

SAME_PLACE_M = 0.05
SAME_PLACE_RAD = 0.05
FITS_SIGMA = 4.0
MAX_ENTRIES = 120
SYSTEMATIC_STD_RAD = 0.005
"""What averaging over one place does not take away, apart from the bearings' bias."""

MAX_HEADING_DRIFT_RAD = 0.5
MAX_POSITION_DRIFT_M = 2.0


class Walked(NamedTuple):
    """What drift grows with, since the window began. `turning_m` is the way times its turn rate."""

    path_m: float = 0.0
    turned_rad: float = 0.0
    active_s: float = 0.0
    turning_m: float = 0.0


@dataclass(slots=True)
class Entry:
    """Mean of bearings to one landmark from one place; `direction_rad` is in the own frame."""

    landmark_id: int
    x_m: float
    y_m: float
    fork_rad: float
    direction_rad: float
    variance: float
    count: int
    walked: Walked


class Batch(NamedTuple):
    """Entries seen from the robot's present place, axes along its fork; one row per entry.

    `places` and `landmarks` (n, 2); `directions` [rad] with their own `variances` [rad^2]. What
    dead reckoning has added since, newer entries being part of the older ones' way: `turn_drifts`
    [rad^2] to the direction and `drifts` [m^2] to the place. `counts` of bearings; `landmark_ids`.
    """

    places: Array
    landmarks: Array
    directions: Array
    variances: Array
    turn_drifts: Array
    drifts: Array
    bias_variance: float
    counts: NDArray[np.int64]
    landmark_ids: NDArray[np.int64]


class BearingWindow:
    """See the module."""

    def __init__(
        self,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Mounting,
        known_rate: KnownRate,
        steering_rad: float,
    ) -> None:
        self._settings = settings
        self._wheelbase_m = wheelbase_m
        self._mounting = mounting
        self._known_rate: KnownRate = known_rate
        self._mean: Mean = (0.0, 0.0, steering_rad, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._history = RateHistory()
        self._walked = Walked()
        self._entries: list[Entry] = []

    @property
    def steering_rad(self) -> float:
        """eta - theta."""
        return self._mean[2] - self._mean[3]

    def predict(self, given: Input) -> None:
        """Dead reckoning by one step."""
        before = self._mean
        self._mean, _, rates = advance(before, given, self._wheelbase_m, self._known_rate)
        self._history.advance(given.dt_s, rates)
        path, turned, active, turning = self._walked
        turn = abs(self._mean[2] - before[2])
        self._walked = Walked(
            path + abs(given.speed_mps) * given.dt_s,
            turned + turn,
            active + given.dt_s * (STANDING_NOISE**2 if stands(given) else 1.0),
            turning + abs(given.speed_mps) * turn,
        )

    def measure_steering(self, steering_rad: float) -> None:
        """The encoder's angle replaces the integrated one; the fork's direction is kept."""
        if math.isfinite(steering_rad):
            self._mean = (*self._mean[:3], self._mean[2] - steering_rad, *self._mean[4:])

    def add(self, seen: LandmarkBearing) -> None:
        """Average into the entry of this landmark and place that it fits, or begin one."""
        if not math.isfinite(seen.bearing_rad):
            return
        age, rates = seen.age_s, self._history.over(seen.age_s)
        x, y = self._mean[0] - age * rates.x_mps, self._mean[1] - age * rates.y_mps
        fork = self._mean[2] - age * rates.fork_radps
        axis = fork if self._mounting == "fork" else self._mean[3] - age * rates.heading_radps
        direction, variance = axis + seen.bearing_rad, seen.std_rad**2
        here = [
            entry
            for entry in self._entries
            if entry.landmark_id == seen.landmark_id
            and math.hypot(entry.x_m - x, entry.y_m - y) < SAME_PLACE_M
            and abs(entry.fork_rad - fork) < SAME_PLACE_RAD
        ]
        for entry in here:
            off = math.remainder(direction - entry.direction_rad, math.tau)
            if off * off < FITS_SIGMA**2 * (variance + entry.variance):
                entry.count += 1
                entry.direction_rad += off / entry.count
                entry.variance = variance / entry.count
                return
        if len(here) < 2:
            entry = Entry(seen.landmark_id, x, y, fork, direction, variance, 1, self._walked)
            self._entries.append(entry)
            del self._entries[:-MAX_ENTRIES]

    def batch(self, positions: dict[int, tuple[float, float]]) -> Batch | None:
        """The entries whose drift is not too large; None where there is none."""
        rows = [row for row in self._rows() if row[1] < MAX_HEADING_DRIFT_RAD**2]
        rows = [row for row in rows if row[2] < MAX_POSITION_DRIFT_M**2]
        if not rows:
            return None
        entries = [entry for entry, _, _ in rows]
        x, y, fork = self._mean[:3]
        c, s = math.cos(fork), math.sin(fork)
        own = np.array([(entry.x_m - x, entry.y_m - y) for entry in entries])
        turn_drifts = np.array([drift for _, drift, _ in rows])
        swung = turn_drifts * np.sum(own**2, axis=1) / 3
        return Batch(
            places=own @ np.array([(c, -s), (s, c)]),
            landmarks=np.array([positions[entry.landmark_id] for entry in entries]),
            directions=np.array([entry.direction_rad - fork for entry in entries]),
            variances=np.array([entry.variance + SYSTEMATIC_STD_RAD**2 for entry in entries]),
            turn_drifts=turn_drifts,
            drifts=np.array([drift for _, _, drift in rows]) + swung,
            bias_variance=self._settings.bias_std_rad**2,
            counts=np.array([entry.count for entry in entries]),
            landmark_ids=np.array([entry.landmark_id for entry in entries]),
        )

    def _rows(self) -> Iterable[tuple[Entry, float, float]]:
        """Entries with the variances that their drift adds to direction and place."""
        settings = self._settings
        for entry in self._entries:
            path = self._walked.path_m - entry.walked.path_m
            turned = self._walked.turned_rad - entry.walked.turned_rad
            active = self._walked.active_s - entry.walked.active_s
            turning = self._walked.turning_m - entry.walked.turning_m
            net = self._mean[2] - entry.fork_rad
            yield (
                entry,
                settings.heading_noise_rad**2 * active
                + settings.turn_noise_rad**2 * turned
                + (settings.turn_scale_std * net) ** 2,
                settings.position_noise_m**2 * active
                + settings.travel_noise_m**2 * path
                + (settings.speed_scale_std * path) ** 2
                + (settings.turn_loss_std * turning) ** 2,
            )
