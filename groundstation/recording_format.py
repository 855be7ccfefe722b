"""What an Echelon recording is: MCAP with one channel per key expression, JSON, parts by size."""

import re
from importlib.metadata import version
from pathlib import Path

import msgspec

from config import topics
from config.fleet import Fleet
from config.messages import Version
from config.topics import Topic
from groundstation import keys, scene

PROFILE = "echelon"
FORMAT_VERSION = 1
INFO = "recording"
"""Topic of the one message that every part begins with."""
ACTIVE = ".active"
"""Ending of a part that is still being written, or was when its program died."""


class RecordingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What was recorded: format, program, effective fleet, how it ran. `part` counts from 1."""

    version: int = FORMAT_VERSION
    wall_ns: int
    part: int
    fleet_name: str
    fleet_json: str
    mode: str
    seed: int
    versions: list[Version]


def info(fleet: Fleet, wall_ns: int, part: int, mode: str, seed: int) -> RecordingInfo:
    """The first message of a part."""
    return RecordingInfo(
        wall_ns=wall_ns,
        part=part,
        fleet_name=fleet.name,
        fleet_json=fleet.model_dump_json(),
        mode=mode,
        seed=seed,
        versions=[Version(name, version(name)) for name in ("echelon", "mcap")],
    )


def expected_keys(fleet: Fleet) -> list[str]:
    """Keys that a run of this fleet is expected to bring."""
    everyones = [topic for topic in topics.PUBLISHED if topic.key("", "") == topic.key("", "*")]
    names = [topic.key(fleet.name) for topic in everyones]
    for robot, settings in fleet.robots.items():
        other = topics.POSE if settings.leader is not None else topics.RELATIVE
        names += [
            topic.key(fleet.name, robot)
            for topic in topics.PUBLISHED
            if topic not in everyones and topic is not other
        ]
    return names


def message_type(topic: str) -> tuple[str, type[msgspec.Struct]]:
    """Schema name and type of a channel's messages.

    Raises ValueError for a key that is no published topic of the registry.
    """
    if topic == INFO:
        return "echelon.RecordingInfo", RecordingInfo
    drawn = scene.CHANNELS.get(topic)
    if drawn is not None:
        return f"foxglove.{drawn.__name__}", drawn
    published: Topic = keys.parse(topic).topic
    return f"echelon.{published.message.__name__}", published.message


def part_path(first: Path, part: int) -> Path:
    """File of a part: run.mcap, run-0002.mcap, run-0003.mcap, ..."""
    return first if part == 1 else first.with_name(f"{first.stem}-{part:04d}{first.suffix}")


def part_paths(first: Path) -> list[Path]:
    """The finished parts of a recording that exist, in order; the first one as it was named."""
    pattern = re.compile(rf"{re.escape(first.stem)}-(\d{{4}}){re.escape(first.suffix)}")
    later = [path for path in first.parent.glob("*") if pattern.fullmatch(path.name)]
    return [first, *sorted(later)]
