"""Emulated absolute encoder of the steering angle: `SteerEnc_Angle`, protected, 100 Hz."""

import math

from numpy.random import Generator

from config.can.codec import Codec
from config.can.frame import Frame
from config.can.vehicle import SteeringAngle
from sim_hw.faults import DeviceFaults, first_too_large
from sim_hw.protected import ProtectedSender
from sim_hw.timing import Cycle, DeviceClock

GARBAGE = (math.pi, 10.0)
"""Largest angle [rad] and rate [rad/s] of an encoder that reports garbage."""

_CLOCK_RANGE_S = 6.5536


class SteeringEncoder:
    """Reports the true steering angle with white noise, from a random moment after `t_s` on."""

    def __init__(
        self,
        codec: Codec[SteeringAngle],
        std_rad: float,
        t_s: float,
        rng: Generator,
        fault_rng: Generator,
    ) -> None:
        self.faults = DeviceFaults("encoder", fault_rng, GARBAGE, first_too_large())
        self._sender = ProtectedSender(codec)
        self._std_rad = std_rad
        self._rng = rng
        self._cycle = Cycle(t_s + rng.random() * codec.cycle_time_s, codec.cycle_time_s)
        self._clock = DeviceClock(t_s, rng.random() * _CLOCK_RANGE_S)

    @property
    def next_due_s(self) -> float:
        """When the next frame is due."""
        return self._cycle.next_s

    def advance(self, t_s: float, angle_rad: float, rate_radps: float) -> list[Frame]:
        """Frames due at `t_s`, given the true angle and its rate."""
        if not self._cycle.due(t_s):
            return []
        noisy_rad = angle_rad + self._std_rad * self._rng.standard_normal()
        if self.faults.any and self.faults.skips("angle"):
            return []
        told_rad, told_radps = self.faults.distort((noisy_rad, rate_radps))
        failed = self.faults.any and self.faults.has("failed")
        row = SteeringAngle(
            angle_valid=not failed,
            angle_referenced=1,
            fault_magnet=failed,
            fault_internal=failed,
            angle=told_rad,
            rate=told_radps,
            sample_time=self._clock.read_ms(t_s),
        )
        return [self._sender.frame(t_s, row)]
