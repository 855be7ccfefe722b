"""What a follower believes of its leader: nothing impossible, or from the future; no lock-out."""

from typing import Any

import pytest

from config.messages import Command, Motion, Sighting, Unreadable, decode
from onboard.follower import Follower
from onboard.leader_messages import RESTART_S, NewestFirst, implausible, usable
from onboard.role import Stamp
from tests.soak.fleet import circling

WALL_S = 1e9


def motion(t_s: float, **changes: Any) -> Motion:
    fields: dict[str, Any] = {
        "seq": 1,
        "t_ns": round(t_s * 1e9),
        "wall_ns": round((WALL_S + t_s) * 1e9),
        "robot": "r1",
        "state": "RUNNING",
        "reason": "",
        "mission_time_s": 1.0,
        "speed_mps": 1.0,
        "steering_rad": 0.0,
        "sightings": [],
    }
    return Motion(**(fields | changes))


def problem(heard: Motion, at_s: float) -> str | None:
    follower, at = Follower(circling(), "r2"), Stamp(at_s, WALL_S + at_s)
    follower.hear(at, heard)
    seen = follower.leader_seen(at)
    assert seen is not None
    return seen.problem


def test_an_honest_message_is_believed() -> None:
    assert problem(motion(10.0), 10.05) is None
    assert problem(motion(10.15), 10.0) is None, "clocks may differ by as much as silence may last"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"speed_mps": 1e308}, "claims to drive at 1e+308 m/s, limit 100 m/s"),
        ({"speed_mps": -100.1}, "claims to drive at -100 m/s, limit 100 m/s"),
        ({"steering_rad": 3.2}, "claims to steer by 3.2 rad, limit 3.14 rad"),
        ({"wall_ns": round((WALL_S + 10.25) * 1e9)}, "0.25 s ahead of this clock, limit 0.20 s"),
        ({"valid": False, "reason": "no drive"}, "does not know its own motion (no drive)"),
    ],
)
def test_what_cannot_be_is_named_with_its_limit(changes: dict[str, Any], sentence: str) -> None:
    assert sentence in str(problem(motion(10.0, **changes), 10.0))


def test_a_clock_that_has_begun_anew_is_heard_again_after_a_second() -> None:
    order = NewestFirst()
    assert order.is_news(2**63, 1.0)
    assert not order.is_news(100, 1.0 + 0.99 * RESTART_S)
    assert order.is_news(100, 1.0 + RESTART_S)
    assert not order.is_news(100, 1.01 + RESTART_S)
    assert order.is_news(101, 1.02 + RESTART_S)


@pytest.mark.parametrize(
    ("bearing_rad", "std_rad", "good"),
    [(3.0, 0.05, True), (1e9, 0.05, False), (0.0, 0.0, False), (0.0, -1.0, False), (0, 1e9, False)],
)
def test_a_bearing_needs_a_turn_and_a_deviation(
    bearing_rad: float, std_rad: float, good: bool
) -> None:
    assert usable(Sighting("r2", 21, bearing_rad, std_rad, 0)) is good


def test_the_edge_of_the_possible_is_possible() -> None:
    assert implausible(motion(1.0, speed_mps=100.0, steering_rad=3.14)) is None


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\xff\xfe",
        b'{"name":"\xff","operator":"x"}',
        b'{"x":' + b"[" * 100_000 + b"]" * 100_000 + b',"name":"arm","operator":"x"}',
        b'{"name":7,"operator":"x"}',
        b'{"name":"arm","operator":"x","override":[1e999]}',
    ],
    ids=["empty", "no text", "bad UTF-8", "nested", "wrong type", "beyond numbers"],
)
def test_whatever_the_bytes_are_there_is_one_kind_of_refusal(payload: bytes) -> None:
    with pytest.raises(Unreadable):
        decode(payload, Command)
