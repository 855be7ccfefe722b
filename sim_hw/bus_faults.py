"""What befalls the frames of one bus, and the host's connection to it."""

from collections.abc import Collection

from numpy.random import Generator

from config.can.frame import Frame
from config.can.plan import IDS_PER_NODE
from sim_hw.faults import ActiveFaults

BABBLE_PERIOD_S = 0.01


class BusFaults(ActiveFaults):
    """Faults of a bus; frames of `unprotected_nodes` (the drives) have no end-to-end protection.

    What a corrupted frame is depends on that, see `config.faults`.
    """

    def __init__(self, rng: Generator, unprotected_nodes: Collection[int]) -> None:
        super().__init__("bus", rng)
        self._unprotected = frozenset(unprotected_nodes)
        self._held: dict[bool, list[Frame]] = {True: [], False: []}

    def end(self, kind: str) -> None:
        """End a fault; a frame that waits for the next one (`reordering`) is then lost."""
        super().end(kind)
        for held in self._held.values():
            held.clear()

    @property
    def unplugged(self) -> bool:
        """The host's controller is not on the bus: no cable, or no adapter."""
        return "unplugged" in self._values or "adapter_lost" in self._values

    @property
    def wrong_bitrate(self) -> bool:
        """The host's controller runs at another bit rate."""
        return "wrong_bitrate" in self._values

    @property
    def bus_off(self) -> bool:
        """The host's controller is kept bus-off."""
        return "bus_off" in self._values

    @property
    def adapter_lost(self) -> bool:
        """The host has no adapter."""
        return "adapter_lost" in self._values

    def babbles(self, t_s: float) -> bool:
        """Whether the babbling node has something to send at `t_s`."""
        if not self.has("babbling"):
            return False
        return t_s % BABBLE_PERIOD_S < self.value("babbling") * BABBLE_PERIOD_S

    def destroys(self, frame: Frame) -> bool:
        """Whether noise turns a frame on the wire into an error frame."""
        return (
            "corruption" in self._values
            and frame.can_id // IDS_PER_NODE in self._unprotected
            and self._happens("corruption")
        )

    def received(self, from_host: bool, frame: Frame) -> list[Frame]:
        """What the receivers of a frame get at its end: nothing, or this frame and others."""
        if self._happens("loss"):
            return []
        if frame.can_id // IDS_PER_NODE not in self._unprotected and self._happens("corruption"):
            frame = self._flipped(frame)
        held = self._held[from_host]
        if not held and self._happens("reordering"):
            held.append(frame)
            return []
        frames = [frame, frame] if self._happens("duplication") else [frame]
        if held:
            frames += [late._replace(t_s=frame.t_s) for late in held]
            held.clear()
        return frames

    def _happens(self, kind: str) -> bool:
        return kind in self._values and self._rng.random() < self._values[kind]

    def _flipped(self, frame: Frame) -> Frame:
        if not frame.data:
            return frame
        bit = int(self._rng.integers(8 * len(frame.data)))
        data = bytearray(frame.data)
        data[bit // 8] ^= 1 << bit % 8
        return frame._replace(data=bytes(data))
