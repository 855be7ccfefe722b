"""Asks a drive once per second for what it does not send by itself: version, supply, temperature.

Remote frames, one at a time, so that they never crowd a cycle. On firmware 0.5 any frame feeds
the drive's watchdog; at this rate they cannot keep it alive.
"""

from config.can.frame import Frame
from onboard.canbus.drive.variant import OdriveVariant
from onboard.canbus.host import Cyclic

PERIOD_S = 1.0


class OdriveQueries:
    """The queries of one axis in turn."""

    def __init__(self, variant: OdriveVariant) -> None:
        self._ids = variant.queries
        self._next = 0
        self._cycle = Cyclic(PERIOD_S / len(self._ids))

    def tick(self, now_s: float) -> list[Frame]:
        """The remote frame that is due, if any."""
        if not self._cycle.due(now_s):
            return []
        can_id = self._ids[self._next % len(self._ids)]
        self._next += 1
        return [Frame(can_id, b"", now_s, remote=True)]
