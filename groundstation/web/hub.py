"""Joins source, view model, pages and command path: what happens 30 times a second."""

import asyncio
import time
from importlib.metadata import version
from typing import get_args

import msgspec

from config.fleet import CheckName, Fleet
from config.formations import formation_names
from config.messages import InCommand
from groundstation.web import wire
from groundstation.web.commanding import Commanding
from groundstation.web.foxglove import FoxgloveServer
from groundstation.web.interface import CommandPort, Playback, Source
from groundstation.web.page_client import PageClient
from groundstation.web.picture import FleetPicture

FRAME_PERIOD_S = 1 / 30
DETAILS_EVERY, ROWS_EVERY, CONTROL_EVERY = 3, 6, 15
"""Frames between two looks at what changes slowly, two tables, and two at who is in command."""

_encode = msgspec.json.Encoder().encode


class Hub:
    """One fleet, all its pages and Foxglove viewers."""

    def __init__(
        self,
        fleet: Fleet,
        source: Source,
        commands: CommandPort | None,
        playback: Playback | None,
        prefix: str,
    ) -> None:
        self.fleet, self.playback = fleet, playback
        self._source, self._prefix = source, prefix
        self._picture = FleetPicture(fleet, prefix)
        self._epoch = source.epoch
        self._clients: set[PageClient] = set()
        self._frames = 0
        self._truth_wanted = False
        self.foxglove = FoxgloveServer(fleet, prefix)
        self.commanding = (
            None
            if commands is None
            else Commanding(fleet, commands, self._state, self._note, self.tell_control)
        )

    async def run(self) -> None:
        """Poll the source and send, on an absolute schedule; late frames are left out."""
        next_s = time.monotonic()
        while True:
            self.tick()
            next_s = max(next_s + FRAME_PERIOD_S, time.monotonic())
            await asyncio.sleep(next_s - time.monotonic())

    def tick(self) -> None:
        """One frame: take in what has arrived, send what has changed."""
        messages = self._source.poll()
        if self._source.epoch != self._epoch:
            self._begin_anew()
        for heard in messages:
            if isinstance(heard.message, InCommand):
                if self.commanding is not None:
                    self.commanding.heard_elsewhere(heard.message, time.time())
            else:
                self._picture.hear(heard.time_s, heard.key, heard.message)
        self.foxglove.hear(messages)
        self._send(self._source.now_s())

    def _send(self, now_s: float) -> None:
        self._frames += 1
        if self.commanding is not None:
            self.commanding.look()
        self._look_for_truth()
        watched = bool(self._clients) or self.foxglove.watched
        detailed = self._frames % DETAILS_EVERY == 0
        if not watched and not detailed:
            return
        robots = self._picture.robots(now_s)
        self.foxglove.show(now_s, robots)
        details = self._picture.details(now_s, robots) if detailed else None
        lines = self._picture.take_log()
        if not self._clients:
            return
        playback = None if self.playback is None else self.playback.state()
        frame = _encode(wire.Frame(self._frames, now_s, robots, playback))
        slow = None if details is None else _encode(wire.Details(now_s, details))
        log = _encode(wire.Log(lines)) if lines else None
        rows = self._rows(now_s) if self._frames % ROWS_EVERY == 0 else None
        for client in self._clients:
            client.offer_frame(self._frames, frame)
            if slow is not None:
                client.offer("details", slow)
            if rows is not None:
                client.offer("rows", rows)
            if log is not None:
                client.post(log)
        if self._frames % CONTROL_EVERY == 0:
            self.tell_control()

    def _look_for_truth(self) -> None:
        wanted = self.foxglove.watched or any(client.wants_truth for client in self._clients)
        if wanted != self._truth_wanted:
            self._truth_wanted = wanted
            self._source.show_truth(wanted)

    def _rows(self, now_s: float) -> bytes:
        rows = self._picture.rows(now_s, self._source.alive())
        return _encode(wire.Rows(rows, self._picture.particles()))

    def join(self, client: PageClient) -> None:
        """A page has connected."""
        now_s = self._source.now_s()
        client.post(_encode(self._hello(now_s)))
        client.offer("rows", self._rows(now_s))
        self._clients.add(client)
        self.tell_control()

    def leave(self, client: PageClient) -> None:
        """A page is gone."""
        self._clients.discard(client)
        if self.commanding is not None:
            self.commanding.gone(client)
        self.tell_control()

    def tell_control(self) -> None:
        """Tell every page who may do what."""
        for client in self._clients:
            client.offer("control", _encode(self._control(client)))

    def answer(self, client: PageClient, answer: wire.Answer) -> None:
        """Tell one page what became of its order."""
        client.post(_encode(answer))

    def _control(self, client: PageClient) -> wire.Control:
        commanding, viewers = self.commanding, len(self._clients)
        if commanding is None:
            return wire.Control(False, False, client.name, viewers, None, None)
        commander = commanding.commander(client)
        return wire.Control(
            True, client.authorised, client.name, viewers, commander, commanding.estop_shown()
        )

    def _begin_anew(self) -> None:
        """Time has jumped: forget what was shown."""
        self._epoch = self._source.epoch
        self._picture = FleetPicture(self.fleet, self._prefix)
        hello = _encode(self._hello(self._source.now_s()))
        for client in self._clients:
            client.post(hello)

    def _hello(self, now_s: float) -> wire.Hello:
        fleet = self.fleet
        return wire.Hello(
            fleet=fleet.name,
            version=version("echelon"),
            live=self.playback is None,
            robots=[
                wire.RobotFacts(
                    name,
                    robot.leader,
                    robot.vehicle.wheelbase_m,
                    [(marker.id, marker.x_m, marker.y_m) for marker in robot.markers],
                )
                for name, robot in fleet.robots.items()
            ],
            landmarks=[(mark.id, mark.x_m, mark.y_m) for mark in fleet.landmarks],
            formations=formation_names(fleet),
            checks=list(get_args(CheckName)),
            mission_s=fleet.mission.duration_s,
            now_s=now_s,
            past=self._picture.history.past(),
            log=list(self._picture.log),
        )

    def _state(self, robot: str) -> str:
        return self._picture.state(robot)

    def _note(self, severity: str, text: str) -> None:
        self._picture.note(time.time(), "ground", severity, text)
