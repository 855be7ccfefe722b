"""Names that depend on the machine: the folder for sockets, and CAN channels that lie in it."""

import os
import re
from pathlib import Path

from config.fleet import Fleet

PLACEHOLDERS = ("fleet", "robot", "runtime")


def runtime_dir() -> Path:
    """Folder for this user's sockets. It need not exist yet."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    return Path(base) / "echelon" if base else Path(f"/tmp/echelon-{os.getuid()}")


def expand_channel(fleet: Fleet, robot: str) -> str:
    """CAN channel of one robot with its placeholders filled in."""
    return expand_placeholders(fleet.robots[robot].can.channel, fleet, robot)


def expand_placeholders(text: str, fleet: Fleet, robot: str) -> str:
    """A channel or a folder of one robot with its placeholders filled in."""
    values = {"fleet": fleet.name, "robot": robot, "runtime": str(runtime_dir())}
    for name in PLACEHOLDERS:
        text = text.replace(f"{{{name}}}", values[name])
    return text


def unknown_placeholders(channel: str) -> list[str]:
    """Names in braces that `expand_channel` does not fill in."""
    return [name for name in re.findall(r"\{([^{}]*)\}", channel) if name not in PLACEHOLDERS]
