"""Who is in command, and how an emergency stop is repeated until everybody has it."""

from groundstation.web.authority import ELSEWHERE_S, GRACE_S, Authority
from groundstation.web.estop_latch import EstopLatch


def test_the_first_to_command_is_in_command_and_the_second_is_told_by_whom() -> None:
    authority = Authority()
    assert authority.may_command(1, "Anna", 0.0) is None
    refusal = authority.may_command(2, "Ben", 1.0)
    assert refusal == "Anna is in command: take command first"
    holder = authority.holder(1.0)
    assert holder is not None
    assert (holder.page, holder.name) == (1, "Anna")


def test_command_can_be_taken_over_and_given_back() -> None:
    authority = Authority()
    authority.take(1, "Anna", 0.0)
    authority.take(2, "Ben", 5.0)
    assert authority.may_command(1, "Anna", 6.0) is not None
    authority.give_back(1)
    assert authority.holder(6.0) is not None
    authority.give_back(2)
    assert authority.holder(6.0) is None


def test_a_page_that_is_gone_keeps_command_for_a_while() -> None:
    authority = Authority()
    authority.take(1, "Anna", 0.0)
    authority.gone(1, 10.0)
    assert authority.may_command(2, "Ben", 10.0 + GRACE_S) is not None
    assert authority.may_command(2, "Ben", 10.1 + GRACE_S) is None


def test_an_operator_who_comes_back_in_time_still_has_command() -> None:
    authority = Authority()
    authority.take(1, "Anna", 0.0)
    authority.gone(1, 10.0)
    assert authority.back(3, "Ben") is None
    assert authority.back(4, "Anna") == 4
    assert authority.may_command(4, "Anna", 100.0) is None


def test_another_ground_station_takes_over_when_it_took_command_later() -> None:
    authority = Authority()
    authority.take(1, "Anna", 100.0)
    authority.heard("Cleo@tower", 50.0, 101.0)
    assert authority.may_command(1, "Anna", 101.0) is None
    authority.heard("Cleo@tower", 102.0, 102.0)
    assert authority.may_command(1, "Anna", 102.0) == "Cleo@tower is in command: take command first"


def test_command_elsewhere_ends_when_it_is_given_back_or_falls_silent() -> None:
    authority = Authority()
    authority.heard("Cleo@tower", 1.0, 1.0)
    authority.heard("", 0.0, 2.0)
    assert authority.holder(2.0) is None
    authority.heard("Cleo@tower", 3.0, 3.0)
    assert authority.holder(3.0 + ELSEWHERE_S) is not None
    assert authority.holder(3.1 + ELSEWHERE_S) is None


def test_an_emergency_stop_is_repeated_until_every_robot_has_confirmed_it() -> None:
    latch, states = EstopLatch(["r1", "r2"]), {"r1": "RUNNING", "r2": "RUNNING"}
    latch.press("Anna", 7.0)
    latch.look(states.__getitem__)
    assert (latch.repeating, latch.confirmed, latch.missing) == (True, [], ["r1", "r2"])
    states["r1"] = "ESTOP"
    latch.look(states.__getitem__)
    assert (latch.repeating, latch.confirmed, latch.missing) == (True, ["r1"], ["r2"])
    states["r2"] = "ESTOP"
    latch.look(states.__getitem__)
    assert (latch.active, latch.repeating, latch.missing) == (True, False, [])


def test_a_robot_that_is_never_heard_keeps_it_going_until_it_is_withdrawn() -> None:
    latch = EstopLatch(["r1", "r2"])
    latch.press("Anna", 7.0)
    for _ in range(1000):
        latch.look(lambda name: "ESTOP" if name == "r1" else "")
    assert (latch.repeating, latch.missing) == (True, ["r2"])
    latch.withdraw()
    assert (latch.active, latch.repeating) == (False, False)


def test_it_stays_latched_until_a_robot_was_reset_after_all_had_it() -> None:
    latch, states = EstopLatch(["r1", "r2"]), {"r1": "ESTOP", "r2": "RUNNING"}
    latch.press("Anna", 7.0)
    latch.look(states.__getitem__)
    states["r1"] = "STANDBY"
    latch.look(states.__getitem__)
    assert latch.repeating, "r2 has not confirmed it yet"
    states["r2"] = "ESTOP"
    latch.look(states.__getitem__)
    assert not latch.active


def test_pressing_again_asks_every_robot_anew() -> None:
    latch = EstopLatch(["r1"])
    latch.press("Anna", 7.0)
    latch.look(lambda _: "ESTOP")
    latch.press("Ben", 8.0)
    assert (latch.repeating, latch.by, latch.missing) == (True, "Anna", ["r1"])
