"""The server as pages and Foxglove see it, over real sockets, with a fleet made of paper."""

import json
import struct
import time
from collections.abc import Iterator
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from config.messages import Event, InCommand, encode
from config.topics import EVENT, IN_COMMAND, MOTION, POSE, WATCHED
from groundstation.errors import GroundError
from groundstation.web.server import Listen, PageServer
from tests.groundstation.synthetic import Place, fleet, motion, pose, times
from tests.processes.running import wait_for
from tests.web.fakes import LIMIT_S, FakeCommands, FakePlayback, FakeSource, opened

pytestmark = pytest.mark.process

ANY = Listen(port=0)
PAIR = fleet()


@pytest.fixture
def source() -> FakeSource:
    return FakeSource()


@pytest.fixture
def commands() -> FakeCommands:
    return FakeCommands(PAIR)


@pytest.fixture
def server(source: FakeSource, commands: FakeCommands) -> Iterator[PageServer]:
    with PageServer(PAIR, source, commands, listen=ANY) as made:
        yield made


def states(source: FakeSource, **state: str) -> None:
    """Robots say in which state they are."""
    for name, each in state.items():
        source.give(MOTION.key("pair", name), motion(name, each, "", 0, None))


def test_the_page_and_its_policy_are_served(server: PageServer) -> None:
    with urlopen(server.url, timeout=LIMIT_S) as answer:
        assert b"<title>Echelon</title>" in answer.read()
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]


def test_a_new_page_is_told_the_fleet_and_then_what_moves(
    server: PageServer, source: FakeSource
) -> None:
    source.give(POSE.key("pair", "r1"), pose(Place(1.0, 2.0, 0.5), 0.0, 0))
    with opened(server) as page:
        hello = page.next("hello")
        assert hello["fleet"] == "pair"
        assert hello["formations"] == ["default"]
        frame = page.next("frame")
        assert frame["robots"][0]["pose"][:3] == [1.0, 2.0, 0.5]
        assert page.next("control")["enabled"] is True


def test_a_port_in_use_is_named_and_can_be_evaded(server: PageServer) -> None:
    with pytest.raises(GroundError, match=r"in use.*--port"):
        PageServer(PAIR, FakeSource(), listen=Listen(port=server.port))
    evading = Listen(port=server.port, or_any_port=True)
    with PageServer(PAIR, FakeSource(), listen=evading) as other:
        assert other.port != server.port


def test_orders_reach_the_robots_in_the_operators_name(
    server: PageServer, commands: FakeCommands
) -> None:
    with opened(server, name="Anna") as page:
        page.say("order", id=1, name="formation", formation="wide")
        answer = page.next("answer", id=1)
    assert answer["text"] == "accepted by all 2 robots"
    assert [(o.name, o.operator, o.formation) for o in commands.orders] == [
        ("formation", "Anna", "wide")
    ]


def test_an_operator_may_give_name_and_token_later(
    source: FakeSource, commands: FakeCommands
) -> None:
    listen = Listen(port=0, token="of my own")
    with PageServer(PAIR, source, commands, listen=listen) as server, opened(server) as page:
        assert page.next("control")["authorised"] is False
        page.say("introduce", name="Anna", token="of my own")
        assert page.next("control", you="Anna")["authorised"] is True
        page.say("order", id=1, name="arm")
        page.next("answer", id=1)
    assert [order.operator for order in commands.orders] == ["Anna"]


def test_a_robot_that_refuses_is_named_with_its_reason(source: FakeSource) -> None:
    refusing = FakeCommands(PAIR, refuses="r2")
    with (
        PageServer(PAIR, source, refusing, listen=ANY) as server,
        opened(server) as page,
    ):
        page.say("order", id=4, name="arm")
        answer = page.next("answer", id=4)
    assert answer["accepted"] is False
    assert answer["text"] == "r2 refuses: drive not calibrated"


def test_the_second_operator_sees_who_commands_and_may_only_stop_or_take_over(
    server: PageServer, commands: FakeCommands
) -> None:
    with opened(server, name="Anna") as anna, opened(server, name="Ben") as ben:
        anna.say("order", id=1, name="arm")
        anna.next("answer", id=1)
        told = ben.next("control", viewers=2)
        while told["commander"] is None:
            told = ben.next("control")
        assert told["commander"]["name"] == "Anna"
        assert told["commander"]["you"] is False
        ben.say("order", id=1, name="start")
        refusal = ben.next("answer", id=1)
        assert refusal["text"] == "Anna is in command: take command first"
        ben.say("order", id=2, name="stop")
        assert ben.next("answer", id=2)["accepted"] is True
        ben.say("take_command")
        ben.say("order", id=3, name="start")
        assert ben.next("answer", id=3)["accepted"] is True
    assert [(o.name, o.operator) for o in commands.orders] == [
        ("arm", "Anna"),
        ("stop", "Ben"),
        ("start", "Ben"),
    ]


