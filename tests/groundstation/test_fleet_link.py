"""The ground station hears robots on the network, commands them and stops them."""

import time
from collections.abc import Callable

import pytest
import zenoh

from config.fleet import Fleet
from config.messages import encode
from config.topics import STATUS, TRUTH
from config.zenoh_settings import session_config
from groundstation import fleet_commands, fleet_link
from groundstation.endpoints import with_real_port
from groundstation.errors import GroundError
from groundstation.fleet_link import ANY_LOOPBACK, FleetLink
from groundstation.heard import Heard
from tests.groundstation.fake_robot import FakeRobot, robots
from tests.groundstation.synthetic import Place, fleet, status, truth


@pytest.fixture
def pair() -> Fleet:
    return fleet(ground=with_real_port(ANY_LOOPBACK))


def _silent(pair: Fleet) -> Fleet:
    """The fleet with a fixed endpoint for r1, so that no ground station is needed."""
    r1 = pair.robots["r1"].model_copy(update={"listen": with_real_port(ANY_LOOPBACK)})
    return pair.model_copy(update={"robots": pair.robots | {"r1": r1}})


def test_the_ground_station_hears_every_robot_and_its_token(pair: Fleet) -> None:
    with (
        FleetLink.as_ground_station(pair) as link,
        robots(FakeRobot(pair, "r1"), FakeRobot(pair, "r2")),
    ):
        assert link.wait_until(
            lambda: (link.view.state("r1"), link.view.state("r2")) == ("STANDBY", "STANDBY"), 5
        )
        assert link.wait_until(lambda: "ground" in link.view.alive, 5)


def _put(peer: zenoh.Session, key: str, payload: bytes, link: FleetLink) -> bool:
    """Publish until the link, once connected, has found one that it cannot read."""
    peer.put(key, payload)
    return bool(link.unreadable)


def _next_message(link: FleetLink) -> Heard:
    deadline = time.monotonic() + 5
    while not (heard := link.poll()):
        assert time.monotonic() < deadline, "no message within 5 s"
        time.sleep(0.005)
    return heard[0]


def test_messages_arrive_verbatim_and_unreadable_ones_are_named(pair: Fleet) -> None:
    payload = encode(status("r1", "ARMED", "", 3))
    with FleetLink.as_ground_station(pair) as link:
        config = zenoh.Config.from_json5(session_config(ANY_LOOPBACK, [pair.ground]))
        with zenoh.open(config) as peer:
            key = STATUS.key("pair", "r1")
            assert link.wait_until(lambda: _put(peer, key, b"{broken", link), 5)
            peer.put(key, payload)
            assert link.wait_until(lambda: link.view.status("r1") is not None, 5)
            peer.put(key, payload)
            heard = _next_message(link)
    assert heard.key == "echelon/pair/r1/status"
    assert heard.payload == payload
    assert "echelon/pair/r1/status cannot be read" in link.unreadable[0]


def test_who_watches_gets_the_newest_message_and_of_followed_topics_only(pair: Fleet) -> None:
    with FleetLink.as_ground_station(pair, [STATUS], newest=True) as link:
        config = zenoh.Config.from_json5(session_config(ANY_LOOPBACK, [pair.ground]))
        with zenoh.open(config) as peer:

            def publish(step: int) -> None:
                place = encode(truth("r1", Place(1.0, 2.0, 0.5), step))
                peer.put(TRUTH.key("pair", "r1"), place)
                peer.put(STATUS.key("pair", "r1"), encode(status("r1", "ARMED", "", step)))

            def heard_status(step: int) -> bool:
                publish(step)
                return link.view.status("r1") is not None

            assert link.wait_until(lambda: heard_status(0), 5)
            for step in range(1, 50):
                publish(step)
            assert link.wait_until(lambda: _status_seq(link) == 49, 5)
            assert link.poll() == []
            link.follow(TRUTH)
            link.follow(TRUTH)
            both = {TRUTH.key("pair", "r1"), STATUS.key("pair", "r1")}
            assert _topics_heard(link, lambda: publish(50), both) == both
            link.leave(TRUTH)
            link.poll()
            publish(51)
            assert link.wait_until(lambda: _status_seq(link) == 51, 5)
            publish(52)
            assert _topics_heard(link, lambda: None, {STATUS.key("pair", "r1")}) == {
                STATUS.key("pair", "r1")
            }


