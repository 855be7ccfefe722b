"""The ground station's Zenoh session: hears the fleet, sends commands and emergency stops."""

import getpass
import re
import socket
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Self

import zenoh
from zenoh.handlers import FifoChannel, RingChannel

from config import topics
from config.closing import Closing
from config.fleet import Fleet
from config.messages import (
    Command,
    CommandReply,
    Estop,
    FaultOrder,
    Ground,
    InCommand,
    Message,
    Unreadable,
    decode,
    encode,
)
from config.topics import Topic
from config.zenoh_settings import session_config
from groundstation import keys
from groundstation.errors import GroundError
from groundstation.fleet_view import FleetView
from groundstation.heard import Heard

BACKLOG = 8192
SEEN_HZ = 40.0
"""Of 100 messages a second every third is taken in: 33 for a page that draws 30 frames."""
REPLY_TIMEOUT_S = 2.0
ESTOP_PERIOD_S = 0.05
ESTOP_FIRST_S, ESTOP_FIRST_PERIOD_S = 0.5, 0.002
"""A session that has just been opened does not reach the robots yet, and does not know when."""
HEARTBEAT_PERIOD_S = 1.0 / topics.GROUND.rate_hz
NO_ANSWER = f"no answer within {REPLY_TIMEOUT_S:g} s"
POLL_S = 0.01
NOT_SIMULATED = "no simulated hardware answers for it: is echelon-sim running with this robot?"
ANY_LOOPBACK = "tcp/127.0.0.1:0"


class _Place(NamedTuple):
    """Holds the newest message of one key."""

    key: str
    subscriber: zenoh.Subscriber[zenoh.handlers.Handler[zenoh.Sample]]


