"""Whether bearings still fit a belief: the normalised innovations of a window, watched.

A pose is lost when most recent bearings, to more than one landmark where several are seen, do not
fit for a time. Outliers are too few for that, and a gap without bearings adds nothing to the time.
"""

import statistics
from collections import deque
from typing import NamedTuple

WINDOW = 40
ENOUGH = 20
HIGH_NIS = 6.63
"""One in a hundred innovations of a consistent filter is higher (1 degree of freedom)."""

LOST_AFTER_S = 1.0
LOST_AFTER_ONE_LANDMARK_S = 4.0
MAX_STEP_S = 0.2
"""Of the time between two looks, so much counts."""


class _Seen(NamedTuple):
    landmark_id: int
    nis: float


class Consistency:
    """Window of the last bearings' normalised innovations squared."""

    def __init__(self) -> None:
        self._window: deque[_Seen] = deque(maxlen=WINDOW)
        self._bad_s = 0.0
        self._last_s: float | None = None

    def observe(self, landmark_id: int, nis: float) -> None:
        """Take in one bearing, accepted or not."""
        self._window.append(_Seen(landmark_id, nis))

    def judge(self, now_s: float) -> None:
        """Once per look, after its bearings."""
        step_s = 0.0 if self._last_s is None else min(now_s - self._last_s, MAX_STEP_S)
        self._last_s = now_s
        self._bad_s = self._bad_s + step_s if self._mostly_high() else 0.0

    @property
    def lost(self) -> bool:
        """Most bearings have not fitted for too long."""
        landmarks = {seen.landmark_id for seen in self._window}
        limit_s = LOST_AFTER_S if len(landmarks) > 1 else LOST_AFTER_ONE_LANDMARK_S
        return self._bad_s >= limit_s

    @property
    def nis_median(self) -> float | None:
        """Median over the window: 0.45 for a consistent filter."""
        return statistics.median(seen.nis for seen in self._window) if self._window else None

    @property
    def high_share(self) -> str:
        """How many of the window's bearings do not fit, in words."""
        high = sum(_is_high(seen) for seen in self._window)
        return f"{high} of the last {len(self._window)} bearings do not fit"

    def _mostly_high(self) -> bool:
        if len(self._window) < ENOUGH:
            return False
        high = [seen.landmark_id for seen in self._window if _is_high(seen)]
        if 2 * len(high) <= len(self._window):
            return False
        several_seen = len({seen.landmark_id for seen in self._window}) > 1
        return len(set(high)) > 1 or not several_seen


def _is_high(seen: _Seen) -> bool:
    return not seen.nis <= HIGH_NIS
