"""The motor behind one emulated drive, in motor revolutions."""

import math


class Motor:
    """Motor, gear and load with a first-order response to its drive's command.

    `friction_rps2` is the deceleration [rev/s2] without power; infinite for a gear that holds.
    `stop_rev` is where the mechanics end on either side; infinite for a wheel. A `jammed` motor
    does not turn.
    """

    __slots__ = (
        "_friction_rps2",
        "_lag_s",
        "_stop_rev",
        "jammed",
        "position_rev",
        "velocity_rps",
    )

    def __init__(
        self, lag_s: float, friction_rps2: float = math.inf, stop_rev: float = math.inf
    ) -> None:
        self._lag_s = lag_s
        self._friction_rps2 = friction_rps2
        self._stop_rev = stop_rev
        self.position_rev = 0.0
        self.velocity_rps = 0.0
        self.jammed = False

    def track_velocity(self, target_rps: float, limit_rps: float, dt_s: float) -> None:
        """Approach a velocity, itself held within the drive's velocity limit."""
        target = target_rps
        if not -limit_rps <= target <= limit_rps:
            target = math.copysign(limit_rps, target)
        change = (target - self.velocity_rps) * -math.expm1(-dt_s / self._lag_s)
        self._turn(self.velocity_rps + 0.5 * change, dt_s, self.velocity_rps + change)

    def track_position(self, target_rev: float, limit_rps: float, dt_s: float) -> None:
        """Approach a position, no faster than the drive's velocity limit."""
        way = (target_rev - self.position_rev) * -math.expm1(-dt_s / self._lag_s)
        velocity = way / dt_s
        if not -limit_rps <= velocity <= limit_rps:
            velocity = math.copysign(limit_rps, velocity)
        self._turn(velocity, dt_s, velocity)

    def coast(self, dt_s: float) -> None:
        """Turn on without power until friction has stopped the motor."""
        if self.velocity_rps == 0.0:
            return
        speed = max(abs(self.velocity_rps) - self._friction_rps2 * dt_s, 0.0)
        velocity = math.copysign(speed, self.velocity_rps) if speed else 0.0
        self._turn(0.5 * (self.velocity_rps + velocity), dt_s, velocity)

    def _turn(self, mean_rps: float, dt_s: float, final_rps: float) -> None:
        """Turn at a mean velocity and end with another, or at a mechanical stop."""
        if self.jammed:
            self.velocity_rps = 0.0
            return
        position = self.position_rev + mean_rps * dt_s
        if -self._stop_rev <= position <= self._stop_rev:
            self.position_rev = position
            self.velocity_rps = final_rps
        else:
            self.position_rev = math.copysign(self._stop_rev, position)
            self.velocity_rps = 0.0
