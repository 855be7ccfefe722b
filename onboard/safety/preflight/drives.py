"""Both motor drives must be heard and free of faults."""

from config.fleet import Robot
from onboard.canbus.drive.driver import MotorState
from onboard.safety.observations import DriveSeen, Observations


def check(seen: Observations, _settings: Robot) -> str | None:
    """Reason where a drive is offline or in fault."""
    problems = [_problem("steering", seen.steering), _problem("drive", seen.drive)]
    return "; ".join(problem for problem in problems if problem) or None


def _problem(name: str, motor: DriveSeen) -> str | None:
    if motor.state is MotorState.OFFLINE:
        return f"{name}: drive is offline, {motor.reason}"
    if motor.state is MotorState.FAULT:
        return f"{name}: {motor.reason}; remove the cause, then reset"
    return None
