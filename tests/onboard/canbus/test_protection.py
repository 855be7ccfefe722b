"""End-to-end protection: every way in which a frame can be wrong has its name."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.canbus.protection import Protector, Receiver, Reception
from tests.onboard.canbus.fakes import signed

CAN_ID = 0x121
TARGET_VECTOR = bytes.fromhex("e0254d0dc452e108")


def frame(counter: int, can_id: int = CAN_ID) -> bytes:
    return signed(can_id, bytes(7), counter % 16)


def judged(counters: list[int]) -> list[Reception]:
    receiver = Receiver(CAN_ID, 8)
    return [receiver.check(frame(counter)) for counter in counters]


def trusted_receiver() -> Receiver:
    receiver = Receiver(CAN_ID, 8)
    for counter in range(3):
        receiver.check(frame(counter))
    assert receiver.valid
    return receiver


def test_the_documented_frame_is_accepted() -> None:
    assert Receiver(CAN_ID, 8).check(TARGET_VECTOR) is Reception.INITIAL


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (0, Reception.REPEATED),
        (1, Reception.OK),
        (2, Reception.OK_SOME_LOST),
        (3, Reception.OK_SOME_LOST),
        (4, Reception.WRONG_SEQUENCE),
        (15, Reception.WRONG_SEQUENCE),
    ],
)
def test_the_step_of_the_counter_decides(step: int, expected: Reception) -> None:
    assert judged([14, 14 + step]) == [Reception.INITIAL, expected]


def test_lost_frames_are_counted() -> None:
    receiver = Receiver(CAN_ID, 8)
    for counter in (0, 3, 4, 6):
        receiver.check(frame(counter))
    assert receiver.lost == 3
    assert receiver.counts[Reception.OK_SOME_LOST] == 2


@given(bit=st.integers(0, 63))
def test_any_flipped_bit_is_noticed(bit: int) -> None:
    wrong = (int.from_bytes(TARGET_VECTOR, "little") ^ 1 << bit).to_bytes(8, "little")
    assert Receiver(CAN_ID, 8).check(wrong) is Reception.WRONG_CRC


@pytest.mark.parametrize("data", [b"", b"\x00", TARGET_VECTOR[:7], TARGET_VECTOR + b"\x00"])
def test_a_wrong_length_counts_as_a_wrong_crc(data: bytes) -> None:
    assert Receiver(CAN_ID, 8).check(data) is Reception.WRONG_CRC


def test_a_frame_of_another_message_is_noticed_within_two() -> None:
    receiver = Receiver(CAN_ID, 8)
    receptions = [receiver.check(frame(counter, can_id=0x141)) for counter in range(2)]
    assert Reception.WRONG_CRC in receptions


def test_trust_begins_with_two_good_frames_after_the_first() -> None:
    receiver = Receiver(CAN_ID, 8)
    assert [receiver.accept(frame(counter)) for counter in range(4)] == [False, False, True, True]


def test_two_bad_frames_keep_trust_and_the_third_ends_it() -> None:
    receiver = trusted_receiver()
    assert not receiver.accept(frame(2))
    assert not receiver.accept(frame(2))
    assert receiver.valid
    receiver.check(frame(2))
    assert not receiver.valid


def test_trust_returns_after_two_good_frames() -> None:
    receiver = trusted_receiver()
    for _ in range(3):
        receiver.check(bytes(8))
    assert [receiver.accept(frame(counter)) for counter in (3, 4, 5)] == [False, True, True]


def test_good_frames_between_bad_ones_keep_trust() -> None:
    receiver = trusted_receiver()
    for counter in range(3, 10):
        receiver.check(bytes(8))
        receiver.check(bytes(8))
        assert receiver.accept(frame(counter))


def test_the_protector_counts_through_and_signs_as_documented() -> None:
    protector = Protector(CAN_ID)
    sent = [protector.protect(bytes.fromhex("00204d0dc452e108")) for _ in range(17)]
    assert sent[5] == TARGET_VECTOR
    assert [data[1] & 0x0F for data in sent] == [*range(16), 0]
