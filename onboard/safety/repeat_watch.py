"""A sensor that gives the very same bearings again and again is stuck: real ones have noise.

Looks are compared while the robot drives, so that even a sensor without noise would see its
targets move. One target may stay where it is seen, several do not.
"""

from onboard.role import Observation

LEAST_SPEED_MPS = 0.1


class RepeatWatch:
    """For how long all bearings have been equal to the last digit; time is passed in."""

    def __init__(self) -> None:
        self._last: dict[int, float] = {}
        self._since_s: float | None = None

    def look(self, now_s: float, observations: list[Observation], speed_mps: float) -> float:
        """How long the same bearings have been coming by now [s]; 0 while they change."""
        if observations:
            seen = {each.marker: each.sensor_rad for each in observations}
            same = seen == self._last and len(seen) > 1 and abs(speed_mps) > LEAST_SPEED_MPS
            if not same:
                self._since_s = now_s
            self._last = seen
        return 0.0 if self._since_s is None else now_s - self._since_s
