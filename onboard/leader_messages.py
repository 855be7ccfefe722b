"""What a follower believes of its leader's messages: their order, their age, their figures."""

import math

from config.messages import Motion, Sighting

MOST_SPEED_MPS = 100.0
RESTART_S = 1.0
"""A leader whose clock has begun anew, or was never right, is heard again after so long."""


def implausible(motion: Motion) -> str | None:
    """Why a message cannot be true whatever robot sends it, or None."""
    if abs(motion.speed_mps) > MOST_SPEED_MPS:
        return f"claims to drive at {motion.speed_mps:.3g} m/s, limit {MOST_SPEED_MPS:.0f} m/s"
    if abs(motion.steering_rad) > math.pi:
        return f"claims to steer by {motion.steering_rad:.3g} rad, limit {math.pi:.2f} rad"
    return None


def usable(seen: Sighting) -> bool:
    """A bearing within one turn, with a deviation that a filter can divide by."""
    return abs(seen.bearing_rad) <= math.tau and 0.0 < seen.std_rad <= math.tau


class NewestFirst:
    """Lets messages pass that are newer than all before, by their sender's clock `t_ns`.

    After RESTART_S without one that is, the next starts the order anew.
    """

    def __init__(self) -> None:
        self._newest_ns = -1
        self._heard_s = -math.inf

    def is_news(self, t_ns: int, now_s: float) -> bool:
        """Judge one message that arrives at `now_s`."""
        if t_ns <= self._newest_ns and now_s - self._heard_s < RESTART_S:
            return False
        self._newest_ns, self._heard_s = t_ns, now_s
        return True
