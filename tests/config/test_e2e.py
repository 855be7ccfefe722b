"""End-to-end protection against the autosar-e2e package and known frames."""

import random
from itertools import combinations

import pytest
from e2e import p02
from hypothesis import given
from hypothesis import strategies as st

from config.can.database import CanDatabase
from config.can.e2e import counter_of, crc_ok, data_id_list, protect
from config.can.vehicle import TargetClass

can_ids = st.integers(0, 0x7FF)
payloads = st.binary(min_size=2, max_size=8)
counters = st.integers(0, 15)


@given(can_ids, payloads, counters)
def test_protects_as_autosar_does(can_id: int, data: bytes, counter: int) -> None:
    expected = bytearray(data)
    expected[1] = expected[1] & 0xF0 | counter
    p02.e2e_p02_protect(expected, data_id_list(can_id), increment_counter=False)
    assert protect(data, data_id_list(can_id), counter) == expected


@given(can_ids, payloads)
def test_judges_as_autosar_does(can_id: int, data: bytes) -> None:
    id_list = data_id_list(can_id)
    assert crc_ok(data, id_list) == p02.e2e_p02_check(data, id_list, length=len(data))


@given(can_ids, payloads, st.integers(0, 1000))
def test_a_protected_frame_passes_and_counts_modulo_16(
    can_id: int, data: bytes, counter: int
) -> None:
    protected = protect(data, data_id_list(can_id), counter)
    assert crc_ok(protected, data_id_list(can_id))
    assert counter_of(protected) == counter % 16
    assert protected[1] & 0xF0 == data[1] & 0xF0
    assert protected[2:] == data[2:]


@given(can_ids, payloads, counters)
def test_any_one_or_two_wrong_bits_are_caught(can_id: int, data: bytes, counter: int) -> None:
    """Within one identity byte: a flip in the counter also changes that byte."""
    id_list = bytes(16 * [data_id_list(can_id)[0]])
    protected = protect(data, id_list, counter)
    bits = [1 << bit for bit in range(8 * len(protected))]
    number = int.from_bytes(protected, "little")
    for flipped in [*bits, *(one | other for one, other in combinations(bits, 2))]:
        assert not crc_ok((number ^ flipped).to_bytes(len(protected), "little"), id_list)


def test_any_single_wrong_bit_is_caught_under_every_identifier() -> None:
    rng = random.Random(1)
    for can_id in range(0x800):
        id_list = data_id_list(can_id)
        protected = protect(rng.randbytes(8), id_list, rng.randrange(16))
        number = int.from_bytes(protected, "little")
        for bit in range(64):
            assert not crc_ok((number ^ 1 << bit).to_bytes(8, "little"), id_list)


def test_identity_lists_of_two_identifiers_agree_in_at_most_one_place() -> None:
    rng = random.Random(2)
    for _ in range(20_000):
        one, other = rng.sample(range(0x800), 2)
        pairs = zip(data_id_list(one), data_id_list(other), strict=True)
        assert sum(a == b for a, b in pairs) <= 1


def test_makes_the_known_bearing_frames() -> None:
    sensor = CanDatabase.load().bearing_sensor(0)
    target = sensor.target.pack(2, 77, 13, TargetClass.ROBOT, 12, -0.7854, 0.004)
    frame = sensor.frame.pack(1, 77, 3, 0, 1, 1, 41.7, 1234.5)
    assert protect(target, data_id_list(0x121), 5).hex(" ") == "e0 25 4d 0d c4 52 e1 08"
    assert protect(frame, data_id_list(0x120), 9).hex(" ") == "73 19 4d c3 a1 01 39 30"


@pytest.mark.parametrize("data", [b"", b"\x00"])
def test_a_frame_without_room_for_the_crc_is_bad(data: bytes) -> None:
    assert not crc_ok(data, data_id_list(0x120))
