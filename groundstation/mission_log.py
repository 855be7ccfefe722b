"""What the robots' own messages say about a mission: when it ran, whether it ended well."""

from collections.abc import Sequence
from typing import NamedTuple

from config.fleet import Fleet
from config.messages import Motion, Status
from groundstation.formation_tree import leader_of
from groundstation.series import Run
from groundstation.summary import Fault

COMPLETE = "mission complete"
GROUND_STATION = "ground"
"""Source of the events that the ground station itself records, of what robots cannot tell."""
BAD_STATES = frozenset({"FAULT", "ESTOP"})


class Window(NamedTuple):
    """An interval of capture time [ns]; empty when `end_ns` is not after `start_ns`."""

    start_ns: int
    end_ns: int

    @property
    def seconds(self) -> float:
        """Length [s], never negative."""
        return max(0, self.end_ns - self.start_ns) * 1e-9


def mission_window(fleet: Fleet, run: Run) -> Window | None:
    """From mission time 0 to the end of the schedule, or to where the leader left it.

    None when the leader's mission never started.
    """
    running = [
        (row.t_ns, row.mission_time_s)
        for row in run.motion.get(leader_of(fleet), [])
        if row.mission_time_s is not None
    ]
    if not running:
        return None
    t_ns, mission_time_s = running[0]
    start = t_ns - round(mission_time_s * 1e9)
    return Window(start, min(start + round(fleet.mission.duration_s * 1e9), running[-1][0]))


def judged_window(fleet: Fleet, mission: Window | None) -> Window:
    """The part of the mission that is judged."""
    if mission is None:
        return Window(0, 0)
    from_ns = round(fleet.mission.acceptance.from_s * 1e9)
    return Window(mission.start_ns + from_ns, mission.end_ns)


def unfinished(fleet: Fleet, run: Run, mission: Window | None) -> dict[str, str]:
    """Per robot, why the mission does not count as completed; nothing when it does."""
    leader = leader_of(fleet)
    if mission is None:
        return {leader: f"{leader} never started it"}
    problems: dict[str, str] = {}
    for name in fleet.robots:
        state, reason = _final_state(run, name)
        if state != "STANDBY":
            told = f" ({reason})" if reason else ""
            problems[name] = f"{name} ended in {state or 'silence'}{told}, not in STANDBY"
        elif not reason.endswith(COMPLETE):
            problems[name] = f"{name} ended with {reason!r}, not with {COMPLETE!r}"
    return problems


def faults(fleet: Fleet, run: Run, origin_ns: int) -> list[Fault]:
    """Every entry of a robot into FAULT or ESTOP, in order of time."""
    found = [
        Fault(name, round((row.t_ns - origin_ns) * 1e-9, 3), f"{row.state}: {row.reason}")
        for name in fleet.robots
        for row in _entries(run.motion.get(name) or run.status.get(name, []))
    ]
    return sorted(found, key=lambda fault: fault.t_s)


def incidents(run: Run, origin_ns: int) -> list[Fault]:
    """What the ground station saw go wrong outside the robots' own messages."""
    return [
        Fault(name, round((row.t_ns - origin_ns) * 1e-9, 3), row.text)
        for name, rows in run.events.items()
        for row in rows
        if row.source == GROUND_STATION and row.severity == "error"
    ]


def _entries(rows: Sequence[Motion | Status]) -> list[Motion | Status]:
    before = ["", *(row.state for row in rows)]
    return [
        row
        for row, earlier in zip(rows, before, strict=False)
        if row.state in BAD_STATES and earlier != row.state
    ]


def _final_state(run: Run, robot: str) -> tuple[str, str]:
    last = [rows[-1] for rows in (run.motion.get(robot), run.status.get(robot)) if rows]
    if not last:
        return "", ""
    latest = max(last, key=lambda row: row.t_ns)
    return latest.state, latest.reason
