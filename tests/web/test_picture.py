"""The view model: what a page is shown, from made-up messages whose truth is known."""

import math

import msgspec
import pytest

from config.messages import Bearings, Event, Look, Observability, Particles
from config.topics import BEARINGS, EVENT, MOTION, OBSERVABILITY, POSE, RELATIVE, STATUS, TRUTH
from groundstation.web.history import LENGTH
from groundstation.web.picture import FleetPicture
from groundstation.web.wire import RobotDetail
from tests.groundstation.synthetic import (
    PERIOD_NS,
    WALL_NS,
    Place,
    fleet,
    motion,
    pose,
    relative,
    status,
    times,
    truth,
)

LEADER, FOLLOWER = Place(10.0, 5.0, 0.5), Place(9.0, 4.6, 0.4)
NOW_S = WALL_NS * 1e-9


def picture(prefix: str = "") -> FleetPicture:
    """r1 localised exactly; r2 sees it 0.1 m too far and 0.02 rad too far to the left."""
    made = FleetPicture(fleet(), prefix)
    for robot, place in (("r1", LEADER), ("r2", FOLLOWER)):
        made.hear(NOW_S, prefix + TRUTH.key("pair", robot), truth(robot, place, 0))
        made.hear(NOW_S, prefix + MOTION.key("pair", robot), motion(robot, "RUNNING", "", 0, 1.0))
        made.hear(NOW_S, prefix + STATUS.key("pair", robot), status(robot, "RUNNING", "", 0))
    made.hear(NOW_S, prefix + POSE.key("pair", "r1"), pose(LEADER, 0.0, 0))
    made.hear(NOW_S, prefix + RELATIVE.key("pair", "r2"), relative(FOLLOWER, LEADER, 0))
    return made


def details(made: FleetPicture, now_s: float) -> list[RobotDetail]:
    """What goes with the frames at this time."""
    return made.details(now_s, made.robots(now_s))


def test_robots_are_where_their_estimates_say_and_truth_is_apart() -> None:
    leader, follower = picture().robots(NOW_S)
    assert leader.pose == [10.0, 5.0, 0.5, 0.0]
    assert follower.truth == [9.0, 4.6, 0.4, 0.0]
    assert follower.pose is not None
    x_m, y_m, heading_rad, _ = follower.pose
    assert x_m is not None
    assert y_m is not None
    assert heading_rad == pytest.approx(0.4)
    off = math.hypot(x_m - 9.0, y_m - 4.6)
    range_m = math.hypot(1.0, 0.4)
    assert off == pytest.approx(math.hypot(0.1, (range_m + 0.1) * 0.02), rel=0.05)


def test_the_wanted_place_is_the_fleet_files() -> None:
    leader, follower = details(picture(), NOW_S)
    assert leader.offset is None
    assert follower.offset == [-1.0, 0.5]


def test_a_place_that_the_follower_has_moved_is_shown_where_it_is() -> None:
    made = picture()
    moved = msgspec.structs.replace(relative(FOLLOWER, LEADER, 1), place_x_m=-2.0, place_y_m=0.0)
    made.hear(NOW_S, RELATIVE.key("pair", "r2"), moved)
    assert details(made, NOW_S)[1].offset == [-2.0, 0.0]


def test_errors_and_speed_are_given_for_the_plots() -> None:
    values = details(picture(), NOW_S)[1].values
    assert values is not None
    wanted_range = math.hypot(1.0, 0.5)
    assert values[0] == pytest.approx(math.hypot(1.0, 0.4) + 0.1 - wanted_range, abs=1e-4)
    assert values[3] == 1.0


def test_the_row_tells_error_truth_age_and_health() -> None:
    row = picture().rows(NOW_S + 0.25, {"r2"})[1]
    assert row.state == "RUNNING"
    assert row.alive is True
    assert row.age_s == pytest.approx(0.25, abs=1e-4)
    assert row.loop_p99_ms == 2.0
    dx, dy = 9.0 - 10.0, 4.6 - 5.0
    cos, sin = math.cos(0.5), math.sin(0.5)
    error = math.hypot(cos * dx + sin * dy + 1.0, cos * dy - sin * dx - 0.5)
    assert row.true_error_m == pytest.approx(error, abs=1e-4)
    assert row.formation_error_m is not None
    assert abs(row.formation_error_m - error) < 0.11


