"""Does a source of bearings contradict the estimate? The share of its bearings that were refused.

One in some ten thousand bearings of a consistent filter does not pass the gate. A sensor that is
turned, frozen or mad fails it again and again, but not always: a count of refusals in a row, or
one over several sources together, starts anew with each bearing that passes by chance.
"""

from collections import deque

WINDOW = 100
"""Bearings in the share: half a second of two markers at 100 Hz."""
LIMIT_SHARE = 0.5


class MisfitWatch:
    """Counts the refused among the last bearings from one source."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._window: deque[bool] = deque(maxlen=WINDOW)
        self._refused = 0

    def add(self, accepted: bool) -> None:
        """Take in one bearing."""
        if len(self._window) == WINDOW:
            self._refused -= not self._window[0]
        self._window.append(accepted)
        self._refused += not accepted

    def problem(self) -> str | None:
        """Why the source or the estimate is wrong, or None."""
        if self._refused <= LIMIT_SHARE * WINDOW:
            return None
        return (
            f"{self._refused} of the last {len(self._window)} {self._source} do not fit the "
            f"estimate, limit {LIMIT_SHARE * WINDOW:.0f}"
        )
