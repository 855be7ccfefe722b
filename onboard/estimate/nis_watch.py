"""Is the filter as good as it says? The mean NIS of the last bearings against chi-square limits.

Each accepted bearing's NIS has one degree of freedom where the model and the noise are right, so
the sum over a window of n is chi-square with n. An alarm needs a mean that would come up once in a
billion looks and ends only well inside, so that it neither fires by chance nor flickers.
"""

import math
from collections import deque
from enum import StrEnum
from statistics import NormalDist
from typing import NamedTuple

from onboard.estimate.beliefs import Innovation

WINDOW = 400
"""Bearings in the mean: a second of two markers seen both ways at 100 Hz."""
ALARM_PROBABILITY = 1e-9
CLEAR_PROBABILITY = 1e-3


class NisState(StrEnum):
    """What the mean NIS says. LOW: the noise is less than assumed, or a sensor is stuck."""

    FILLING = "filling"
    OK = "ok"
    LOW = "low"
    HIGH = "high"


class Limits(NamedTuple):
    """Bounds of a mean NIS."""

    low: float
    high: float


def mean_nis_limits(count: int, probability: float) -> Limits:
    """Two-sided limits that the mean of `count` right NIS leaves with this probability.

    Wilson and Hilferty's cube-root approximation of the chi-square quantile: from `count` 30 on
    within 2 % of the limit's distance to 1.
    """
    spread = 2.0 / (9.0 * count)
    z = NormalDist().inv_cdf(probability / 2) * math.sqrt(spread)
    return Limits(max(0.0, 1.0 - spread + z) ** 3, (1.0 - spread - z) ** 3)


class NisWatch:
    """Windowed mean of accepted NIS with hysteresis; rejected ones are the gate's business."""

    def __init__(self) -> None:
        self.state = NisState.FILLING
        self.limits = mean_nis_limits(WINDOW, ALARM_PROBABILITY)
        self._clear = mean_nis_limits(WINDOW, CLEAR_PROBABILITY)
        self._window: deque[float] = deque(maxlen=WINDOW)
        self._sum = 0.0

    @property
    def mean(self) -> float | None:
        """Mean NIS over the window, None while it fills."""
        return None if self.state is NisState.FILLING else self._sum / WINDOW

    def add(self, innovation: Innovation) -> None:
        """Take in one bearing."""
        if not innovation.accepted:
            return
        window = self._window
        full = len(window) == WINDOW
        if full:
            self._sum -= window[0]
        window.append(innovation.nis)
        self._sum += innovation.nis
        if len(window) == WINDOW:
            self.state = self._judged(self._sum / WINDOW)

    def problem(self) -> str | None:
        """Why the estimate is not to be trusted: errors larger than the filter claims.

        LOW is no problem of safety: the claimed deviations are then too large.
        """
        if self.state is not NisState.HIGH:
            return None
        return (
            f"bearings fit worse than the filter claims: mean NIS {self._sum / WINDOW:.2f} over "
            f"{WINDOW} bearings, limit {self.limits.high:.2f}; check bearing_sensor.std_rad, the "
            "markers' places and the odometry"
        )

    def _judged(self, mean: float) -> NisState:
        if mean > self.limits.high or (self.state is NisState.HIGH and mean > self._clear.high):
            return NisState.HIGH
        if mean < self.limits.low or (self.state is NisState.LOW and mean < self._clear.low):
            return NisState.LOW
        return NisState.OK
