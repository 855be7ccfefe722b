"""Clocks of the emulated devices: what is sent in cycles, and how they count time."""

import math

TOLERANCE_S = 1e-7


class Cycle:
    """Something due at `first_s` and every `period_s` after; due times that were missed lapse."""

    __slots__ = ("_period_s", "next_s")

    def __init__(self, first_s: float, period_s: float) -> None:
        self.next_s = first_s
        self._period_s = period_s

    def due(self, t_s: float) -> bool:
        """True once for each due time that `t_s` has reached."""
        late_s = t_s - self.next_s + TOLERANCE_S
        if late_s < 0:
            return False
        self.next_s += self._period_s * (1 + math.floor(late_s / self._period_s))
        return True


class DeviceClock:
    """A device's own 16-bit clock of 0.1 ms ticks; it shows `reading_s` at time `t_s`."""

    __slots__ = ("_zero_s",)

    def __init__(self, t_s: float, reading_s: float) -> None:
        self._zero_s = t_s - reading_s

    def read_ms(self, t_s: float) -> float:
        """What the clock shows [ms], from 0 to 6553.5."""
        return (round((t_s - self._zero_s) * 1e4) & 0xFFFF) * 0.1
