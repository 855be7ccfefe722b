"""One node's CAN controller: what waits to be sent, its error counters, its error state."""

from collections import deque
from enum import IntEnum

from config.can.frame import Frame

WARNING_COUNT = 96
PASSIVE_COUNT = 128
BUS_OFF_COUNT = 256
SERIOUS_ERROR = 8
"""What an error adds to the counter of its sender, of which 32 in a row lead to bus-off, and to
that of a receiver which alone has seen it."""


class ErrorState(IntEnum):
    """In the order of how bad it is."""

    ACTIVE = 0
    WARNING = 1
    PASSIVE = 2
    BUS_OFF = 3


class Controller:
    """A first-in-first-out transmit queue of `limit` frames, and the counters TEC and REC.

    `overflowed` counts frames that found the queue full.
    """

    __slots__ = ("limit", "name", "overflowed", "queue", "receive_errors", "transmit_errors")

    def __init__(self, name: str, limit: int) -> None:
        self.name = name
        self.limit = limit
        self.queue: deque[Frame] = deque()
        self.transmit_errors = 0
        self.receive_errors = 0
        self.overflowed = 0

    @property
    def state(self) -> ErrorState:
        """What the counters make of the controller."""
        if self.transmit_errors >= BUS_OFF_COUNT:
            return ErrorState.BUS_OFF
        worst = max(self.transmit_errors, self.receive_errors)
        if worst >= PASSIVE_COUNT:
            return ErrorState.PASSIVE
        return ErrorState.WARNING if worst >= WARNING_COUNT else ErrorState.ACTIVE

    @property
    def troubled(self) -> bool:
        """True while a counter is not zero."""
        return bool(self.transmit_errors or self.receive_errors)

    def sending_failed(self) -> None:
        """An error while this node was sending."""
        self.transmit_errors = min(self.transmit_errors + SERIOUS_ERROR, BUS_OFF_COUNT)

    def not_acknowledged(self) -> None:
        """Nobody has heard a frame; that alone never takes a passive node off the bus."""
        if self.state < ErrorState.PASSIVE:
            self.sending_failed()

    def hearing_failed(self, alone: bool) -> None:
        """An error while another node was sending; `alone` where only this node has seen it."""
        added = SERIOUS_ERROR if alone else 1
        self.receive_errors = min(self.receive_errors + added, PASSIVE_COUNT)

    def sent(self) -> None:
        """A frame of this node went through."""
        self.transmit_errors = max(self.transmit_errors - 1, 0)

    def heard(self) -> None:
        """A frame of another node went through."""
        self.receive_errors = max(min(self.receive_errors, PASSIVE_COUNT - 8) - 1, 0)

    def go_off(self) -> None:
        """Leave the bus, forgetting what waits to be sent."""
        self.transmit_errors = BUS_OFF_COUNT
        self.queue.clear()

    def restart(self) -> None:
        """Come back with both counters at zero."""
        self.transmit_errors = self.receive_errors = 0
        self.queue.clear()
