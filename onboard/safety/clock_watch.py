"""A wall clock that jumps: ages of the leader's messages and bearings are counted on it."""

ADOPT_S = 1.0
"""So long after a jump the new offset is the one to compare with."""


class ClockWatch:
    """Compares the wall clock with the monotonic one from cycle to cycle.

    A slewed clock drifts by at most 0.5 ms per s, which is followed. One look may be wrong, where
    the process is suspended between the two readings; a jump stays.
    """

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._offset_s: float | None = None
        self._since_s: float | None = None

    def step_s(self, now_s: float, wall_s: float) -> float:
        """How far the wall clock is from where it should be; for 1 s after a jump."""
        offset_s = wall_s - now_s
        if self._offset_s is None:
            self._offset_s = offset_s
        step_s = offset_s - self._offset_s
        if abs(step_s) <= self._limit_s:
            self._offset_s, self._since_s = offset_s, None
        elif self._since_s is None:
            self._since_s = now_s
        elif now_s - self._since_s >= ADOPT_S:
            self._offset_s, self._since_s = offset_s, None
        return step_s
