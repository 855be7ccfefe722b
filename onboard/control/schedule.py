"""What the leader drives: the mission's schedule as setpoints within the robot's limits."""

import math
from bisect import bisect_right
from itertools import accumulate
from typing import NamedTuple

from config import fleet
from onboard.control.steering import WheelSetpoint, limited_speed, limited_steering


class PlannedVelocity(NamedTuple):
    """Inputs of (3): front-wheel speed [m/s] and fork rate omega = d eta/dt [rad/s]."""

    speed_mps: float
    fork_rate_radps: float

    def at_pace(self, pace: float) -> "PlannedVelocity":
        """The same path at `pace` times the speed."""
        return PlannedVelocity(pace * self.speed_mps, pace * self.fork_rate_radps)


class VelocityPlan:
    """The mission's segments over time; each ends where the next begins."""

    def __init__(self, mission: fleet.Mission) -> None:
        self._segments = tuple(mission.segments)
        self._ends_s = tuple(accumulate(segment.duration_s for segment in self._segments))

    @property
    def duration_s(self) -> float:
        """Time of the mission's end [s]."""
        return self._ends_s[-1]

    def at(self, t_s: float) -> PlannedVelocity:
        """Planned inputs at mission time `t_s`; standing still before 0 and from the end on."""
        if not 0.0 <= t_s < self.duration_s:
            return PlannedVelocity(0.0, 0.0)
        segment = self._segments[bisect_right(self._ends_s, t_s)]
        return PlannedVelocity(segment.speed_mps, segment.fork_rate_radps)


class LeaderReference:
    """Integrates the plan into setpoints of the two drives, from standstill to standstill.

    omega turns the fork in the world, so the reference steering angle follows
    delta' = omega - v sin(delta)/d (omega is not a steering rate), with the speed v that the
    acceleration limits allow.
    """

    def __init__(
        self,
        plan: VelocityPlan,
        limits: fleet.Limits,
        wheelbase_m: float,
        steering_rad: float = 0.0,
    ) -> None:
        self._plan = plan
        self._limits = limits
        self._wheelbase_m = wheelbase_m
        self._time_s = 0.0
        self._pace = 1.0
        self._setpoint = WheelSetpoint(steering_rad, 0.0)

    @property
    def time_s(self) -> float:
        """Mission time [s]."""
        return self._time_s

    @property
    def ended(self) -> bool:
        """Whether the schedule is over and the reference speed is down to 0."""
        return self._time_s >= self._plan.duration_s and self._setpoint.speed_mps == 0.0

    def step(self, dt_s: float, pace: float = 1.0) -> WheelSetpoint:
        """Advance mission time by `pace * dt_s` and return the setpoints for its end.

        A pace below 1 drives the same path more slowly: speed and fork rate are scaled as time is.
        The pace changes as fast as the speed may.
        """
        change = dt_s * self._limits.deceleration_mps2 / self._limits.speed_mps
        self._pace += min(max(pace - self._pace, -change), change)
        planned = self._plan.at(self._time_s + self._pace * dt_s / 2).at_pace(self._pace)
        last = self._setpoint
        speed = limited_speed(last.speed_mps, planned.speed_mps, self._limits, dt_s)
        turning = (last.speed_mps + speed) / 2 / self._wheelbase_m
        middle = last.steering_rad + dt_s / 2 * (
            planned.fork_rate_radps - turning * math.sin(last.steering_rad)
        )
        wanted = last.steering_rad + dt_s * (planned.fork_rate_radps - turning * math.sin(middle))
        steering = limited_steering(last.steering_rad, wanted, self._limits, dt_s)
        self._time_s += self._pace * dt_s
        self._setpoint = WheelSetpoint(steering, speed)
        return self._setpoint
