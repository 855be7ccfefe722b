"""What the leader saw of a follower is used once, whenever its message comes."""

from config.messages import Motion, Sighting
from onboard.sightings import SightingBox

WALL_OFFSET_NS = 1_000_000_000_000


def message(t_ms: int, *taken_ms: int, target: str = "r2") -> Motion:
    return Motion(
        seq=0,
        t_ns=t_ms * 1_000_000,
        wall_ns=t_ms * 1_000_000 + WALL_OFFSET_NS,
        robot="r1",
        state="RUNNING",
        reason="",
        mission_time_s=0.0,
        speed_mps=1.0,
        steering_rad=0.0,
        sightings=[Sighting(target, 21, 0.1, 0.05, taken * 1_000_000) for taken in taken_ms],
    )


def taken(box: SightingBox, now_ms: int) -> list[tuple[int, int]]:
    """Capture times and ages [ms]."""
    wall_s = (now_ms * 1_000_000 + WALL_OFFSET_NS) * 1e-9
    return [
        (each.sighting.t_ns // 1_000_000, round(each.age_s * 1000)) for each in box.take(wall_s)
    ]


def test_messages_that_come_together_or_overtake_each_other_lose_no_bearing() -> None:
    box = SightingBox("r2")
    box.put(message(1030, 1020))
    box.put(message(1010, 1000))
    assert taken(box, 1040) == [(1000, 40), (1020, 20)]
    box.put(message(1020, 1010))
    assert taken(box, 1050) == [(1010, 40)]


def test_a_repeated_bearing_is_used_once() -> None:
    box = SightingBox("r2")
    box.put(message(1010, 1000))
    assert len(taken(box, 1020)) == 1
    box.put(message(1010, 1000))
    box.put(message(1020, 1000, 1010))
    assert taken(box, 1030) == [(1010, 20)]


def test_bearings_to_others_and_those_from_long_ago_are_left_out() -> None:
    box = SightingBox("r2")
    box.put(message(1010, 1000, target="r3"))
    box.put(message(1020, 300))
    assert taken(box, 1030) == []


def test_a_bearing_from_a_clock_slightly_ahead_has_age_zero() -> None:
    box = SightingBox("r2")
    box.put(message(1010, 1010))
    assert taken(box, 1005) == [(1010, 0)]
