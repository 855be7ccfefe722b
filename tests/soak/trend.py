"""Does a figure drift? A straight line through its samples, with the confidence of its slope."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import t as students_t

CONFIDENCE = 0.95
LEAST_SAMPLES = 5


class Trend(NamedTuple):
    """Slope per unit of time with its confidence interval, and the mean of the figure."""

    slope: float
    low: float
    high: float
    mean: float

    def text(self, duration: float, unit: str) -> str:
        """Growth over a duration, in words."""
        return (
            f"mean {self.mean:.6g}, growth over {duration:g} {unit} {self.slope * duration:+.4g} "
            f"(95 % {self.low * duration:+.4g} to {self.high * duration:+.4g})"
        )


def trend(points: Sequence[tuple[float, float, float]]) -> Trend | None:
    """Fit (session, time, value); sessions may differ in level but share the slope.

    Residuals that resemble their neighbours count for fewer samples (first-order correlation).
    None where there are too few samples.
    """
    sessions = sorted({session for session, _, _ in points})
    times, values = [], []
    for wanted in sessions:
        own = [(t, value) for session, t, value in points if session == wanted]
        centre_t, centre = np.mean(own, axis=0)
        times += [t - centre_t for t, _ in own]
        values += [value - centre for _, value in own]
    freedom = len(points) - len(sessions) - 1
    spread = float(np.sum(np.square(times)))
    if len(points) < LEAST_SAMPLES or freedom < 1 or spread == 0.0:
        return None
    slope = float(np.dot(times, values)) / spread
    residuals = np.array(values) - slope * np.array(times)
    share = _independent_share(residuals)
    effective = max(1.0, freedom * share)
    variance = float(np.dot(residuals, residuals)) / effective
    reach = float(students_t.ppf(0.5 + CONFIDENCE / 2, effective)) * math.sqrt(variance / spread)
    mean = float(np.mean([value for _, _, value in points]))
    return Trend(slope, slope - reach, slope + reach, mean)


def _independent_share(residuals: np.ndarray) -> float:
    """How much of a sample each one is worth, by the correlation of neighbours."""
    square = float(np.dot(residuals, residuals))
    if square == 0.0:
        return 1.0
    correlation = float(np.dot(residuals[1:], residuals[:-1])) / square
    correlation = min(max(correlation, 0.0), 0.99)
    return (1.0 - correlation) / (1.0 + correlation)
