"""From a wanted front-point velocity to setpoints of the two drives, within the robot's limits."""

import math
from typing import NamedTuple

from config import fleet
from onboard.model.relative import BodyVelocity

MIN_DIRECTED_MPS = 0.02
"""Below this the wanted velocity has no usable direction: the fork holds its angle."""


class WheelSetpoint(NamedTuple):
    """Steering angle for a drive in position mode [rad] and front-wheel speed [m/s]."""

    steering_rad: float
    speed_mps: float


class WheelController:
    """Rate and range limits around the last setpoints sent; time comes in as dt."""

    def __init__(self, limits: fleet.Limits, steering_rad: float = 0.0) -> None:
        self._limits = limits
        self._last = WheelSetpoint(steering_rad, 0.0)

    @property
    def last(self) -> WheelSetpoint:
        """The setpoint returned last."""
        return self._last

    def reset(self, steering_rad: float, speed_mps: float = 0.0) -> None:
        """Start again from measured values, so that taking over does not jump."""
        self._last = WheelSetpoint(steering_rad, speed_mps)

    def follow(
        self, dt_s: float, wanted: BodyVelocity, measured_steering_rad: float
    ) -> WheelSetpoint:
        """Setpoints that give the front point the wanted velocity.

        The speed is the part of the wanted velocity along the wheel's measured direction, so a
        wheel that still turns adds no sideways error; the robot never reverses.
        """
        forward, left = wanted
        target = self._last.steering_rad
        if math.hypot(forward, left) >= MIN_DIRECTED_MPS:
            target = math.atan2(left, forward)
        along = forward * math.cos(measured_steering_rad) + left * math.sin(measured_steering_rad)
        return self.drive(dt_s, target, along)

    def drive(self, dt_s: float, steering_rad: float, speed_mps: float) -> WheelSetpoint:
        """Setpoints towards a steering angle and a speed."""
        self._last = WheelSetpoint(
            limited_steering(self._last.steering_rad, steering_rad, self._limits, dt_s),
            limited_speed(self._last.speed_mps, speed_mps, self._limits, dt_s),
        )
        return self._last

    def stop(self, dt_s: float) -> WheelSetpoint:
        """Next setpoint of the stop ramp: fork held, speed down at the deceleration limit."""
        return self.drive(dt_s, self._last.steering_rad, 0.0)


def limited_steering(
    last_rad: float, wanted_rad: float, limits: fleet.Limits, dt_s: float
) -> float:
    """Steering angle clipped to its range, at most rate times dt from the last one."""
    step = limits.steering_rate_radps * dt_s
    clipped = min(max(wanted_rad, -limits.steering_rad), limits.steering_rad)
    return min(max(clipped, last_rad - step), last_rad + step)


def limited_speed(last_mps: float, wanted_mps: float, limits: fleet.Limits, dt_s: float) -> float:
    """Speed clipped to [0, limit], within the acceleration and deceleration limits."""
    clipped = min(max(wanted_mps, 0.0), limits.speed_mps)
    rise, fall = limits.acceleration_mps2 * dt_s, limits.deceleration_mps2 * dt_s
    return min(max(clipped, last_mps - fall), last_mps + rise)
