"""`echelon record`: a ground station that does nothing but record a running fleet."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from config.fleet import Fleet
from groundstation.fleet_link import POLL_S, FleetLink
from groundstation.heard import Heard
from groundstation.recorder import About, Limits, Recorder

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Options:
    """What to record where; `seconds` None goes on until it is interrupted."""

    fleet: Fleet
    path: Path
    seconds: float | None
    limits: Limits
    say: Say


def record(options: Options) -> int:
    """Record until the time is over or KeyboardInterrupt comes; returns how many messages.

    Raises GroundError when the fleet's ground endpoint or the file cannot be opened.
    """
    about = About(time.time_ns(), "processes", 0)
    with (
        FleetLink.as_ground_station(options.fleet) as link,
        Recorder(options.path, options.fleet, about, options.limits) as recorder,
    ):
        return pump(link, recorder, options.seconds, options.say)


class Source(Protocol):
    """What messages come from."""

    unreadable: list[str]

    def poll(self) -> list[Heard]:
        """Everything that arrived since the last call."""


def pump(source: Source, recorder: Recorder, seconds: float | None, say: Say) -> int:
    """Move what arrives into the recording; returns how many messages that were."""
    count, started_s = 0, time.monotonic()
    while seconds is None or time.monotonic() - started_s < seconds:
        for _, key, payload, message in source.poll():
            recorder.write(key, payload, message.wall_ns)
            count += 1
        recorder.tick(time.monotonic())
        for text in [*source.unreadable, *recorder.take_notes()]:
            say(text)
        source.unreadable.clear()
        time.sleep(POLL_S)
    return count
