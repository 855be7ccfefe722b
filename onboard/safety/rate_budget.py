"""How fast a setpoint may change: a budget that fills at the limit and that changes use up."""

RATE_SLACK = 1.05
BURST_S = 0.05
"""Changes worth this long at the limit may come at once: cycles are not evenly spaced."""
_ROUNDING = 1e-6
"""Setpoints travel as 32-bit floats."""


class RateBudget:
    """Lets changes pass that stay below a rate [units per s] on average.

    Slack: 5 % in the long run, and bursts of what the limit allows in 50 ms.
    """

    def __init__(self, limit_per_s: float) -> None:
        self._rate_per_s = limit_per_s * RATE_SLACK
        self._capacity = self._rate_per_s * BURST_S
        self._level = self._capacity
        self._t_s: float | None = None

    def refill(self, now_s: float) -> None:
        """Add what has accrued since the last call."""
        if self._t_s is not None:
            accrued = self._rate_per_s * max(0.0, now_s - self._t_s)
            self._level = min(self._capacity, self._level + accrued)
        self._t_s = now_s

    def covers(self, change: float) -> bool:
        """True where a change of this size may pass now."""
        return change <= self._level + _ROUNDING

    def use(self, change: float) -> None:
        """Take a change off the budget."""
        self._level = max(0.0, self._level - change)