class FleetLink(Closing):
    """Session with one fleet. Nothing arrives by itself: call `poll` at least every second.

    Use `as_ground_station` or `as_visitor` to make one, and close it (it is a context manager).
    With `newest`, only the last message per key of topics that are published at a rate arrives,
    and no more than SEEN_HZ of them: half the price for who wants to see the present.
    """

    def __init__(
        self,
        fleet: Fleet,
        listen: str,
        connect: list[str],
        hear: Iterable[Topic],
        announce: str | None = None,
        newest: bool = False,
    ) -> None:
        self.view = FleetView()
        self.unreadable: list[str] = []
        self._fleet = fleet
        self._session = _open(listen, connect, _seen_hz(fleet) if newest else {})
        self._addresses: dict[str, keys.Address] = {}
        self._newest: dict[Topic, list[_Place]] = {}
        self._queued: list[zenoh.Subscriber[zenoh.handlers.Handler[zenoh.Sample]]] = []
        for topic in hear:
            if newest and topic.rate_hz > 0 and topic.per_robot:
                self.follow(topic)
            else:
                key = topic.key(fleet.name)
                self._queued.append(self._session.declare_subscriber(key, FifoChannel(BACKLOG)))
        self._tokens = self._session.liveliness().declare_subscriber(
            topics.liveliness_key(fleet.name, "*"), FifoChannel(BACKLOG), history=True
        )
        self._estop = self._session.declare_publisher(topics.ESTOP.key(fleet.name))
        self._estops_sent = 0
        self._in_command = self._session.declare_publisher(topics.IN_COMMAND.key(fleet.name))
        self._announcements = 0
        self._heartbeat = (
            self._session.declare_publisher(topics.GROUND.key(fleet.name)) if announce else None
        )
        self._beats, self._next_beat_s = 0, 0.0
        self._own_token = (
            self._session.liveliness().declare_token(topics.liveliness_key(fleet.name, announce))
            if announce is not None
            else None
        )

    @classmethod
    def as_ground_station(
        cls, fleet: Fleet, hear: Iterable[Topic] = topics.PUBLISHED, newest: bool = False
    ) -> Self:
        """Listen on the fleet's ground endpoint and hear everything, truth too.

        Raises GroundError when the endpoint cannot be opened.
        """
        return cls(fleet, fleet.ground, [], hear, announce="ground", newest=newest)

    @classmethod
    def as_visitor(
        cls, fleet: Fleet, hear: Iterable[Topic] = (topics.STATUS,), newest: bool = False
    ) -> Self:
        """Join a running fleet through its ground station and its robots' fixed endpoints."""
        robots = [robot.listen for robot in fleet.robots.values()]
        fixed = [endpoint for endpoint in robots if not endpoint.endswith(":0")]
        return cls(fleet, ANY_LOOPBACK, [fleet.ground, *fixed], hear, newest=newest)

    def close(self) -> None:
        """Leave the network."""
        self._session.close()

    def poll(self) -> list[Heard]:
        """Everything that arrived since the last call, also taken into `view`.

        A message that cannot be read is left out and named in `unreadable`. A ground station's
        heartbeat goes out from here, so that it stops where nobody looks at the fleet any more.
        """
        self._beat()
        while (token := self._tokens.handler.try_recv()) is not None:
            process = str(token.key_expr).rpartition("/")[2]
            if token.kind == zenoh.SampleKind.PUT:
                self.view.alive.add(process)
            else:
                self.view.alive.discard(process)
        heard: list[Heard] = []
        for places in self._newest.values():
            for key, subscriber in places:
                if (sample := subscriber.handler.try_recv()) is not None:
                    self._take(key, sample.payload.to_bytes(), heard)
        for queue in self._queued:
            while (sample := queue.handler.try_recv()) is not None:
                self._take(str(sample.key_expr), sample.payload.to_bytes(), heard)
        return heard

    def follow(self, topic: Topic) -> None:
        """From now on also hear the newest message of every robot on this topic."""
        if topic not in self._newest:
            own = [topic.key(self._fleet.name, name) for name in self._fleet.robots]
            self._newest[topic] = [
                _Place(key, self._session.declare_subscriber(key, RingChannel(1))) for key in own
            ]

    def leave(self, topic: Topic) -> None:
        """Hear no more of a topic that was followed."""
        for place in self._newest.pop(topic, []):
            place.subscriber.undeclare()

    def _beat(self) -> None:
        if self._heartbeat is None or time.monotonic() < self._next_beat_s:
            return
        self._next_beat_s = time.monotonic() + HEARTBEAT_PERIOD_S
        self._beats += 1
        beat = Ground(
            seq=self._beats,
            t_ns=time.monotonic_ns(),
            wall_ns=time.time_ns(),
            operator=operator(),
        )
        self._heartbeat.put(encode(beat))

    def wait_until(
        self, reached: Callable[[], bool], timeout_s: float, poll_s: float = POLL_S
    ) -> bool:
        """Poll until the condition holds; False when it does not within the time."""
        deadline = time.monotonic() + timeout_s
        while True:
            self.poll()
            if reached():
                return True
            if time.monotonic() > deadline:
                return False
            time.sleep(poll_s)

    def command(
        self,
        name: str,
        robots: Sequence[str],
        override: Sequence[str] = (),
        formation: str = "",
        by: str | None = None,
    ) -> dict[str, CommandReply]:
        """Send one command to several robots at once and collect their replies.

        A robot that does not answer is reported as refusing, with that as the reason. `by` is the
        operator's name instead of this process's user. May be called from another thread.
        """
        payload = encode(
            Command(
                name=name,
                operator=by or operator(),
                override=list(override),
                formation=formation,
            )
        )
        pending = {
            robot: self._session.get(
                topics.COMMAND.key(self._fleet.name, robot),
                payload=payload,
                timeout=REPLY_TIMEOUT_S,
            )
            for robot in robots
        }
        return {robot: _reply(robot, replies) for robot, replies in pending.items()}

    def order_fault(self, robot: str, order: FaultOrder) -> CommandReply:
        """Send a fault to the simulated hardware of a robot; without an answer it is refused."""
        key = topics.FAULT.key(self._fleet.name, robot)
        deadline = time.monotonic() + REPLY_TIMEOUT_S
        while True:
            replies = self._session.get(key, payload=encode(order), timeout=REPLY_TIMEOUT_S)
            reply = _reply(robot, replies, NOT_SIMULATED)
            if reply.reason != NOT_SIMULATED or time.monotonic() > deadline:
                return reply
            time.sleep(POLL_S)

    def publish_estop(self, by: str | None = None) -> None:
        """Publish the emergency stop once, in the name of `by` or of this process's user."""
        self._estops_sent += 1
        message = Estop(
            seq=self._estops_sent,
            t_ns=time.monotonic_ns(),
            wall_ns=time.time_ns(),
            operator=by or operator(),
        )
        self._estop.put(encode(message))

    def announce_command(self, by: str, since_ns: int) -> None:
        """Publish who is in command at this ground station; nobody where `by` is empty."""
        self._announcements += 1
        message = InCommand(
            seq=self._announcements,
            t_ns=time.monotonic_ns(),
            wall_ns=time.time_ns(),
            operator=by,
            since_ns=since_ns,
        )
        self._in_command.put(encode(message))

    def estop(self, timeout_s: float) -> dict[str, bool]:
        """Repeat the emergency stop until every robot reports ESTOP, or the time is over.

        Returns which robots report it.
        """
        began = time.monotonic()
        while True:
            self.publish_estop()
            passed_s = time.monotonic() - began
            period_s = ESTOP_FIRST_PERIOD_S if passed_s < ESTOP_FIRST_S else ESTOP_PERIOD_S
            reached = self.wait_until(self._all_in_estop, period_s, period_s)
            if reached or passed_s > timeout_s:
                return {name: self.view.state(name) == "ESTOP" for name in self._fleet.robots}

    def _all_in_estop(self) -> bool:
        return all(self.view.state(name) == "ESTOP" for name in self._fleet.robots)

    def _take(self, key: str, payload: bytes, heard: list[Heard]) -> None:
        if key not in self._addresses:
            self._addresses[key] = keys.parse(key)
        address = self._addresses[key]
        try:
            message = decode(payload, address.topic.message)
        except Unreadable as error:
            self.unreadable.append(f"message on {key} cannot be read: {error}")
            return
        if isinstance(message, Message):
            self.view.hear(address, message)
            heard.append(Heard(time.time(), key, payload, message))


