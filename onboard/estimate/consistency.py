"""Whether bearings still fit a belief: the normalised innovations of a window, watched.

A landmark contradicts the pose when most of its recent bearings do not fit. Three landmarks that
agree tell more than a pose needs, so that others may be wrong; two fit a whole arc of poses. The
pose is therefore lost when landmarks contradict it for a time and at most two agree. Outliers are
too few for that, and a gap without bearings adds nothing to the time.
"""

import statistics
from collections import Counter, deque
from typing import NamedTuple

WINDOW = 40
ENOUGH = 20
HIGH_NIS = 6.63
"""One in a hundred innovations of a consistent filter is higher (1 degree of freedom)."""

ENOUGH_AGREE = 3
"""So many landmarks that agree outvote those that do not."""

LOST_AFTER_S = 1.0
LOST_AFTER_ONE_LANDMARK_S = 4.0
"""Where only one landmark contradicts, which may have been moved or hidden for a while."""
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
        self._against = 0
        self._last_s: float | None = None

    def observe(self, landmark_id: int, nis: float) -> None:
        """Take in one bearing, accepted or not."""
        self._window.append(_Seen(landmark_id, nis))

    def judge(self, now_s: float) -> None:
        """Once per look, after its bearings."""
        step_s = 0.0 if self._last_s is None else min(now_s - self._last_s, MAX_STEP_S)
        self._last_s = now_s
        self._against = self._contradicting()
        self._bad_s = self._bad_s + step_s if self._against else 0.0

    @property
    def lost(self) -> bool:
        """Too few landmarks have agreed for too long."""
        limit_s = LOST_AFTER_S if self._against > 1 else LOST_AFTER_ONE_LANDMARK_S
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

    def _contradicting(self) -> int:
        """How many landmarks contradict the pose; 0 while enough others agree."""
        if len(self._window) < ENOUGH:
            return 0
        seen = Counter(each.landmark_id for each in self._window)
        high = Counter(each.landmark_id for each in self._window if _is_high(each))
        against = sum(2 * high[landmark] > count for landmark, count in seen.items())
        return against if len(seen) - against < ENOUGH_AGREE else 0


def _is_high(seen: _Seen) -> bool:
    return not seen.nis <= HIGH_NIS
