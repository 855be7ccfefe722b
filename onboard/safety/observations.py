"""What the safety checks look at: ages and health, gathered once per cycle by the robot's step."""

from dataclasses import dataclass
from typing import NamedTuple

from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.safety.states import State


@dataclass(frozen=True, slots=True)
class LeaderSeen:
    """The leader of a follower; `age_s` and `state` are None until its first message.

    `problem` is why its message is of no use although it came in time. `offset_s` is how old its
    newest messages were on arrival, at the least: the difference of the two computers' wall clocks
    and the network's delay together.
    """

    name: str
    age_s: float | None
    state: str | None
    problem: str | None = None
    offset_s: float | None = None


@dataclass(frozen=True, slots=True)
class DriveSeen:
    """One motor drive: its driver's state and reason, and the ages of what it sends.

    Ages, voltage and temperature are None until the first message. `firmware` is why its firmware
    is not what the fleet file says.
    """

    state: MotorState
    reason: str
    heartbeat_age_s: float | None
    estimate_age_s: float | None
    watchdog_expired: bool = False
    supply_v: float | None = None
    temperature_degc: float | None = None
    firmware: str | None = None


class Response(NamedTuple):
    """What a joint does, and the least and the most that its setpoints have asked for lately."""

    measured: float
    least: float
    most: float

    @property
    def beyond(self) -> float:
        """How far outside what was asked for."""
        return max(self.least - self.measured, self.measured - self.most, 0.0)


@dataclass(frozen=True, slots=True)
class EstimateSeen:
    """What is wrong with the estimate, in words, by kind; None where nothing is.

    `mutual_age_s` is the age of the leader's last look at this robot, None before the first.
    """

    lost: str | None = None
    unobservable: str | None = None
    nis: str | None = None
    range_uncertain: str | None = None
    too_near: str | None = None
    mutual_age_s: float | None = None


@dataclass(frozen=True, slots=True)
class SafetyNodeSeen:
    """The safety node's last status; only where one was ever heard."""

    age_s: float
    button: bool
    latched: bool
    power: bool


@dataclass(frozen=True, slots=True)
class Observations:
    """One look at everything that can stop the robot or keep it from arming.

    `leader` is None for a robot without one. `bearing_age_s` is the age of the newest bearing
    that the robot needs (a follower: of its leader), None if there was none, 0 where it needs
    none; `bearings_repeat_s` is for how long all bearings have been the very same. The
    `*_problem` texts are the devices' own complaints, the responses are None where no setpoint
    was sent. `frames_dropped` counts what could not be sent in the last cycle, `loop_late_s` is
    how late this one began, `clock_step_s` how far the wall clock has jumped. `ground_age_s` is
    the age of the ground station's heartbeat, infinite before the first. `estop_by` names who
    asked for the emergency stop. What the shell does not know is None.
    """

    state: State
    leader: LeaderSeen | None
    bearing_age_s: float | None
    bearing_problem: str | None
    bearing_rate_hz: float | None
    bearings_repeat_s: float
    estimate: EstimateSeen
    drive: DriveSeen
    steering: DriveSeen
    encoder_age_s: float | None
    encoder_problem: str | None
    steering_rad: float | None
    disagreement_rad: float | None
    speed_response: Response | None
    steering_response: Response | None
    bus_state: BusState
    bus_reason: str
    bus_load: float
    frames_dropped: int
    loop_late_s: float
    clock_step_s: float
    ground_age_s: float
    safety_node: SafetyNodeSeen | None
    realtime: bool
    free_disk_mb: float | None
    ending: bool
    estop_by: str | None
