"""A robot's Zenoh link: what the loop polls and what it publishes. No callbacks, no threads."""

from collections import deque
from collections.abc import Iterable

import zenoh
from zenoh.handlers import FifoChannel, Handler, RingChannel

from config import topics
from config.closing import Closing
from config.fleet import Fleet
from config.messages import (
    Command,
    CommandReply,
    Estop,
    Ground,
    Message,
    Motion,
    StructT,
    Unreadable,
    decode,
    encode,
)
from config.topics import Topic
from config.zenoh_settings import session_config
from onboard.step import Outputs, Request

MOTION_BACKLOG = 4
COMMAND_BACKLOG = 8
RECORD_BACKLOG = 4000
"""Messages of the step record kept until somebody listens: some 20 s of a loop at 100 Hz."""
RECORD_BURST = 8
"""Of those kept, how many may go out in one cycle."""


class LinkUnavailable(Exception):
    """The robot's Zenoh endpoint cannot be opened; the text says which, why and what to do."""


class Link(Closing):
    """Session of one robot: hears its leader, the operator and the e-stop; publishes its own.

    Raises:
        LinkUnavailable: the robot's listen endpoint is in use or is not this machine's.
    """

    def __init__(self, fleet: Fleet, name: str) -> None:
        self._fleet, self._name = fleet, name
        self._session = _open(fleet, name)
        leader = fleet.robots[name].leader
        self._motion = (
            self._session.declare_subscriber(
                topics.MOTION.key(fleet.name, leader), RingChannel(MOTION_BACKLOG)
            )
            if leader is not None
            else None
        )
        self._estop = self._session.declare_subscriber(topics.ESTOP.key(fleet.name), RingChannel(1))
        self._ground = (
            self._session.declare_subscriber(topics.GROUND.key(fleet.name), RingChannel(1))
            if fleet.robots[name].failsafe.ground_lost is not None
            else None
        )
        self._commands = self._session.declare_queryable(
            topics.COMMAND.key(fleet.name, name), FifoChannel(COMMAND_BACKLOG)
        )
        self._publishers = {
            topic.name: self._session.declare_publisher(topic.key(fleet.name, name))
            for topic in (*topics.ROBOTS_OWN, *topics.STEP_RECORD)
        }
        self._records: deque[tuple[str, bytes]] = deque(maxlen=RECORD_BACKLOG)
        self._recorded_by_someone = False
        self._token = self._session.liveliness().declare_token(
            topics.liveliness_key(fleet.name, name)
        )
        self._waiting: dict[int, zenoh.Query] = {}
        self._requests = 0
        self._unreadable: list[str] = []

    def close(self) -> None:
        """Leave the network."""
        self._session.close()

    def motions(self) -> list[Motion]:
        """The leader's messages since the last call, oldest first."""
        return [] if self._motion is None else self._drain(self._motion.handler, Motion)

    def estops(self) -> list[Estop]:
        """Emergency stops since the last call; one that cannot be read counts as one."""
        known = len(self._unreadable)
        stops = self._drain(self._estop.handler, Estop)
        if len(self._unreadable) > known:
            stops.append(Estop(seq=0, t_ns=0, wall_ns=0, operator="unreadable message"))
        return stops

    def grounds(self) -> list[Ground]:
        """The ground station's heartbeat since the last call, where the fleet file asks for it."""
        return [] if self._ground is None else self._drain(self._ground.handler, Ground)

    def requests(self) -> list[Request]:
        """Operators' commands since the last call; each waits for its reply in `publish`."""
        received: list[Request] = []
        while (query := self._commands.handler.try_recv()) is not None:
            payload = query.payload.to_bytes() if query.payload is not None else b""
            try:
                command = decode(payload, Command)
            except Unreadable as error:
                reason = f"command cannot be read: {error}"
                self._answer(query, CommandReply(robot=self._name, accepted=False, reason=reason))
                continue
            self._requests += 1
            self._waiting[self._requests] = query
            received.append(Request(self._requests, command))
        return received

    def unreadable(self) -> list[str]:
        """Messages since the last call that did not decode: key and cause."""
        texts, self._unreadable = self._unreadable, []
        return texts

    def publish(self, outputs: Outputs) -> None:
        """Send one step's messages and replies."""
        for topic, message in outputs.messages:
            self._publishers[topic.name].put(encode(message))
        for number, reply in outputs.replies:
            self._answer(self._waiting.pop(number), reply)

    def record(self, messages: Iterable[tuple[Topic, Message]]) -> None:
        """Send a step's record, in order; what nobody can hear yet is kept for a while.

        A recording is complete from the first step on only if none is lost before the ground
        station is found.
        """
        self._records.extend((topic.name, encode(message)) for topic, message in messages)
        if not self._recorded_by_someone:
            status = self._publishers[topics.STEP.name].matching_status
            self._recorded_by_someone = status.matching  # type: ignore[attr-defined]  # the stub says bool
            return
        for _ in range(min(RECORD_BURST, len(self._records))):
            name, body = self._records.popleft()
            self._publishers[name].put(body)

    def _drain(self, handler: Handler[zenoh.Sample], kind: type[StructT]) -> list[StructT]:
        received: list[StructT] = []
        while (sample := handler.try_recv()) is not None:
            try:
                received.append(decode(sample.payload.to_bytes(), kind))
            except Unreadable as error:
                self._unreadable.append(f"message on {sample.key_expr} cannot be read: {error}")
        return received

    def _answer(self, query: zenoh.Query, reply: CommandReply) -> None:
        with query:
            query.reply(topics.COMMAND.key(self._fleet.name, self._name), encode(reply))


def connect_endpoints(fleet: Fleet, name: str) -> list[str]:
    """The ground station and this robot's leader, where the leader's port is fixed."""
    endpoints = [fleet.ground]
    leader = fleet.robots[name].leader
    if leader is not None and not fleet.robots[leader].listen.endswith(":0"):
        endpoints.append(fleet.robots[leader].listen)
    return endpoints


def _open(fleet: Fleet, name: str) -> zenoh.Session:
    listen = fleet.robots[name].listen
    config = zenoh.Config.from_json5(session_config(listen, connect_endpoints(fleet, name)))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise LinkUnavailable(
            f"robot {name}: cannot listen on {listen}: {str(error).split(' at /')[0]}. Stop the "
            f"process that uses it, or change `listen` of {name} in the fleet file."
        ) from error
