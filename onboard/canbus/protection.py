"""End-to-end protection, AUTOSAR profile 2: judge received frames, number and sign our own.

Wrong data, a frame under another message's identifier, repetition, loss and re-ordering are told
apart. A signal is trusted after 2 good frames in a row and no longer after 3 bad ones.
"""

from collections import Counter
from enum import Enum

from config.can import e2e

MAX_DELTA = 3
BAD_TO_DISTRUST = 3
GOOD_TO_TRUST = 2


class Reception(Enum):
    """What the protection says about one frame. INITIAL is neither good nor bad."""

    INITIAL = "initial"
    OK = "ok"
    OK_SOME_LOST = "ok, some lost"
    REPEATED = "repeated"
    WRONG_SEQUENCE = "wrong sequence"
    WRONG_CRC = "wrong CRC"


GOOD = frozenset((Reception.OK, Reception.OK_SOME_LOST))


class Receiver:
    """Judges the frames of one message.

    `valid` says whether the signal as a whole is trusted, `counts` how often each verdict was
    given, `lost` how many frames the counter shows as missing between good ones.
    """

    def __init__(self, data_id: int, length: int) -> None:
        self.valid = False
        self.counts: Counter[Reception] = Counter()
        self.lost = 0
        self._id_list = e2e.data_id_list(data_id)
        self._length = length
        self._last: int | None = None
        self._streak = 0

    def accept(self, data: bytes) -> bool:
        """Judge a frame; True where it is good and the signal is trusted: use its content."""
        return self.check(data) in GOOD and self.valid

    def check(self, data: bytes) -> Reception:
        """Judge a frame; a wrong length counts as a wrong CRC."""
        reception = self._judge(data)
        self.counts[reception] += 1
        if reception is not Reception.INITIAL:
            self._qualify(reception in GOOD)
        return reception

    def _judge(self, data: bytes) -> Reception:
        if len(data) != self._length or not e2e.crc_ok(data, self._id_list):
            return Reception.WRONG_CRC
        counter = e2e.counter_of(data)
        last, self._last = self._last, counter
        if last is None:
            return Reception.INITIAL
        delta = (counter - last) & 0x0F
        if delta == 0:
            return Reception.REPEATED
        if delta > MAX_DELTA:
            return Reception.WRONG_SEQUENCE
        self.lost += delta - 1
        return Reception.OK if delta == 1 else Reception.OK_SOME_LOST

    def _qualify(self, good: bool) -> None:
        """Count frames in a row that speak against the present trust."""
        self._streak = 0 if good == self.valid else self._streak + 1
        if self._streak >= (BAD_TO_DISTRUST if self.valid else GOOD_TO_TRUST):
            self.valid = good
            self._streak = 0


class Protector:
    """Owns the counter of one message that this host sends."""

    def __init__(self, data_id: int) -> None:
        self._id_list = e2e.data_id_list(data_id)
        self._counter = 0

    def protect(self, payload: bytes) -> bytes:
        """The payload (CRC byte and counter nibble left free) with both filled in."""
        data = e2e.protect(payload, self._id_list, self._counter)
        self._counter = (self._counter + 1) & 0x0F
        return data
