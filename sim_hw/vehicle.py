"""True motion of one car-like robot with a driven and steered front wheel.

The paper's model (3) with the input of the hardware, the steering rate w:
    x' = v cos(theta + delta), y' = v sin(theta + delta), theta' = v sin(delta) / d, delta' = w
for the front-wheel midpoint (x, y), body heading theta, steering angle delta, front-wheel speed v
and wheelbase d.
"""

import math
from typing import NamedTuple


class TruthState(NamedTuple):
    """Where a robot really is: front-wheel midpoint [m], angles [rad], front-wheel speed [m/s]."""

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    steering_rad: float
    speed_mps: float


class Vehicle:
    """Pose and steering angle, integrated by the midpoint rule.

    `heading_rad` is not wrapped: it counts full turns.
    """

    __slots__ = ("_wheelbase_m", "heading_rad", "speed_mps", "steering_rad", "x_m", "y_m")

    def __init__(self, wheelbase_m: float, x_m: float, y_m: float, heading_rad: float) -> None:
        self._wheelbase_m = wheelbase_m
        self.x_m = x_m
        self.y_m = y_m
        self.heading_rad = heading_rad
        self.steering_rad = 0.0
        self.speed_mps = 0.0

    def step(self, speed_mps: float, steering_rad: float, dt_s: float) -> None:
        """Move for `dt_s` to the given speed and steering angle, both changing evenly until then.

        The wheel and the fork are moved by their motors, so their values at the end of the step
        are known; speed and steering angle in between are taken at its middle.
        """
        middle_speed = 0.5 * (self.speed_mps + speed_mps)
        middle_steering = 0.5 * (self.steering_rad + steering_rad)
        yaw_rate = middle_speed * math.sin(middle_steering) / self._wheelbase_m
        course = self.heading_rad + 0.5 * dt_s * yaw_rate + middle_steering
        self.x_m += dt_s * middle_speed * math.cos(course)
        self.y_m += dt_s * middle_speed * math.sin(course)
        self.heading_rad += dt_s * yaw_rate
        self.steering_rad = steering_rad
        self.speed_mps = speed_mps
