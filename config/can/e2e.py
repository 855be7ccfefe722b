"""AUTOSAR end-to-end protection, profile 2: a CRC in byte 0, a counter in byte 1's low nibble.

A message's identity enters its CRC through one byte of a list that the counter selects, so a frame
that arrives under another message's identifier is caught.
"""

from functools import cache

_POLYNOMIAL = 0x2F


def _crc_of_byte(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1) ^ (_POLYNOMIAL if byte & 0x80 else 0)
        byte &= 0xFF
    return byte


_TABLE = bytes(_crc_of_byte(byte) for byte in range(256))


@cache
def data_id_list(data_id: int) -> bytes:
    """The 16 identity bytes of a message; its data id is its CAN identifier.

    The rule is this project's: the lists of two 11-bit identifiers agree in at most one place.
    """
    low, high = data_id & 0xFF, data_id >> 8
    return bytes((low + 17 * counter + high * (2 * counter + 1)) & 0xFF for counter in range(16))


def crc(data: bytes | bytearray, id_list: bytes) -> int:
    """CRC-8 (polynomial 0x2F, start and final XOR 0xFF) over bytes 1.. and the identity byte."""
    value = 0xFF
    for byte in data[1:]:
        value = _TABLE[value ^ byte]
    return _TABLE[value ^ id_list[data[1] & 0x0F]] ^ 0xFF


def protect(data: bytes, id_list: bytes, counter: int) -> bytes:
    """Return `data` (2 bytes or more) with `counter` (taken modulo 16) and CRC filled in."""
    frame = bytearray(data)
    frame[1] = frame[1] & 0xF0 | counter & 0x0F
    frame[0] = crc(frame, id_list)
    return bytes(frame)


def crc_ok(data: bytes, id_list: bytes) -> bool:
    """True where the CRC of a received frame fits; a frame without room for one does not."""
    return len(data) >= 2 and data[0] == crc(data, id_list)


def counter_of(data: bytes) -> int:
    """Counter of a protected frame, 0 to 15."""
    return data[1] & 0x0F
