"""The car that a recorded unicycle pretends to be.

A unicycle's pose (x, y, heading) with commands (v, omega) is the (x_f, y_f, eta) part of the
paper's model (3) with v the front-wheel speed and omega = d eta/dt. What is left of (3), the body
behind the fork, is made up here so that drive and steering encoder report exactly this motion:

    theta' = v sin(delta) / d,   delta' = omega - theta',   so that eta' = theta' + delta' = omega

With a long wheelbase the body hardly turns, so that slip of the drive does not look like a turn.
The steering angle then winds up: it counts on here, and the encoder reports it wrapped.

MRCLAM records commands. The robots follow them 0.2 s later (turning rates of data set 6 agree best
with its motion capture at 0.2 s for four robots and 0.3 s for the fifth); so does this car.
"""

import math
from collections.abc import Sequence

from sim_hw.dataset.mrclam import OdometryRow

STEP_S = 0.02
RESPONSE_S = 0.2


class VirtualCar:
    """Way driven [m], steering angle [rad] and speed [m/s] by zero-order hold of the commands.

    Starts at `start_s` with the fork straight; before it and after the last command it stands.
    """

    def __init__(self, wheelbase_m: float, odometry: Sequence[OdometryRow], start_s: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._odometry = odometry
        self._t_s = start_s
        self._next = 0
        self.speed_mps = 0.0
        self._rate_radps = 0.0
        self.way_m = 0.0
        self.steering_rad = 0.0

    @property
    def steering_rate_radps(self) -> float:
        """d delta/dt now."""
        return self._rate_radps - self._yaw_rate(self.steering_rad)

    def advance(self, t_s: float) -> None:
        """Move on to this time of the recording."""
        while self._next < len(self._odometry):
            row = self._odometry[self._next]
            if row.t_s + RESPONSE_S > t_s:
                break
            self._move(row.t_s + RESPONSE_S)
            last = self._next == len(self._odometry) - 1
            self.speed_mps = 0.0 if last else row.speed_mps
            self._rate_radps = 0.0 if last else row.rate_radps
            self._next += 1
        self._move(t_s)

    def _move(self, t_s: float) -> None:
        way_s = t_s - self._t_s
        if way_s <= 0.0:
            return
        self._t_s = t_s
        steps = math.ceil(way_s / STEP_S)
        for _ in range(steps):
            self._step(way_s / steps)

    def _step(self, dt_s: float) -> None:
        """Midpoint rule on delta; its error per step is far below the encoder's resolution."""
        middle_rad = self.steering_rad + 0.5 * dt_s * self.steering_rate_radps
        self.way_m += dt_s * self.speed_mps
        self.steering_rad += dt_s * (self._rate_radps - self._yaw_rate(middle_rad))

    def _yaw_rate(self, steering_rad: float) -> float:
        return self.speed_mps * math.sin(steering_rad) / self._wheelbase_m
