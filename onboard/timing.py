"""Timing of the control loop: the absolute schedule and its statistics."""

from collections import deque
from dataclasses import dataclass

from config.messages import LoopHealth

WINDOW_CYCLES = 1000
REFRESH_CYCLES = 10


@dataclass(slots=True)
class Schedule:
    """Absolute deadlines `start_s + n * period_s`; whole missed periods are skipped."""

    next_s: float
    period_s: float

    def advance(self, now_s: float) -> int:
        """Move to the first deadline after `now_s`; returns how many periods were skipped."""
        periods = max(1, 1 + int((now_s - self.next_s) // self.period_s))
        self.next_s += periods * self.period_s
        return periods - 1


class LoopStatistics:
    """Durations and wake-up lateness of the last cycles; an overrun is a missed deadline."""

    def __init__(self, realtime: bool) -> None:
        self._durations_s: deque[float] = deque(maxlen=WINDOW_CYCLES)
        self._lateness_s: deque[float] = deque(maxlen=WINDOW_CYCLES)
        self._overruns = 0
        self._max_s = 0.0
        self._since_refresh = 0
        self.health = LoopHealth(0, 0, 0.0, 0.0, 0.0, 0.0, realtime)

    def record(self, duration_s: float, late_s: float, skipped: int) -> None:
        """Count one cycle; `health` is brought up to date every tenth."""
        self._durations_s.append(duration_s)
        self._lateness_s.append(late_s)
        self._overruns += skipped
        self._max_s = max(self._max_s, duration_s)
        self._since_refresh += 1
        if self._since_refresh == REFRESH_CYCLES:
            self._refresh()

    def _refresh(self) -> None:
        durations, lateness = sorted(self._durations_s), sorted(self._lateness_s)
        self.health = LoopHealth(
            cycles=self.health.cycles + self._since_refresh,
            overruns=self._overruns,
            p50_ms=1e3 * _percentile(durations, 0.5),
            p99_ms=1e3 * _percentile(durations, 0.99),
            max_ms=1e3 * self._max_s,
            late_p99_ms=1e3 * _percentile(lateness, 0.99),
            realtime=self.health.realtime,
        )
        self._since_refresh = 0


def _percentile(ordered: list[float], fraction: float) -> float:
    return ordered[min(len(ordered) - 1, int(fraction * len(ordered)))]