def _status_seq(link: FleetLink) -> int | None:
    known = link.view.status("r1")
    return None if known is None else known.seq


def _topics_heard(link: FleetLink, act: Callable[[], None], wanted: set[str]) -> set[str]:
    """Keys that are heard, acting again and again until all that are wanted are among them."""
    deadline, found = time.monotonic() + 5, set[str]()
    while not wanted <= found:
        assert time.monotonic() < deadline, f"only {found} within 5 s"
        act()
        found |= {heard.key for heard in link.poll()}
        time.sleep(0.005)
    return found


def test_an_endpoint_in_use_is_named_with_a_way_out(pair: Fleet) -> None:
    with (
        FleetLink.as_ground_station(pair),
        pytest.raises(GroundError, match="Address already in use") as refusal,
    ):
        FleetLink.as_ground_station(pair)
    assert pair.ground in str(refusal.value)
    assert "--ground tcp/127.0.0.1:0" in str(refusal.value)


def test_a_visitor_reaches_robots_through_the_ground_station(pair: Fleet) -> None:
    r1, r2 = FakeRobot(pair, "r1"), FakeRobot(pair, "r2")
    with FleetLink.as_ground_station(pair), robots(r1, r2):
        report = fleet_commands.command(pair, "arm")
    assert report.ok
    assert (r1.state, r2.state) == ("ARMED", "ARMED")


def test_a_visitor_reaches_a_robot_with_a_fixed_endpoint_without_ground_station(
    pair: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_commands, "DISCOVERY_S", 0.5)
    fixed = _silent(pair)
    with robots(FakeRobot(fixed, "r1")):
        report = fleet_commands.status(fixed)
    assert report.robots["r1"].state == "STANDBY"
    assert report.robots["r2"].state is None
    assert not report.ok


def test_the_leader_is_not_started_when_a_follower_refuses(pair: Fleet) -> None:
    r1, r2 = FakeRobot(pair, "r1"), FakeRobot(pair, "r2", refuses="start")
    with FleetLink.as_ground_station(pair), robots(r1, r2):
        report = fleet_commands.command(pair, "start")
    assert not report.ok
    assert r1.commands == []
    assert report.robots["r2"].reason == "drive not calibrated"
    assert "r2 did not start" in report.robots["r1"].reason


def test_a_robot_that_does_not_answer_counts_as_refusing(
    pair: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_commands, "DISCOVERY_S", 0.5)
    monkeypatch.setattr(fleet_link, "REPLY_TIMEOUT_S", 0.3)
    with FleetLink.as_ground_station(pair), robots(FakeRobot(pair, "r1")):
        report = fleet_commands.command(pair, "stop")
    assert report.robots["r1"].accepted
    assert not report.robots["r2"].accepted
    assert "no answer" in report.robots["r2"].reason


def test_an_emergency_stop_reports_who_has_stopped_and_who_has_not(
    pair: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_commands, "ESTOP_LIMIT_S", 1.0)
    r1, r2 = FakeRobot(pair, "r1"), FakeRobot(pair, "r2", deaf=True)
    with FleetLink.as_ground_station(pair), robots(r1, r2):
        report = fleet_commands.estop(pair)
    assert not report.ok
    assert report.robots["r1"].accepted
    assert report.robots["r2"].reason == "still STANDBY after 1 s: stop it by hand"


def test_an_emergency_stop_ends_as_soon_as_every_robot_has_it(pair: Fleet) -> None:
    with (
        FleetLink.as_ground_station(pair) as link,
        robots(FakeRobot(pair, "r1"), FakeRobot(pair, "r2")),
    ):
        assert link.estop(10.0) == {"r1": True, "r2": True}


def test_a_fleet_that_is_not_there_is_named(pair: Fleet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_commands, "DISCOVERY_S", 0.2)
    with pytest.raises(GroundError, match="no robot of fleet pair is heard") as refusal:
        fleet_commands.status(pair)
    assert pair.ground in str(refusal.value)
