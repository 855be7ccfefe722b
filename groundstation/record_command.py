"""`echelon record`: a ground station that does nothing but record a running fleet."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from config.fleet import Fleet
from groundstation.fleet_link import POLL_S, FleetLink
from groundstation.recorder import FLUSH_PERIOD_S, About, Limits, Recorder

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


def pump(link: FleetLink, recorder: Recorder, seconds: float | None, say: Say) -> int:
    """Move what arrives into the recording."""
    count, started_s = 0, time.monotonic()
    flush_s = started_s
    while seconds is None or time.monotonic() - started_s < seconds:
        for key, payload, message in link.poll():
            recorder.write(key, payload, message.wall_ns)
            count += 1
        if time.monotonic() >= flush_s:
            flush_s = time.monotonic() + FLUSH_PERIOD_S
            recorder.flush()
            for text in [*link.unreadable, *recorder.take_notes()]:
                say(text)
            link.unreadable.clear()
        time.sleep(POLL_S)
    return count
