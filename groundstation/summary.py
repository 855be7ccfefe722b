"""The summary of a run as it is written to summary.json: plain data, None where nothing is known.

Times are seconds of mission time (of the recording when the mission never started).
"""

from typing import Literal

import msgspec

Mode = Literal["lockstep", "processes"]


class Mission(msgspec.Struct, frozen=True):
    """What was driven, and how much of it was judged."""

    duration_s: float
    from_s: float
    seconds_judged: float
    completed: bool
    mode: Mode
    seed: int
    law: dict[str, str]


class Follower(msgspec.Struct, frozen=True):
    """Formation error against truth."""

    range_rms_m: float | None
    bearing_rms_rad: float | None
    position_rms_m: float | None


class Leader(msgspec.Struct, frozen=True):
    """Error of the leader's pose estimate against truth."""

    position_rmse_m: float | None
    heading_rmse_rad: float | None


class Estimation(msgspec.Struct, frozen=True):
    """Error of a follower's estimate of its leader against truth."""

    range_rmse_m: float | None
    bearing_rmse_rad: float | None
    heading_rmse_rad: float | None


class Fault(msgspec.Struct, frozen=True):
    """A robot that went to FAULT or ESTOP, or a process that ended."""

    robot: str
    t_s: float
    reason: str


class Loop(msgspec.Struct, frozen=True):
    """Timing of one robot's control loop."""

    p50_ms: float
    p99_ms: float
    max_ms: float
    overruns: int
    cycles: int


class Summary(msgspec.Struct, frozen=True):
    """A judged run. `why` names value and limit of every bar that was not met."""

    verdict: Literal["pass", "fail"]
    why: list[str]
    fleet: str
    mission: Mission
    followers: dict[str, Follower]
    leader: Leader
    estimation: dict[str, Estimation]
    min_distance_m: float | None
    collisions: int
    faults: list[Fault]
    loop: dict[str, Loop]
    recording: str


def to_json(summary: Summary) -> bytes:
    """Indented JSON with a newline at the end."""
    return msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n"
