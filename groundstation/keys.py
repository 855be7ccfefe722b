"""From a key expression back to the registry's topic and the robot."""

from typing import NamedTuple

from config import topics
from config.topics import Topic


class Address(NamedTuple):
    """What a concrete key names. `robot` is "all" for a topic that is sent to everyone."""

    topic: Topic
    fleet: str
    robot: str


def parse(key: str) -> Address:
    """Topic, fleet and robot of a concrete key.

    Raises ValueError when no published topic of the registry has such keys.
    """
    for topic in topics.PUBLISHED:
        names = _match(topic.template, key)
        if names is not None:
            return Address(topic, names["fleet"], names.get("robot", "all"))
    raise ValueError(f"{key!r} belongs to no published topic of config/topics.py")


def _match(template: str, key: str) -> dict[str, str] | None:
    parts, values = template.split("/"), key.split("/")
    if len(parts) != len(values):
        return None
    names: dict[str, str] = {}
    for part, value in zip(parts, values, strict=True):
        if part.startswith("{"):
            names[part.strip("{}")] = value
        elif part != value:
            return None
    return names