def _seen_hz(fleet: Fleet) -> dict[str, float]:
    """How many messages a second are worth taking in of every key that has more than enough."""
    return {
        topic.key(fleet.name, name): SEEN_HZ
        for topic in topics.PUBLISHED
        for name in fleet.robots
        if topic.per_robot and topic.rate_hz > 2 * SEEN_HZ
    }


def operator() -> str:
    """Who commands: user and host."""
    return f"{getpass.getuser()}@{socket.gethostname()}"


def _reply(
    robot: str, replies: zenoh.handlers.Handler[zenoh.Reply], no_answer: str = NO_ANSWER
) -> CommandReply:
    for reply in replies:
        if reply.ok is None:
            continue
        try:
            return decode(reply.ok.payload.to_bytes(), CommandReply)
        except Unreadable as error:
            return CommandReply(
                robot=robot, accepted=False, reason=f"its answer cannot be read: {error}"
            )
    return CommandReply(robot=robot, accepted=False, reason=no_answer)


def _open(listen: str, connect: list[str], at_most_hz: Mapping[str, float]) -> zenoh.Session:
    try:
        return zenoh.open(zenoh.Config.from_json5(session_config(listen, connect, at_most_hz)))
    except zenoh.ZError as error:
        known = re.search(r"[A-Z][^:\[\]]*(?= \(os error)", str(error))
        cause = known[0] if known else str(error).split(" at /")[0]
        raise GroundError(
            f"cannot listen on {listen}: {cause}. If another ground station or demo uses this "
            f"endpoint, end it, or choose another one: --ground {ANY_LOOPBACK} takes a free port."
        ) from error
