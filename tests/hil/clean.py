"""How a run on emulated hardware has to end: all robots stand, and nothing went wrong unasked."""

from collections.abc import Collection

from groundstation.lockstep import AT_REST, Lockstep

STANDING_MPS = 0.02
STOP_LIMIT_S = 3.0
LATCHED = ("FAULT", "ESTOP")


def standing(lockstep: Lockstep, name: str) -> bool:
    """Whether the robot truly stands, whatever it believes."""
    return abs(lockstep.simulation.robots[name].truth.speed_mps) < STANDING_MPS


def assert_ends_well(lockstep: Lockstep, broken: Collection[str] = ()) -> None:
    """Stop whoever still drives, and look back.

    All robots stand in the end. Those that the test has not `broken` are in no fault, nothing of
    theirs was blocked, nothing could not be sent, and no frame was lost or in error.
    """
    for name, station in lockstep.stations.items():
        if station.running and station.robot.state not in AT_REST:
            lockstep.command(name, "stop")
    names = list(lockstep.stations)
    assert lockstep.run_until(lambda: all(standing(lockstep, n) for n in names), STOP_LIMIT_S)
    assert lockstep.run_until(lambda: lockstep.at_rest, STOP_LIMIT_S)
    lockstep.run_for(0.2)  # a status message of every robot
    problems = [
        f"{name}: {problem}"
        for name in names
        if name not in broken
        for problem in _problems(lockstep, name)
    ]
    assert problems == []
    assert all(standing(lockstep, name) for name in names)


def _problems(lockstep: Lockstep, name: str) -> list[str]:
    status = lockstep.statuses[name]
    counts = {
        "frames blocked": status.blocked_frames,
        "frames not sent": status.bus.send_failures,
        "error frames": status.bus.error_frames,
        "frames lost": lockstep.stations[name].host_bus.lost,
    }
    found = [f"{count} {what}" for what, count in counts.items() if count]
    if status.state in LATCHED:
        found.append(f"{status.state}: {status.reason}")
    return found
