"""What one step of a robot consumes and produces: the border between pure core and shell."""

from dataclasses import dataclass, field
from typing import NamedTuple

from config.can.frame import Frame
from config.messages import (
    BusHealth,
    Command,
    CommandReply,
    Estop,
    Ground,
    LoopHealth,
    Message,
    Motion,
)
from config.topics import Topic


class Request(NamedTuple):
    """An operator's command and the shell's number for whoever waits for the reply."""

    number: int
    command: Command


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything one step depends on. Times are in seconds; `wall_s` is the wall clock's.

    `unreadable` and `notes` are the shell's own
    findings, for people. `free_disk_mb` is None where the robot writes nothing.
    """

    now_s: float
    wall_s: float
    frames: list[Frame]
    bus: BusHealth
    loop: LoopHealth
    late_s: float = 0.0
    motions: list[Motion] = field(default_factory=list)
    requests: list[Request] = field(default_factory=list)
    estops: list[Estop] = field(default_factory=list)
    grounds: list[Ground] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    shutdown: bool = False
    free_disk_mb: float | None = None


@dataclass(frozen=True, slots=True)
class Outputs:
    """What the shell sends: frames onto the bus, messages to the fleet, replies to operators."""

    frames: list[Frame]
    messages: list[tuple[Topic, Message]]
    replies: list[tuple[int, CommandReply]]
