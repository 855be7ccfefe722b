"""The live fleet as the page's source and command path, over a link of its own or another's."""

import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence

from config import topics
from config.fleet import Fleet
from config.formations import DEFAULT
from config.messages import CommandReply
from groundstation import fleet_commands
from groundstation.fleet_link import FleetLink
from groundstation.heard import Heard
from groundstation.web.interface import Order

BACKLOG = 20_000


class LinkSource:
    """What a link hears. Only the page may poll the link."""

    epoch = 0

    def __init__(self, link: FleetLink) -> None:
        self._link = link

    def now_s(self) -> float:
        """Wall clock."""
        return time.time()

    def poll(self) -> Sequence[Heard]:
        """What has arrived since the last call."""
        return self._link.poll()

    def alive(self) -> set[str] | None:
        """Processes with a liveliness token."""
        return self._link.view.alive

    def show_truth(self, wanted: bool) -> None:
        """Take the truth in only while somebody wants to see it."""
        if wanted:
            self._link.follow(topics.TRUTH)
        else:
            self._link.leave(topics.TRUTH)


class HandedSource:
    """What another thread hears and hands on; that thread polls the link."""

    epoch = 0

    def __init__(self, link: FleetLink) -> None:
        self._link = link
        self._waiting: deque[Heard] = deque(maxlen=BACKLOG)

    def hand(self, heard: Iterable[Heard]) -> None:
        """Hand messages on; from the link's thread."""
        self._waiting.extend(heard)

    def now_s(self) -> float:
        """Wall clock."""
        return time.time()

    def poll(self) -> Sequence[Heard]:
        """What was handed on since the last call."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]

    def alive(self) -> set[str] | None:
        """Processes with a liveliness token."""
        return set(self._link.view.alive)

    def show_truth(self, wanted: bool) -> None:
        """The truth is handed on in any case."""


class LinkCommands:
    """Commands through a link, in the name of the page's operator."""

    def __init__(self, fleet: Fleet, link: FleetLink) -> None:
        self._fleet, self._link = fleet, link

    def send(self, order: Order) -> Mapping[str, CommandReply]:
        """Give an order to every robot and collect the answers."""
        view, before = self._link.view, {}
        for robot in self._fleet.robots:
            status = view.status(robot)
            before[robot] = DEFAULT if status is None else status.formation or DEFAULT
        return fleet_commands.send(
            self._fleet,
            self._link,
            order.name,
            formation=order.formation,
            before=before,
            by=order.operator,
        )

    def publish_estop(self, operator: str) -> None:
        """Publish the emergency stop once."""
        self._link.publish_estop(operator)

    def announce_command(self, operator: str, since_ns: int) -> None:
        """Tell other ground stations who is in command here."""
        self._link.announce_command(operator, since_ns)
