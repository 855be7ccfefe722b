"""What goes on inside an emulated ODrive axis: arming, errors, watchdog, motor control.

Strict where the real drive's behaviour is not known for certain: only setpoints, clearing errors
and entering closed loop reload the watchdog. It counts while the axis is armed. Torque and voltage
control have no model: an axis armed in them coasts.
"""

import math

from config.can.odrive import AxisError, AxisState, ControlMode, InputMode, ProcedureResult
from sim_hw.motor import Motor

INITIALISING_S = 0.5
PROCEDURE_S = 2.0
OVER_SPEED_FACTOR = 1.2

# Looked up a thousand times per simulated second: members of an enumeration are slow to reach.
_IDLE = AxisState.IDLE
_CLOSED_LOOP = AxisState.CLOSED_LOOP_CONTROL
_VELOCITY = int(ControlMode.VELOCITY_CONTROL)
_POSITION = int(ControlMode.POSITION_CONTROL)

_NO_ERROR = AxisError(0)
_PROCEDURES = frozenset(
    {
        AxisState.FULL_CALIBRATION_SEQUENCE,
        AxisState.MOTOR_CALIBRATION,
        AxisState.ENCODER_OFFSET_CALIBRATION,
        AxisState.HOMING,
    }
)


class Axis:
    """State machine and controller of one axis, idle and ready from `t_s` on."""

    def __init__(
        self, motor: Motor, *, t_s: float, velocity_limit_rps: float, watchdog_s: float
    ) -> None:
        self.motor = motor
        self.calibrated = True
        self._configured_limit_rps = velocity_limit_rps
        self._watchdog_s = watchdog_s
        self._moved_s = t_s
        self.boot(t_s, initialised_s=t_s)

    def boot(self, boot_s: float, initialised_s: float) -> None:
        """Start as after loss of power; the drive counts from where the motor is at `boot_s`."""
        self.now_s = self._boot_s = boot_s
        self._initialised_s = initialised_s
        self.state = _IDLE
        self.result = ProcedureResult.SUCCESS
        self.disarm_reason = _NO_ERROR
        self.control_mode: int = _POSITION
        self.input_mode: int = InputMode.PASSTHROUGH
        self.velocity_limit_rps = self._configured_limit_rps
        self._errors = _NO_ERROR
        self._input_position_rev = 0.0
        self._input_velocity_rps = 0.0
        self._offset_rev = -self.motor.position_rev
        self._fed_s = boot_s
        self._procedure_end_s = math.inf

    @property
    def active_errors(self) -> AxisError:
        """Errors that keep the axis from being armed."""
        if self.now_s < self._initialised_s:
            return self._errors | AxisError.INITIALIZING
        return self._errors

    @property
    def armed(self) -> bool:
        """True in closed loop: the motor has power."""
        return self.state is _CLOSED_LOOP

    @property
    def position_rev(self) -> float:
        """Position as the drive counts it."""
        return self.motor.position_rev + self._offset_rev

    def at(self, t_s: float) -> None:
        """Set the time of the commands that follow."""
        if t_s > self.now_s:
            self.now_s = t_s

    def advance(self, t_s: float) -> None:
        """Watch over the axis and move its motor on to `t_s`."""
        dt_s = t_s - self._moved_s
        if dt_s <= 0:
            return
        self._moved_s = t_s
        self.at(t_s)
        if self.state is not _IDLE:
            self._supervise()
        self._control(dt_s)
        if t_s < self._boot_s:
            self._offset_rev = -self.motor.position_rev

    def trip(self, error: AxisError) -> None:
        """Raise an error; an armed axis is disarmed and coasts."""
        self._errors |= error
        self.disarm_reason |= error
        if self.state is not _IDLE:
            self.to_idle(ProcedureResult.DISARMED)

    def to_idle(self, result: ProcedureResult) -> None:
        """Take the power off the motor."""
        self.state = _IDLE
        self.result = result
        self._procedure_end_s = math.inf

    def request_state(self, requested: int) -> None:
        """Set_Axis_State: idle, closed loop, or a procedure; others are refused."""
        if requested == _IDLE:
            if self.state is not _IDLE:
                self.to_idle(ProcedureResult.CANCELLED)
        elif requested == _CLOSED_LOOP:
            self._arm()
        elif requested in _PROCEDURES:
            self._run_procedure(AxisState(requested))
        else:
            self.result = ProcedureResult.INVALID_STATE

    def clear_errors(self) -> None:
        """Forget errors and what disarmed the axis."""
        self._errors = _NO_ERROR
        self.disarm_reason = _NO_ERROR
        if self.state is _IDLE:
            self.result = ProcedureResult.SUCCESS
        self._fed_s = self.now_s

    def input_position(self, position_rev: float) -> None:
        """Setpoint of position control."""
        if self.accepts_input(position_rev):
            self._input_position_rev = position_rev

    def input_velocity(self, velocity_rps: float) -> None:
        """Setpoint of velocity control."""
        if self.accepts_input(velocity_rps):
            self._input_velocity_rps = velocity_rps

    def accepts_input(self, value: float) -> bool:
        """Feed the watchdog; a value that is no number trips the axis instead of moving it."""
        self._fed_s = self.now_s
        if not math.isfinite(value):
            self.trip(AxisError.MISSING_INPUT)
            return False
        return self.input_mode != InputMode.INACTIVE

    def set_position(self, position_rev: float) -> None:
        """Count from here as `position_rev`; only an idle axis obeys."""
        if self.state is _IDLE and math.isfinite(position_rev):
            self._offset_rev = position_rev - self.motor.position_rev

    def _arm(self) -> None:
        if self.active_errors:
            self.result = ProcedureResult.DISARMED
        elif not self.calibrated:
            self.result = ProcedureResult.NOT_CALIBRATED
        elif not self.armed:
            self.state = _CLOSED_LOOP
            self.result = ProcedureResult.BUSY
            self._procedure_end_s = math.inf
            self._input_position_rev = self.position_rev
            self._input_velocity_rps = 0.0
            self._fed_s = self.now_s

    def _run_procedure(self, procedure: AxisState) -> None:
        if self.active_errors:
            self.result = ProcedureResult.DISARMED
            return
        self.state = procedure
        self.result = ProcedureResult.BUSY
        self._procedure_end_s = self.now_s + PROCEDURE_S

    def _supervise(self) -> None:
        if self.state is _CLOSED_LOOP:
            if self.now_s - self._fed_s >= self._watchdog_s:
                self.trip(AxisError.WATCHDOG_TIMER_EXPIRED)
            elif abs(self.motor.velocity_rps) > OVER_SPEED_FACTOR * self.velocity_limit_rps:
                self.trip(AxisError.VELOCITY_LIMIT_VIOLATION)
        elif self.now_s >= self._procedure_end_s:
            self.calibrated = True
            self.to_idle(ProcedureResult.SUCCESS)

    def _control(self, dt_s: float) -> None:
        if self.state is _CLOSED_LOOP and self.control_mode == _VELOCITY:
            self.motor.track_velocity(self._input_velocity_rps, self.velocity_limit_rps, dt_s)
        elif self.state is _CLOSED_LOOP and self.control_mode == _POSITION:
            target_rev = self._input_position_rev - self._offset_rev
            self.motor.track_position(target_rev, self.velocity_limit_rps, dt_s)
        else:
            self.motor.coast(dt_s)
