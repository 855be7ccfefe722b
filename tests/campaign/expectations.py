"""What every fault of every device has to lead to: one row per device and kind.

A row names the triggers of the failsafe table that may speak first, and how long the fault takes to
show on the bus; when a stop is due, and in which state it ends, follows from the table's own rows.
Nothing here is taken from a run.
"""

from enum import Enum
from typing import NamedTuple

from tests.campaign.scenario import BEFORE_SWERVE_S, Phase, Role

CYCLE_S = 0.01
SLACK_S = 2 * CYCLE_S
"""From the bus into the control loop, and the loop's own cycle."""


class Shows(Enum):
    """From when on a fault can be noticed at all."""

    AT_ONCE = "at once"
    DRIVING = "driving"
    STEERING = "steering"


class Row(NamedTuple):
    """What a fault leads to.

    `triggers` are those that may be the first reason, `latency_s` is what passes before the first
    sign of the fault is on the bus. `may_drive` where physics leaves it open, or where the fault
    is within what the protocol bears; without triggers the robot has to drive on. `ends` is the
    final state where later reasons add to the first one.
    """

    triggers: tuple[str, ...]
    latency_s: float = 0.0
    shows: Shows = Shows.AT_ONCE
    may_drive: bool = False
    ends: tuple[str, ...] = ()
    why: str = ""


HEARTBEAT_S = 0.1
ESTIMATE_S = 0.01
SENSOR_SILENCE_S = 0.1
"""What `bearing_sensor_lost` bears, in the sensor's driver."""
HEALTH_SILENCE_S = 0.35
"""The same for the sensor's report on itself."""
TRANSITION_S = 1.0
"""What a drive may take to arm."""

_SILENT = Row(("drive_estimate_stale",), ESTIMATE_S)
_ERROR = Row(("drive_error",), HEARTBEAT_S)
_ANY_SILENCE = (
    "drive_heartbeat_lost",
    "drive_estimate_stale",
    "encoder_stale",
    "bearing_sensor_lost",
    "bearings_stale",
)

_EITHER_DRIVE: dict[str, Row] = {
    "off": _SILENT,
    "slow": Row(
        ("drive_heartbeat_lost", "drive_estimate_stale"),
        HEARTBEAT_S,
        why="a heartbeat each 0.5 s, estimates each 0.05 s",
    ),
    "delayed": _SILENT,
    "intermittent": _SILENT,
    "failed": _ERROR,
    "mute": _SILENT,
    "nan": Row(("drive_error",), ESTIMATE_S),
    "disarm": _ERROR,
    "restart": _SILENT,
    "overheat": Row(("drive_error",), 0.5 + HEARTBEAT_S, why="from 30 to 80 degC at 100 degC/s"),
    "undervolt": _ERROR,
}

EXPECTED: dict[str, dict[str, Row]] = {
    "steering": _EITHER_DRIVE
    | {
        "stuck": Row(("steering_response", "steering_disagreement"), shows=Shows.STEERING),
        "garbage": Row(("steering_disagreement",), ESTIMATE_S),
        "wrong": Row(("steering_disagreement",), ESTIMATE_S),
        "jammed": Row(("steering_response",), shows=Shows.STEERING),
    },
    "drive": _EITHER_DRIVE
    | {
        "stuck": Row(("drive_response",), shows=Shows.DRIVING),
        "garbage": Row(("drive_response",), ESTIMATE_S),
        "wrong": Row(("drive_response",), shows=Shows.DRIVING),
        "jammed": Row(("drive_response",), shows=Shows.DRIVING),
    },
    "encoder": {
        "off": Row(("encoder_stale",), CYCLE_S),
        "stuck": Row(("steering_response", "steering_disagreement"), shows=Shows.STEERING),
        "garbage": Row(("steering_disagreement",), 3 * CYCLE_S, why="5 % of random angles fit"),
        "wrong": Row(("steering_disagreement",), CYCLE_S),
        "slow": Row(
            ("encoder_stale",), may_drive=True, why="an angle each 0.05 s, which is the limit"
        ),
        "delayed": Row(("encoder_stale",), CYCLE_S),
        "intermittent": Row(("encoder_stale",), CYCLE_S),
        "failed": Row(("encoder_error",), CYCLE_S),
    },
    "bearing": {
        "off": Row(("bearing_sensor_lost",), SENSOR_SILENCE_S),
        "stuck": Row(("bearings_repeat",), shows=Shows.DRIVING),
        "garbage": Row(("estimator_reset", "nis_alarm"), 0.6),
        "wrong": Row(("estimator_reset", "nis_alarm"), 0.6),
        "slow": Row(
            ("bearing_sensor_lost",),
            HEARTBEAT_S + HEALTH_SILENCE_S,
            why="a report on itself each 0.5 s",
        ),
        "delayed": Row(("bearing_sensor_lost",), SENSOR_SILENCE_S),
        "intermittent": Row(("bearing_sensor_lost",), SENSOR_SILENCE_S),
        "failed": Row(("bearing_sensor_lost",), HEARTBEAT_S),
        "blind": Row(("bearings_stale",), CYCLE_S),
    },
    "bus": {
        "loss": Row(
            (*_ANY_SILENCE, "drive_error"),
            may_drive=True,
            ends=("STANDBY", "FAULT"),
            why="of five frames four arrive; three or five lost in a row are a silence",
        ),
        "duplication": Row((), may_drive=True, why="counters tell repeated frames"),
        "reordering": Row((), may_drive=True, why="the newest counts"),
        "corruption": Row(
            ("bus_passive", *_ANY_SILENCE),
            2.0,
            ends=("STANDBY", "FAULT"),
            why="8 errors' weight per bad frame, 1 back per good one; goes on to bus-off",
        ),
        "babbling": Row(
            ("drive_estimate_stale", "encoder_stale", "send_queue_full"),
            ESTIMATE_S,
            ends=("FAULT",),
            why="nothing gets through, the drives are silent as well",
        ),
        "wrong_bitrate": Row(
            ("bus_passive", "bus_off", "drive_estimate_stale", "encoder_stale"),
            CYCLE_S,
            ends=("FAULT",),
            why="nothing is heard, the drives are silent as well",
        ),
        "bus_off": Row(("bus_off",)),
        "unplugged": Row(
            ("bus_passive", "drive_estimate_stale", "encoder_stale"),
            CYCLE_S,
            ends=("FAULT",),
            why="nothing is heard, the drives are silent as well",
        ),
        "adapter_lost": Row(("bus_off",)),
    },
}

