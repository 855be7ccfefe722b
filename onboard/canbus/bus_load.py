"""How full the bus is, by the frames that this host hears and sends."""

from collections.abc import Iterable

from config.can.frame import Frame

WINDOW_S = 1.0


class BusLoad:
    """Share of the last second's bits; stuff bits counted at their worst, so never too low.

    A frame with an 11-bit identifier and n data bytes has 8 n + 47 bits with the space behind it,
    and at most (8 n + 33) / 4 stuff bits. What other nodes lose or repeat is not heard here.
    """

    def __init__(self, bitrate: int) -> None:
        self.load = 0.0
        self._bitrate = bitrate
        self._bits = 0
        self._since_s: float | None = None

    def count(self, frames: Iterable[Frame]) -> None:
        """Take frames that were on the bus."""
        for frame in frames:
            bits = 0 if frame.remote else 8 * len(frame.data)
            self._bits += bits + 47 + (bits + 33) // 4

    def at(self, now_s: float) -> None:
        """Work out the load once per second."""
        if self._since_s is None:
            self._since_s, self._bits = now_s, 0
        elapsed_s = now_s - self._since_s
        if elapsed_s >= WINDOW_S:
            self.load = min(1.0, self._bits / (elapsed_s * self._bitrate))
            self._since_s, self._bits = now_s, 0
