"""How far a setpoint may move within 250 ms, whatever the steps in between were."""

from collections import deque

WINDOW_S = 0.25
_SLACK = 1.05
_BURST_S = 0.05


class WindowLimit:
    """Compares a value with every value of the last 250 ms.

    A second, coarser look than the rate budget: it does not start anew where the reference does.
    `rise_per_s` and `fall_per_s` are the limits [units per s], with the budget's slack and burst.
    """

    def __init__(self, rise_per_s: float, fall_per_s: float) -> None:
        reach_s = _SLACK * (WINDOW_S + _BURST_S)
        self.rise, self.fall = rise_per_s * reach_s, fall_per_s * reach_s
        self._values: deque[tuple[float, float]] = deque()

    def covers(self, value: float, now_s: float) -> bool:
        """True where the value is near enough to all those of the window."""
        values = self._values
        while values and now_s - values[0][0] > WINDOW_S:
            values.popleft()
        return all(-self.fall <= value - old <= self.rise for _, old in values)

    def add(self, value: float, now_s: float) -> None:
        """Remember a value that has passed."""
        self._values.append((now_s, value))
