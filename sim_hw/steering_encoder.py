"""Emulated absolute encoder of the steering angle: `SteerEnc_Angle`, protected, 100 Hz."""

from numpy.random import Generator

from config.can.codec import Codec
from config.can.frame import Frame
from config.can.vehicle import SteeringAngle
from sim_hw.protected import ProtectedSender
from sim_hw.timing import Cycle, DeviceClock

_CLOCK_RANGE_S = 6.5536


class SteeringEncoder:
    """Reports the true steering angle with white noise, from a random moment after `t_s` on.

    Set `silent` to keep its frames off the bus, `slipped_rad` for an encoder that has slipped.
    """

    def __init__(
        self, codec: Codec[SteeringAngle], std_rad: float, t_s: float, rng: Generator
    ) -> None:
        self._sender = ProtectedSender(codec)
        self._std_rad = std_rad
        self._rng = rng
        self._cycle = Cycle(t_s + rng.random() * codec.cycle_time_s, codec.cycle_time_s)
        self._clock = DeviceClock(t_s, rng.random() * _CLOCK_RANGE_S)
        self.silent = False
        self.slipped_rad = 0.0

    @property
    def next_due_s(self) -> float:
        """When the next frame is due."""
        return self._cycle.next_s

    def advance(self, t_s: float, angle_rad: float, rate_radps: float) -> list[Frame]:
        """Frames due at `t_s`, given the true angle and its rate."""
        if not self._cycle.due(t_s) or self.silent:
            return []
        row = SteeringAngle(
            angle_valid=1,
            angle_referenced=1,
            fault_magnet=0,
            fault_internal=0,
            angle=angle_rad + self.slipped_rad + self._std_rad * self._rng.standard_normal(),
            rate=rate_radps,
            sample_time=self._clock.read_ms(t_s),
        )
        return [self._sender.frame(t_s, row)]
