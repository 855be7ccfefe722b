"""Random and mutated CAN messages, as any node, or a fault of one, could put them on the bus."""

import math
import struct
from collections.abc import Iterator

import can
from numpy.random import Generator

from config.can import e2e

EVIL_FLOATS = (
    *(math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-45, -1e-45, 3.4e38, -3.4e38),
    *(1.0, -1.0, 1e6, -1e6, 1e-6),
)
EVIL_BYTES = (0x00, 0x01, 0x7F, 0x80, 0xFF)
HIGHEST_ID = 0x7FF
HIGHEST_EXTENDED_ID = 0x1FFFFFFF
KEPT = 64


class FrameFuzzer:
    """Makes messages from a random stream and from what it has been shown of the real bus.

    `quiet` leaves out what may rightly stop the robot: contents of a drive that the bus cannot
    protect, error frames, and of every protected message a good CRC or more than one bad one in a
    burst (three bad ones in a row take its trust away).
    """

    def __init__(
        self, rng: Generator, known_ids: list[int], unprotected: set[int], protected: set[int]
    ) -> None:
        self._rng = rng
        self._known, self._unprotected, self._protected = known_ids, unprotected, protected
        self._seen: list[can.Message] = []
        self._counters: dict[int, int] = {}

    def show(self, message: can.Message) -> None:
        """Remember a real message to mutate."""
        if len(self._seen) < KEPT:
            self._seen.append(message)
        else:
            self._seen[int(self._rng.integers(KEPT))] = message

    def burst(self, count: int, now_s: float, quiet: bool) -> Iterator[can.Message]:
        """So many messages, stamped about `now_s` on the wall clock."""
        made = 0
        spoiled: set[int] = set()
        while made < count:
            message = self._one(now_s)
            if quiet and not self._is_quiet(message, spoiled):
                continue
            made += 1
            yield message

    def _one(self, now_s: float) -> can.Message:
        kind = self._rng.integers(6)
        if kind == 0 or not self._seen:
            return self._random(now_s)
        if kind == 1:
            return self._known_id(now_s)
        template = self._seen[int(self._rng.integers(len(self._seen)))]
        data = bytearray(template.data)
        if kind == 2:
            self._flip(data)
        elif kind == 3:
            data = data[: int(self._rng.integers(len(data) + 1))]
        elif kind == 4:
            self._write_evil(data)
        if kind >= 4 and template.arbitration_id in self._protected and len(data) >= 2:
            data = bytearray(self._signed(template.arbitration_id, bytes(data)))
        return _message(template.arbitration_id, bytes(data), self._stamp(now_s))

    def _random(self, now_s: float) -> can.Message:
        """Any identifier, any flags, any content."""
        rng, extended = self._rng, bool(self._rng.random() < 0.2)
        can_id = int(rng.integers(HIGHEST_EXTENDED_ID if extended else HIGHEST_ID))
        return can.Message(
            timestamp=self._stamp(now_s),
            arbitration_id=can_id,
            is_extended_id=extended,
            is_error_frame=bool(rng.random() < 0.05),
            data=self._bytes(),
        )

    def _known_id(self, now_s: float) -> can.Message:
        """An identifier that means something to the robot, with a content that does not."""
        can_id = self._known[int(self._rng.integers(len(self._known)))]
        if self._rng.random() < 0.1:
            return can.Message(
                timestamp=self._stamp(now_s),
                arbitration_id=can_id,
                is_extended_id=False,
                is_remote_frame=True,
            )
        data = bytearray(self._bytes())
        if self._rng.random() < 0.5:
            data = bytearray(8)
            self._write_evil(data)
        if can_id in self._protected and len(data) >= 2 and self._rng.random() < 0.7:
            data = bytearray(self._signed(can_id, bytes(data)))
        return _message(can_id, bytes(data), self._stamp(now_s))

    def _is_quiet(self, message: can.Message, spoiled: set[int]) -> bool:
        if message.is_error_frame:
            return False
        if message.is_extended_id or message.is_remote_frame:
            return True
        if message.arbitration_id in self._unprotected:
            return len(message.data) < 8
        if message.arbitration_id not in self._protected:
            return True
        if message.arbitration_id in spoiled:
            return False
        spoiled.add(message.arbitration_id)
        return not e2e.crc_ok(bytes(message.data), e2e.data_id_list(message.arbitration_id))

    def _signed(self, can_id: int, data: bytes) -> bytes:
        """With the next counter and a CRC that fits."""
        counter = (self._counters.get(can_id, 0) + 1) & 0x0F
        self._counters[can_id] = counter
        return e2e.protect(data, e2e.data_id_list(can_id), counter)

    def _flip(self, data: bytearray) -> None:
        for _ in range(int(self._rng.integers(1, 4))):
            if data:
                data[int(self._rng.integers(len(data)))] ^= 1 << int(self._rng.integers(8))

    def _write_evil(self, data: bytearray) -> None:
        if len(data) == 8 and self._rng.random() < 0.6:
            value = EVIL_FLOATS[int(self._rng.integers(len(EVIL_FLOATS)))]
            struct.pack_into("<f", data, 4 * int(self._rng.integers(2)), value)
        elif data:
            place = int(self._rng.integers(len(data)))
            data[place] = EVIL_BYTES[int(self._rng.integers(len(EVIL_BYTES)))]

    def _bytes(self) -> bytes:
        return self._rng.bytes(int(self._rng.integers(9)))

    def _stamp(self, now_s: float) -> float:
        """Mostly now; at times long ago, in the future, or never set."""
        if self._rng.random() < 0.95:
            return now_s
        return (0.0, now_s - 1e4, now_s + 1e4, -1e9)[int(self._rng.integers(4))]


def _message(can_id: int, data: bytes, timestamp_s: float) -> can.Message:
    return can.Message(
        timestamp=timestamp_s, arbitration_id=can_id, is_extended_id=False, data=data
    )
