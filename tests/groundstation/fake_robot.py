"""A robot as the ground station sees it: status, answers to commands, obedience to the e-stop."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import zenoh
from zenoh.handlers import FifoChannel, RingChannel

from config import topics
from config.fleet import Fleet
from config.messages import Command, CommandReply, encode
from config.zenoh_settings import session_config
from tests.groundstation.synthetic import status

PERIOD_S = 0.02
AFTER = {
    "arm": "ARMED",
    "start": "RUNNING",
    "stop": "STANDBY",
    "reset": "STANDBY",
    "at_start": "STANDBY",
}


class FakeRobot:
    """Accepts every command except those in `refuses`; a deaf one ignores the e-stop."""

    def __init__(self, fleet: Fleet, name: str, refuses: str = "", deaf: bool = False) -> None:
        self.state = "STANDBY"
        self.commands: list[str] = []
        self._fleet, self._name, self._refuses, self._deaf = fleet, name, refuses, deaf
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        """End the robot."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        listen = self._fleet.robots[self._name].listen
        config = zenoh.Config.from_json5(session_config(listen, [self._fleet.ground]))
        with zenoh.open(config) as session:
            estops = session.declare_subscriber(topics.ESTOP.key(self._fleet.name), RingChannel(1))
            queries = session.declare_queryable(
                topics.COMMAND.key(self._fleet.name, self._name), FifoChannel(8)
            )
            publisher = session.declare_publisher(topics.STATUS.key(self._fleet.name, self._name))
            while not self._ending.wait(PERIOD_S):
                if estops.handler.try_recv() is not None and not self._deaf:
                    self.state = "ESTOP"
                while (query := queries.handler.try_recv()) is not None:
                    self._answer(query)
                publisher.put(self._status())

    def _answer(self, query: zenoh.Query) -> None:
        assert query.payload is not None
        command = msgspec.json.decode(query.payload.to_bytes(), type=Command)
        self.commands.append(command.name)
        accepted = command.name != self._refuses
        if accepted:
            self.state = AFTER[command.name]
        reply = CommandReply(
            robot=self._name, accepted=accepted, reason="" if accepted else "drive not calibrated"
        )
        with query:
            query.reply(query.key_expr, encode(reply))

    def _status(self) -> bytes:
        now = status(self._name, self.state, "", 0)
        return encode(
            msgspec.structs.replace(now, t_ns=time.monotonic_ns(), wall_ns=time.time_ns())
        )


@contextmanager
def robots(*made: FakeRobot) -> Iterator[None]:
    """End the robots at the end of the block."""
    try:
        yield
    finally:
        for robot in made:
            robot.close()