def test_command_at_another_ground_station_is_seen(server: PageServer, source: FakeSource) -> None:
    with opened(server, name="Anna") as anna:
        anna.next("control")
        since_ns = time.time_ns()
        word = InCommand(**times(0), operator="Cleo@tower", since_ns=since_ns)
        source.give(IN_COMMAND.key("pair"), word)
        told = anna.next("control")
        while told["commander"] is None:
            told = anna.next("control")
        assert told["commander"]["elsewhere"] is True
        anna.say("order", id=1, name="arm")
        assert "Cleo@tower is in command" in anna.next("answer", id=1)["text"]


def test_an_emergency_stop_is_repeated_until_all_have_it_and_shows_who_has(
    server: PageServer, source: FakeSource, commands: FakeCommands
) -> None:
    with opened(server, name="Anna") as page:
        page.next("hello")
        states(source, r1="RUNNING", r2="RUNNING")
        page.say("estop")
        wait_for(lambda: len(commands.estops) > 5)
        states(source, r1="ESTOP")
        told = page.next("control")
        while told["estop"] is None or told["estop"]["confirmed"] != ["r1"]:
            told = page.next("control")
        assert told["estop"]["missing"] == ["r2"]
        before = len(commands.estops)
        wait_for(lambda: len(commands.estops) > before + 3)
        states(source, r2="ESTOP")
        while told["estop"]["repeating"]:
            told = page.next("control")
        assert told["estop"]["missing"] == []
    assert set(commands.estops) == {"Anna"}


def test_a_slow_page_gets_the_newest_frame_and_no_queue(
    server: PageServer, source: FakeSource
) -> None:
    """A page that does not draw is sent 8 frames; when it goes on, it sees the present."""
    with opened(server) as page, opened(server) as quick:
        page.next("hello")
        started = quick.next("frame")["n"]
        while quick.next("frame")["n"] < started + 60:
            pass
        waiting = []
        while True:
            try:
                messages = json.loads(page.socket.recv(0.2))
            except TimeoutError:
                break
            waiting += [message["n"] for message in messages if message["kind"] == "frame"]
        assert len(waiting) <= 8
        page.say("got", n=waiting[-1])
        assert page.next("frame")["n"] >= started + 60


def test_a_page_of_another_web_site_is_refused(server: PageServer) -> None:
    url = f"ws://127.0.0.1:{server.port}/ws"
    with pytest.raises(InvalidStatus, match="403"):
        connect(url, additional_headers={"Origin": "http://evil.example"})
    rebound = Request(server.url, headers={"Host": "evil.example"})
    with pytest.raises(HTTPError, match="403"):
        urlopen(rebound, timeout=LIMIT_S)


def test_messages_that_make_no_sense_change_nothing(
    server: PageServer, commands: FakeCommands
) -> None:
    with opened(server) as page:
        for nonsense in ("{", "[]", '{"do": "fly"}', '{"do": "order"}', "\x00"):
            page.socket.send(nonsense)
        page.say("order", id=1, name="fly")
        assert page.next("answer", id=1)["accepted"] is False
        assert page.next("frame")
    assert commands.orders == []


def test_beyond_loopback_commands_need_the_token_and_an_emergency_stop_does_not(
    source: FakeSource, commands: FakeCommands
) -> None:
    with PageServer(PAIR, source, commands, listen=Listen("0.0.0.0", 0)) as server:
        token = server.url.partition("#token=")[2]
        assert len(token) >= 16
        with opened(server, token="guessed") as stranger:
            assert stranger.next("control")["authorised"] is False
            stranger.say("order", id=1, name="stop")
            assert "no token" in stranger.next("answer", id=1)["text"]
            stranger.say("take_command")
            assert commands.orders == []
            stranger.say("estop")
            wait_for(lambda: bool(commands.estops))
        with opened(server, token=token) as operator:
            operator.say("order", id=1, name="arm")
            assert operator.next("answer", id=1)["accepted"] is True


