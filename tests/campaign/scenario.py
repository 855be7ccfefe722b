"""The fleets of the campaign, and how they get to where something breaks.

The fault is on the head of the chain (`leader`, two robots), or on a robot that follows and is
followed (`follower`, three robots). Cars, spacing (0.45 m) and speed (1 m/s) are those of the
shipped fleet `demo`, its failsafe table is the default one, as on a robot.
"""

from enum import StrEnum

from config.failsafe import Failsafe, Reaction
from config.fleet import Fleet, Segment
from config.loader import load_fleet, shipped_fleet_path
from groundstation.lockstep import READY_LIMIT_S, Lockstep, LockstepFailed

SPEED_MPS = 1.0
TURN_RADPS = 0.5
LEAD_IN_S = 6.0
"""From rough start poses to the wanted places."""
BEFORE_SWERVE_S = 0.5


class Role(StrEnum):
    """Whose hardware breaks."""

    LEADER = "leader"
    FOLLOWER = "follower"


class Phase(StrEnum):
    """When it breaks: while the drives are being armed, shortly before the turn changes sides, or
    while all drive straight on."""

    ARMING = "arming"
    TURNING = "turning"
    STRAIGHT = "straight"


ROBOTS = {Role.LEADER: ("r1", "r2"), Role.FOLLOWER: ("r1", "r2", "r3")}
FAULTY = {Role.LEADER: "r1", Role.FOLLOWER: "r2"}

_SWERVES = [(1.0, 0.0), (2.0, -TURN_RADPS), (60.0, TURN_RADPS)]
_MISSIONS = {
    Phase.ARMING: _SWERVES,
    Phase.TURNING: [(LEAD_IN_S + BEFORE_SWERVE_S, -TURN_RADPS), (60.0, TURN_RADPS)],
    Phase.STRAIGHT: [(60.0, 0.0)],
}


def fleet_of(role: Role, phase: Phase) -> Fleet:
    """The first two or three cars of fleet `demo` on the mission of a phase."""
    fleet = load_fleet(shipped_fleet_path("demo")).fleet
    warn = Reaction(after_s=1.0, action="warn")
    table = Failsafe(ground_lost=warn)
    robots = {
        name: fleet.robots[name].model_copy(update={"failsafe": table}) for name in ROBOTS[role]
    }
    segments = [
        Segment(duration_s=duration_s, speed_mps=SPEED_MPS, fork_rate_radps=rate)
        for duration_s, rate in _MISSIONS[phase]
    ]
    mission = fleet.mission.model_copy(update={"segments": segments})
    return fleet.model_copy(update={"robots": robots, "mission": mission})


def behind(fleet: Fleet, name: str) -> list[str]:
    """A robot and all that follow it, from front to back."""
    chain = [name]
    for follower in fleet.followers_of(name):
        chain += behind(fleet, follower)
    return chain


def bring_to(lockstep: Lockstep, phase: Phase) -> None:
    """Drive on to the moment at which the phase's fault may begin.

    Raises LockstepFailed where a healthy fleet does not get there.
    """
    if phase is Phase.ARMING:
        if not lockstep.run_until(lambda: _all_ready(lockstep), READY_LIMIT_S):
            raise LockstepFailed("the fleet does not become ready")
        return
    lockstep.start_mission()
    lockstep.run_for(LEAD_IN_S)


def _all_ready(lockstep: Lockstep) -> bool:
    statuses = lockstep.statuses
    return len(statuses) == len(lockstep.stations) and all(s.ready for s in statuses.values())
