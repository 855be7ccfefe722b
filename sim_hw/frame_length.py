"""Exact length of classic CAN frames on the wire, with CRC and stuff bits.

Both loops go byte by byte through tables, so that a frame of 8 bytes costs about 2 microseconds.
"""

from typing import TypeAlias

from config.can.frame import Frame

INTERFRAME_BITS = 3
FIXED_BITS = 47
"""Of a frame without data and stuff bits: start to CRC 34, delimiters, acknowledge and end 10,
interframe space 3."""

_POLYNOMIAL = 0x4599
_CRC_BITS = 15
_PADDING = 0b010101

StuffRow: TypeAlias = "list[tuple[int, StuffRow]]"


def frame_bits(frame: Frame) -> int:
    """Bits that the bus is taken for, interframe space included; 111 to 135 with 8 bytes."""
    data = frame.data
    length = len(data)
    header = frame.can_id << 7 | frame.remote << 6 | length
    content = header.to_bytes(3) + data
    crc = 0
    for byte in content:
        crc = (crc << 8 & 0x7F00) ^ _CRC_TABLE[crc >> 7 ^ byte]
    # Six bits in front fill the 34 + 8n bits to whole bytes without adding a stuff bit.
    bits = ((_PADDING << 19 | header) << 8 * length | int.from_bytes(data)) << _CRC_BITS | crc
    stuffed, row = 0, _START
    for byte in bits.to_bytes(length + 5):
        more, row = row[byte]
        stuffed += more
    return FIXED_BITS + 8 * length + stuffed


def _crc_of_byte(byte: int) -> int:
    crc = byte << (_CRC_BITS - 8)
    for _ in range(8):
        crc = crc << 1 ^ (_POLYNOMIAL if crc & 0x4000 else 0)
    return crc & 0x7FFF


def _stuff_rows() -> list[StuffRow]:
    """One row per state (last bit, how many alike): byte -> stuff bits in it, row that follows."""
    rows: list[StuffRow] = [[] for _ in range(8)]
    for state, row in enumerate(rows):
        for byte in range(256):
            bit, run, stuffed = state >> 2, (state & 3) + 1, 0
            for place in range(7, -1, -1):
                now = byte >> place & 1
                run = run + 1 if now == bit else 1
                bit = now
                if run == 5:
                    bit, run, stuffed = 1 - bit, 1, stuffed + 1
            row.append((stuffed, rows[bit << 2 | (run - 1)]))
    return rows


_CRC_TABLE = [_crc_of_byte(byte) for byte in range(256)]
_START = _stuff_rows()[4]
