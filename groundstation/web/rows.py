"""One line of the table: a robot's health, from the latest messages."""

import math
from collections import deque
from collections.abc import Mapping

from config.fleet import Fleet
from config.messages import DriveHealth, RelativeEstimate
from groundstation.known import Known
from groundstation.web.geometry import seen_in_leader_axes, wanted_offset
from groundstation.web.wire import Drive, Row

STATUSES = 50
"""The youngest of a robot's last statuses tells how far the two wall clocks differ."""


class ClockOffsets:
    """How far each robot's wall clock is behind this machine's, transmission time included."""

    def __init__(self) -> None:
        self._ages_s: dict[str, deque[float]] = {}

    def add(self, robot: str, age_s: float) -> None:
        """A status arrived that was `age_s` old by the two clocks."""
        self._ages_s.setdefault(robot, deque(maxlen=STATUSES)).append(age_s)

    def offset_s(self, robot: str) -> float | None:
        """The least age: the clock's offset plus the shortest transmission."""
        ages = self._ages_s.get(robot)
        return min(ages) if ages else None


def row(
    fleet: Fleet,
    name: str,
    fleet_known: Mapping[str, Known],
    now_s: float,
    offset_s: float | None,
    alive: bool | None,
) -> Row:
    """One robot's line at `now_s`."""
    known = fleet_known[name]
    newest, status = known.newest, known.status
    if newest is None or status is None:
        return Row(
            state="" if newest is None else newest.state,
            reason="" if newest is None else newest.reason,
            age_s=None if newest is None else now_s - newest.wall_ns * 1e-9,
            alive=alive,
        )
    relative = known.relative
    place = wanted_offset(fleet.robots[name], relative)
    return Row(
        state=newest.state,
        reason=newest.reason,
        ready=status.ready,
        not_ready=status.not_ready,
        mission_time_s=status.mission_time_s,
        formation=status.formation,
        formation_error_m=_believed_error_m(place, relative),
        true_error_m=_true_error_m(fleet, name, place, fleet_known),
        age_s=round(now_s - newest.wall_ns * 1e-9, 4),
        alive=alive,
        loop_p50_ms=status.loop.p50_ms,
        loop_p99_ms=status.loop.p99_ms,
        overruns=status.loop.overruns,
        realtime=status.loop.realtime,
        bus_state=status.bus.state,
        bus_load=status.bus.load,
        send_failures=status.bus.send_failures,
        blocked_frames=status.blocked_frames,
        steering=_drive(status.steering),
        drive=_drive(status.drive),
        battery_v=_least(status.steering.bus_voltage_v, status.drive.bus_voltage_v),
        clock_offset_ms=None if offset_s is None else round(offset_s * 1e3, 2),
        observability=known.observability,
        nis_state="" if relative is None else relative.nis_state,
        range_state="ok" if relative is None else relative.range_state,
        pose_trusted=known.pose is None or known.pose.trusted,
    )


def _drive(health: DriveHealth) -> Drive:
    return Drive(health.state, health.faults, health.temperature_degc)


def _least(*values: float | None) -> float | None:
    return min((value for value in values if value is not None), default=None)


def _believed_error_m(
    place: tuple[float, float] | None, seen: RelativeEstimate | None
) -> float | None:
    if place is None or seen is None or not seen.valid:
        return None
    forward, left = seen_in_leader_axes(seen)
    return round(math.hypot(forward - place[0], left - place[1]), 4)


def _true_error_m(
    fleet: Fleet, name: str, place: tuple[float, float] | None, known: Mapping[str, Known]
) -> float | None:
    leader = fleet.robots[name].leader
    if place is None or leader is None:
        return None
    own, ahead = known[name].truth, known[leader].truth
    if own is None or ahead is None:
        return None
    dx, dy = own.x_m - ahead.x_m, own.y_m - ahead.y_m
    cos, sin = math.cos(ahead.heading_rad), math.sin(ahead.heading_rad)
    return round(math.hypot(cos * dx + sin * dy - place[0], cos * dy - sin * dx - place[1]), 4)
