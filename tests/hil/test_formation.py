"""The formation on emulated hardware, frame by frame, in virtual time. Judged against truth."""

import pytest

from groundstation.lockstep import run_lockstep
from tests.acceptance import Law, judge
from tests.hil.fleets import straight


@pytest.mark.parametrize(
    ("fleet", "law", "seed"),
    [
        ("paper", "leader_frame", 3),
        ("paper", "leader_frame", 4),
        ("paper", "polar", 3),
        ("demo", "leader_frame", 3),
        ("demo", "polar", 4),
        ("hardware", "leader_frame", 3),
    ],
)
def test_shipped_fleets_hold_their_formation(fleet: str, law: Law, seed: int) -> None:
    row = judge(fleet, law, seed)
    assert row.problems == []


def test_the_same_seed_gives_the_same_messages_to_the_byte() -> None:
    runs = [_messages(seed) for seed in (7, 7, 8)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def _messages(seed: int) -> list[tuple[str, bytes, int]]:
    messages: list[tuple[str, bytes, int]] = []
    run_lockstep(
        straight("paper", 1.0), seed, lambda key, body, t_ns: messages.append((key, body, t_ns))
    )
    assert len(messages) > 1000
    return messages
