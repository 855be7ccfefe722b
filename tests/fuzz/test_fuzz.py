"""A sample of `make fuzz`: what is on the bus or in the air never ends the program nor moves it."""

import pytest

from config import topics
from tests.fuzz.arena import Arena
from tests.fuzz.chunks import Kind, run_chunk
from tests.fuzz.session import run_session


@pytest.mark.parametrize(
    ("kind", "chunk", "count"),
    [
        ("frames", 0, 3000),
        ("frames", 1, 2000),
        ("frames", 5, 2000),
        ("payloads", 0, 800),
        ("payloads", 2, 800),
    ],
)
def test_a_robot_survives_dirt_and_can_be_used_again(kind: Kind, chunk: int, count: int) -> None:
    result = run_chunk(kind, 7, chunk, count)
    assert sum(result.by_state.values()) >= count
    assert result.not_recovered == []
    assert result.quiet_stops == []


def test_an_emergency_stop_that_cannot_be_read_is_one() -> None:
    arena = Arena("r2", 1)
    assert arena.reach("RUNNING")
    arena.attack_link([("estop", b"\xff{]")])
    assert arena.state == "ESTOP"
    arena.close()


def test_the_attacked_robot_is_the_real_one() -> None:
    """Quiet dirt reaches the robot's own port and link, or the test would attack nothing."""
    arena = Arena("r2", 1)
    arena.run_for(0.1)
    received = arena.lockstep.stations["r2"].port.health().received
    arena.attack_bus(200, quiet=True)
    assert arena.lockstep.stations["r2"].port.health().received > received + 100
    key = topics.MOTION.key(arena.lockstep.fleet.name, "r1")
    assert key in arena.session.subscribers
    arena.attack_link([("motion", b"x")])
    assert arena.counts["unreadable"] == 1
    arena.close()


@pytest.mark.process
def test_over_a_real_session_nothing_is_lost_in_silence() -> None:
    assert run_session(7, 100) == 100