def test_a_recording_is_played_and_cannot_be_commanded(source: FakeSource) -> None:
    playback = FakePlayback()
    with (
        PageServer(PAIR, source, playback=playback, listen=ANY, prefix="replay/") as server,
        opened(server) as page,
    ):
        assert page.next("hello")["live"] is False
        source.give("replay/" + POSE.key("pair", "r1"), pose(Place(1.0, 2.0, 0.5), 0.0, 0))
        frame = page.next("frame")
        while "pose" not in frame["robots"][0]:
            frame = page.next("frame")
        assert frame["playback"]["position_s"] == 12.0
        page.say("order", id=1, name="arm")
        page.say("estop")
        page.say("play", action="play")
        page.say("play", action="seek", value=99.0)
        page.say("play", action="speed", value=50.0)
        wait_for(lambda: len(playback.done) == 3)
        assert playback.done == [("play", 0.0), ("seek", 60.0), ("speed", 10.0)]
        source.epoch = 1
        assert page.next("hello")["past"] is not None
        frame = page.next("frame")
        assert "pose" not in frame["robots"][0]


def test_events_reach_every_page_in_order(server: PageServer, source: FakeSource) -> None:
    with opened(server) as page:
        page.next("hello")
        for number in range(50):
            event = Event(**times(number), source="r1", severity="info", text=f"event {number}")
            source.give(EVENT.key("pair", "r1"), event)
        heard: list[str] = []
        while len(heard) < 50:
            heard += [line["text"] for line in page.next("log")["lines"]]
    assert heard == [f"event {number}" for number in range(50)]


def test_foxglove_is_offered_every_topic_and_gets_the_bytes_on_the_wire(
    server: PageServer, source: FakeSource
) -> None:
    url = f"ws://127.0.0.1:{server.port}/foxglove"
    with connect(url, subprotocols=[Subprotocol("foxglove.websocket.v1")]) as viewer:
        assert json.loads(viewer.recv(LIMIT_S))["op"] == "serverInfo"
        advertised = json.loads(viewer.recv(LIMIT_S))
        channels = {each["topic"]: each for each in advertised["channels"]}
        for topic in WATCHED:
            assert topic.key("pair", "r1") in channels
        for channel in channels.values():
            schema = json.loads(channel["schema"])
            assert schema["type"] == "object"
            assert "$ref" not in channel["schema"]
            assert channel["encoding"] == "json"
            assert channel["schemaEncoding"] == "jsonschema"
        wanted = channels[POSE.key("pair", "r1")]["id"]
        subscription = {"op": "subscribe", "subscriptions": [{"id": 77, "channelId": wanted}]}
        viewer.send(json.dumps(subscription))
        viewer.send("nonsense")
        assert json.loads(viewer.recv(LIMIT_S))["op"] == "status"
        message = pose(Place(1.0, 2.0, 0.5), 0.0, 3)
        source.give(POSE.key("pair", "r1"), message)
        data = viewer.recv(LIMIT_S)
    assert isinstance(data, bytes)
    assert struct.unpack_from("<BIQ", data) == (1, 77, message.wall_ns)
    assert data[13:] == encode(message)


def test_foxglove_moves_labelled_axes_without_settings(
    server: PageServer, source: FakeSource
) -> None:
    url = f"ws://127.0.0.1:{server.port}/foxglove"
    with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")]) as viewer:
        viewer.recv(LIMIT_S)
        channels = json.loads(viewer.recv(LIMIT_S))["channels"]
        (tf,) = [each for each in channels if each["topic"] == "tf"]
        assert tf["schemaName"] == "foxglove.FrameTransforms"
        source.give(POSE.key("pair", "r1"), pose(Place(1.0, 2.0, 3.0), 0.0, 0))
        subscription = {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": tf["id"]}]}
        viewer.send(json.dumps(subscription))
        transforms: list[dict[str, object]] = []
        while not transforms:
            transforms = json.loads(viewer.recv(LIMIT_S)[13:])["transforms"]
    assert transforms[0]["child_frame_id"] == "r1"
    assert transforms[0]["translation"] == {"x": 1.0, "y": 2.0, "z": 0.0}


def test_a_viewer_that_speaks_another_protocol_is_turned_away(server: PageServer) -> None:
    with pytest.raises(InvalidStatus):
        connect(f"ws://127.0.0.1:{server.port}/foxglove")


def test_the_truth_is_asked_for_only_while_a_page_shows_it(
    server: PageServer, source: FakeSource
) -> None:
    with opened(server) as page, opened(server) as other:
        assert page.next("frame")
        assert not source.truth_wanted
        page.say("show_truth", wanted=True)
        other.say("show_truth", wanted=False)
        wait_for(lambda: source.truth_wanted)
        page.say("show_truth", wanted=False)
        wait_for(lambda: not source.truth_wanted)
        other.say("show_truth", wanted=True)
        wait_for(lambda: source.truth_wanted)
    wait_for(lambda: not source.truth_wanted)
