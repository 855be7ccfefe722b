"""How a robot moved lately, so that a late bearing is met where the robot was at its capture."""

from collections import deque

from onboard.estimate.localiser_motion import Rates

KEPT_S = 0.5
"""Rates older than this are forgotten; the oldest kept ones stand in for them."""


class RateHistory:
    """The rates of the last predictions, newest last."""

    def __init__(self) -> None:
        self._newest = Rates()
        self._newest_dt_s = 0.0
        self._spells: deque[tuple[float, Rates]] = deque()
        self._kept_s = 0.0

    def advance(self, dt_s: float, rates: Rates) -> None:
        """Record the rates of the next `dt_s`."""
        self._newest, self._newest_dt_s = rates, dt_s
        self._spells.append((dt_s, rates))
        self._kept_s += dt_s
        while len(self._spells) > 1 and self._kept_s - self._spells[0][0] >= KEPT_S:
            self._kept_s -= self._spells.popleft()[0]

    def over(self, age_s: float) -> Rates:
        """Mean rates from `age_s` ago to now."""
        if age_s <= self._newest_dt_s or len(self._spells) < 2:
            return self._newest
        total, left_s = [0.0] * len(Rates._fields), age_s
        for spell in reversed(self._spells):
            dt_s, rates = spell
            share = (left_s if spell is self._spells[0] else min(left_s, dt_s)) / age_s
            total = [sum_ + share * rate for sum_, rate in zip(total, rates, strict=True)]
            left_s -= dt_s
            if left_s <= 0.0:
                break
        return Rates(*total)
