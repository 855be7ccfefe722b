"""Everything that the host sends to one ODrive axis, made from joint units."""

from dataclasses import dataclass

from config.can.odrive import AxisCodecs, AxisState, ControlMode, InputMode

Content = tuple[int, bytes]
"""Identifier and data of a frame without its time."""


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Limits to set in the drive at every arming: velocity [joint units per s] and current [A]."""

    velocity: float
    current_a: float


@dataclass(frozen=True, slots=True)
class OdriveFrames:
    """Makes frames for one axis; the drive counts motor revolutions, the caller joint units.

    Feed-forwards are always 0, because their scale is a setting of the drive. How errors are
    cleared depends on the firmware.
    """

    codecs: AxisCodecs
    mode: ControlMode
    revolutions_per_unit: float
    limits: DriveLimits | None
    clear_errors: Content

    def arming(self) -> list[Content]:
        """Mode, limits where there are any, clear, closed loop; in this order."""
        mode, clear = self.codecs.set_controller_mode, self.clear_errors
        frames = [(mode.can_id, mode.pack(self.mode, InputMode.PASSTHROUGH))]
        if self.limits is not None:
            codec = self.codecs.set_limits
            rev_per_s = self.limits.velocity * self.revolutions_per_unit
            frames.append((codec.can_id, codec.pack(rev_per_s, self.limits.current_a)))
        return [*frames, clear, self._axis_state(AxisState.CLOSED_LOOP_CONTROL)]

    def idle(self) -> Content:
        """Let go of the motor."""
        return self._axis_state(AxisState.IDLE)

    def estop(self) -> Content:
        """Disarm at once, with the error ESTOP_REQUESTED."""
        return self.codecs.estop.can_id, self.codecs.estop.pack()

    def velocity(self, value: float) -> Content:
        """Velocity setpoint [joint units per s]."""
        codec = self.codecs.set_input_vel
        return codec.can_id, codec.pack(value * self.revolutions_per_unit, 0.0)

    def position(self, position_rev: float) -> Content:
        """Position setpoint [motor revolutions, as the drive counts them]."""
        codec = self.codecs.set_input_pos
        return codec.can_id, codec.pack(position_rev, 0.0, 0.0)

    def _axis_state(self, state: AxisState) -> Content:
        return self.codecs.set_axis_state.can_id, self.codecs.set_axis_state.pack(state)
