"""Payloads over a real Zenoh session: what goes in is a message, a reply, or named unreadable."""

import time
from typing import Any

import numpy as np
import zenoh

from config import topics
from config.zenoh_settings import session_config
from groundstation.endpoints import with_real_port
from onboard.link import Link
from tests.fuzz.payloads import PayloadFuzzer
from tests.soak.fleet import circling

LIMIT_S = 20.0
COMMAND_EVERY = 20


class LostInSilence(AssertionError):
    """A payload was neither taken, nor answered, nor reported."""


def run_session(seed: int, count: int) -> int:
    """Publish so many payloads, one at a time, to a robot's real link; returns how many it took."""
    fleet = circling()
    fleet = fleet.model_copy(update={"ground": with_real_port("tcp/127.0.0.1:0")})
    rng = np.random.default_rng([seed, count])
    fuzzer = PayloadFuzzer(rng, "r1", fleet.robots["r2"].markers[0].id, "r2")
    settings = zenoh.Config.from_json5(session_config(fleet.ground, []))
    with zenoh.open(settings) as session, Link(fleet, "r2") as link:
        motion = session.declare_publisher(topics.MOTION.key(fleet.name, "r1"))
        _wait(lambda: _matched(motion), "the robot's link")
        for number in range(count):
            now_s = time.monotonic()
            if number % COMMAND_EVERY:
                motion.put(fuzzer.one("motion", now_s, time.time()))
                _wait(lambda: bool(link.motions() or link.unreadable()), f"payload {number}")
            else:
                _ask(session, link, fleet.name, fuzzer.one("command", now_s, time.time()))
    return count


def _ask(session: zenoh.Session, link: Link, fleet: str, payload: bytes) -> None:
    """A command is either handed on, or refused at once."""
    replies = session.get(topics.COMMAND.key(fleet, "r2"), payload=payload, timeout=LIMIT_S)
    _wait(lambda: bool(link.requests()) or replies.try_recv() is not None, "a command")


def _matched(publisher: zenoh.Publisher) -> bool:
    """Whether anyone subscribes; the stub calls the status a bool, it is an object."""
    status: Any = publisher.matching_status
    return bool(status.matching)


def _wait(reached: Any, what: str) -> None:
    deadline_s = time.monotonic() + LIMIT_S
    while not reached():
        if time.monotonic() > deadline_s:
            raise LostInSilence(f"{what}: nothing within {LIMIT_S:g} s")
        time.sleep(0.0002)