def test_a_silent_robot_is_not_fresh_and_its_age_grows() -> None:
    made = picture()
    assert [robot.fresh for robot in made.robots(NOW_S + 0.4)] == [True, True]
    late = made.robots(NOW_S + 3.0)
    assert [robot.truth for robot in late] == [None, None]
    assert [robot.fresh for robot in late] == [False, False]
    assert details(made, NOW_S + 3.0)[0].values is None
    assert made.rows(NOW_S + 3.0, None)[0].age_s == pytest.approx(3.0)


def test_a_robot_that_was_never_heard_has_an_empty_row() -> None:
    empty = FleetPicture(fleet())
    assert empty.rows(NOW_S, set())[0].state == ""
    assert empty.robots(NOW_S)[0].pose is None


def test_an_older_message_does_not_replace_a_newer_one() -> None:
    made = picture()
    made.hear(NOW_S, POSE.key("pair", "r1"), pose(Place(99.0, 0.0, 0.0), 0.0, -1))
    assert made.robots(NOW_S)[0].pose == [10.0, 5.0, 0.5, 0.0]


def test_messages_of_other_fleets_and_robots_and_prefixes_are_left_out() -> None:
    made = FleetPicture(fleet(), "replay/")
    made.hear(NOW_S, POSE.key("pair", "r1"), pose(LEADER, 0.0, 0))
    made.hear(NOW_S, "replay/" + POSE.key("other", "r1"), pose(LEADER, 0.0, 0))
    made.hear(NOW_S, "something/else", pose(LEADER, 0.0, 0))
    assert made.robots(NOW_S)[0].pose is None


def test_keys_may_have_a_prefix() -> None:
    assert picture("replay/").robots(NOW_S)[0].pose == [10.0, 5.0, 0.5, 0.0]


def test_bearings_particles_and_observability_are_shown() -> None:
    made = picture()
    looks = Bearings(**times(0), robot="r1", looks=[Look(1, 0.25, 0.05)])
    made.hear(NOW_S, BEARINGS.key("pair", "r1"), looks)
    cloud = Particles(**times(0), robot="r1", x_m=[1.0, 2.0], y_m=[3.0, 4.0])
    made.hear(NOW_S, "echelon/pair/r1/particles", cloud)
    weak = Observability(
        **times(0),
        robot="r1",
        source="landmarks",
        weak=True,
        direction="heading about landmark 1",
        std_m=None,
        limit_m=5.0,
        weak_for_s=1.0,
        singular_value=0.0,
        landmarks=[1],
        transverse_mps=None,
    )
    made.hear(NOW_S, OBSERVABILITY.key("pair", "r1"), weak)
    assert details(made, NOW_S)[0].looks == [(1, 0.25)]
    assert made.particles() == [[(1.0, 3.0), (2.0, 4.0)], []]
    assert made.rows(NOW_S, None)[0].observability == weak


def test_events_are_kept_for_pages_that_open_later_and_told_once() -> None:
    made = picture()
    event = Event(**times(0), source="r1", severity="warning", text="weak geometry")
    made.hear(NOW_S, EVENT.key("pair", "r1"), event)
    assert [line.text for line in made.take_log()] == ["weak geometry"]
    assert made.take_log() == []
    assert [line.severity for line in made.log] == ["warning"]


def test_the_clock_offset_is_the_least_age_on_arrival() -> None:
    made = picture()
    for step, delay_s in ((1, 0.012), (2, 0.004), (3, 0.3)):
        at_s = NOW_S + step * PERIOD_NS * 1e-9
        made.hear(at_s + delay_s, STATUS.key("pair", "r1"), status("r1", "RUNNING", "", step))
    assert made.rows(NOW_S, None)[0].clock_offset_ms == pytest.approx(0.0, abs=0.01)
    ahead = FleetPicture(fleet())
    ahead.hear(NOW_S - 0.02, STATUS.key("pair", "r1"), status("r1", "RUNNING", "", 0))
    assert ahead.rows(NOW_S, None)[0].clock_offset_ms == pytest.approx(-20.0, abs=0.01)


def test_the_history_is_a_minute_at_ten_samples_a_second() -> None:
    made = picture()
    for frame in range(30 * 70):
        details(made, NOW_S + frame / 30)
    past = made.history.past()[1]
    assert len(past.t_s) == LENGTH
    steps = [after - before for before, after in zip(past.t_s, past.t_s[1:], strict=False)]
    assert max(steps) < 0.14
    assert len(past.trail) == len(past.values) == LENGTH
