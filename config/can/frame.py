"""One classic CAN frame with an 11-bit identifier, as the sans-IO code sees it."""

from typing import NamedTuple


class Frame(NamedTuple):
    """A frame on one robot's bus.

    `t_s` is the monotonic time [s] at which the frame was received; for a frame that is about to
    be sent it is the time at which its sender made it.
    """

    can_id: int
    data: bytes
    t_s: float
    remote: bool = False
