"""What the safety checks look at: ages and health, gathered once per cycle by the robot's step."""

from dataclasses import dataclass

from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.safety.states import State


@dataclass(frozen=True, slots=True)
class LeaderSeen:
    """The leader of a follower; `age_s` and `state` are None until its first message.

    `problem` is why its message is of no use although it came in time.
    """

    name: str
    age_s: float | None
    state: str | None
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class DriveSeen:
    """One motor drive: its driver's state and reason, and the ages of what it sends.

    Ages are None until the first message.
    """

    state: MotorState
    reason: str
    heartbeat_age_s: float | None
    estimate_age_s: float | None


@dataclass(frozen=True, slots=True)
class Observations:
    """One look at everything that can stop the robot or keep it from arming.

    `leader` is None for a robot without one. `bearing_age_s` is the age of the newest bearing
    that the robot needs (a follower: of its leader), None if there was none. The `*_problem`
    texts are the devices' own complaints, `estimate_problem` is the estimator's. `loop_late_s`
    is how late this cycle began. `estop_by` names who asked for the emergency stop.
    """

    state: State
    leader: LeaderSeen | None
    bearing_age_s: float | None
    bearing_problem: str | None
    estimate_problem: str | None
    drive: DriveSeen
    steering: DriveSeen
    encoder_age_s: float | None
    encoder_problem: str | None
    bus_state: BusState
    bus_reason: str
    loop_late_s: float
    estop_by: str | None