_SPECIAL: dict[tuple[Role | None, Phase | None, str, str], Row] = {
    (Role.LEADER, None, "bearing", "garbage"): Row(
        ("estimator_reset", "nis_alarm"),
        1.3,
        why="a leader's pose is lost after 1 s of bearings that do not fit",
    ),
    (Role.LEADER, None, "bearing", "wrong"): Row(
        ("estimator_reset", "nis_alarm"),
        1.3,
        may_drive=True,
        why="on a leader all bearings turned alike look like another heading, and the schedule "
        "needs no pose",
    ),
    (Role.FOLLOWER, Phase.ARMING, "bearing", "wrong"): Row(
        ("estimator_reset", "nis_alarm"),
        1.0,
        Shows.DRIVING,
        why="of two robots that stand, one may as well be turned; 1 s of bearings while driving",
    ),
    (None, Phase.ARMING, "drive", "garbage"): Row(
        ("drive_response",),
        HEARTBEAT_S + ESTIMATE_S,
        why="compared once the drive is known to hold",
    ),
} | {
    (None, Phase.ARMING, axis, "disarm"): Row(
        ("drive_error",), TRANSITION_S + HEARTBEAT_S, why="while arming: a drive that does not arm"
    )
    for axis in ("steering", "drive")
}
"""Where role or phase make a difference."""

DRIVING_SHOWS_S = {Phase.ARMING: 0.6, Phase.TURNING: 0.3, Phase.STRAIGHT: 0.3}
"""Until all of 0.2 s of setpoints are beyond the limit, and 0.1 s of way in it; while arming from
the start on: the leader begins to drive 0.05 s later, 0.2/0.3 of 1 m/s take 0.35 s at 2 m/s2."""

STEERING_SHOWS_S = {
    Role.LEADER: {Phase.ARMING: 1.9, Phase.TURNING: BEFORE_SWERVE_S + 0.5},
    Role.FOLLOWER: {Phase.ARMING: 2.4, Phase.TURNING: BEFORE_SWERVE_S + 1.5},
}
"""The fork's angle approaches asin(0.125) with a time constant of 0.25 s from the swerve on (1 s
after the start, or 0.5 s after the fault); 0.1 rad of it, and then 0.2 s of setpoints beyond, have
to pass. A follower comes 0.45 m later. On a straight nobody asks the fork to turn."""


def expected(role: Role, phase: Phase, device: str, kind: str) -> Row:
    """The row of a fault in a phase. Raises KeyError for a fault without one."""
    row = EXPECTED[device][kind]
    for where in ((role, phase), (role, None), (None, phase)):
        if (*where, device, kind) in _SPECIAL:
            row = _SPECIAL[*where, device, kind]
            break
    if row.shows is Shows.DRIVING:
        return row._replace(latency_s=row.latency_s + DRIVING_SHOWS_S[phase])
    if row.shows is Shows.STEERING:
        shows_s = STEERING_SHOWS_S[role].get(phase)
        return row._replace(latency_s=shows_s or 0.0, may_drive=shows_s is None)
    return row
