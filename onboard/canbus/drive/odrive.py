"""Driver of one ODrive axis: CANSimple, firmware 0.6 or 0.5, without input and output.

Facts that shape it: there is no acknowledgement, so arming waits for a heartbeat newer than the
request; Procedure_Result stays BUSY in closed loop from 0.6.11 on, so it is never waited for;
only setpoints surely feed the drive's watchdog, so one is sent in every cycle from the first
after the request to arm; the drive may leave closed loop with error 0, so the state decides, not
the error word. The driver never re-arms by itself, and sends nothing but the emergency stop to a
drive whose heartbeat is silent.
"""

import math

from config.can.frame import Frame
from config.can.odrive import AxisCodecs, AxisState, ControlMode
from config.fleet import Failsafe
from onboard.canbus.drive.driver import MotorFeedback, MotorState
from onboard.canbus.drive.odrive_frames import Content, DriveLimits, OdriveFrames
from onboard.canbus.drive.odrive_inputs import OdriveInputs
from onboard.canbus.drive.variant import OdriveVariant, Report, variant_06

TRANSITION_LIMIT_S = 1.0
SETTLING_S = 0.02
"""A heartbeat this shortly after a request may have been on its way before the drive acted."""
ESTOP_FRAMES = 3
ESTOP_SPACING_S = 0.009
"""A little under the 10 ms that are meant, so that jitter does not cost a cycle."""

_POWERED = (MotorState.ARMING, MotorState.ACTIVE, MotorState.STOPPING)
_CONTROLLED = (ControlMode.VELOCITY_CONTROL, ControlMode.POSITION_CONTROL)


class OdriveAxis:
    """One axis in velocity control (drive, m/s) or position control (steering, rad).

    The drive's position at power-up is not the joint's: `align` keeps the difference in this
    driver (a software offset), which needs no write to the drive. Implements `MotorDriver`.
    """

    def __init__(
        self,
        codecs: AxisCodecs,
        mode: ControlMode,
        revolutions_per_unit: float,
        timeouts: Failsafe,
        limits: DriveLimits | None = None,
        variant: OdriveVariant | None = None,
    ) -> None:
        """Without a `variant` the firmware is 0.6.

        Raises ValueError for a mode other than velocity and position control.
        """
        if mode not in _CONTROLLED:
            raise ValueError(f"control mode {mode.name}: only velocity and position are driven")
        self._variant = variant or variant_06(codecs)
        clear = self._variant.clear_errors
        self._make = OdriveFrames(codecs, mode, revolutions_per_unit, limits, clear)
        self._inputs = OdriveInputs(codecs, self._variant, timeouts)
        self._is_position = mode is ControlMode.POSITION_CONTROL
        self._revolutions_per_unit = revolutions_per_unit
        self._zero_rev = None if self._is_position else 0.0
        self._state = MotorState.OFFLINE
        self._reason = "no heartbeat yet"
        self._fault_bits = 0
        self._requests: list[Content] = []
        self._t_request_s = -math.inf
        self._command: float | None = None
        self._hold_rev: float | None = None
        self._estops_left = 0
        self._t_estop_s = -math.inf

    @property
    def feedback(self) -> MotorFeedback:
        """What is known of the drive now, in joint units."""
        inputs = self._inputs
        velocity = None
        if inputs.estimates is not None:
            velocity = inputs.estimates.vel_estimate / self._revolutions_per_unit
        return MotorFeedback(
            state=self._state,
            reason=self._reason,
            faults=self._variant.error_names(self._fault_bits),
            position=self._joint_position(),
            velocity=velocity,
            t_estimate_s=inputs.t_estimate_s if inputs.estimates else None,
            t_heartbeat_s=inputs.t_heartbeat_s if inputs.heartbeat else None,
            current_a=inputs.current_a,
            bus_voltage_v=inputs.bus_voltage_v,
            temperature_degc=inputs.temperature_degc,
            firmware_problem=inputs.firmware_problem,
            watchdog_expired=bool(self._fault_bits & self._variant.watchdog),
        )

    def on_frame(self, frame: Frame) -> None:
        """Take a frame from the bus; `tick` judges what it says."""
        self._inputs.on_frame(frame)

    def align(self, joint_angle_rad: float) -> str | None:
        """Take the present position as this joint angle; returns why not, or None where done."""
        estimates = self._inputs.estimates
        if self._state in _POWERED:
            return f"alignment needs an idle drive, it is {self._state.name}"
        if estimates is None or not math.isfinite(estimates.pos_estimate):
            return "alignment needs a position from the drive"
        if not math.isfinite(joint_angle_rad):
            return f"alignment needs a finite joint angle, got {joint_angle_rad}"
        self._zero_rev = estimates.pos_estimate - joint_angle_rad * self._revolutions_per_unit
        return None

    def difference(self, joint_angle_rad: float) -> float | None:
        """Position by the drive minus that by another sensor [rad]; None before `align`."""
        position = self._joint_position()
        return None if position is None else position - joint_angle_rad

    def arm(self) -> str | None:
        """Ask for closed-loop control; returns why not, or None where arming begins."""
        if self._state is not MotorState.IDLE:
            return f"drive is {self._state.name}: {self._reason}"
        if self._zero_rev is None:
            return "drive is not aligned with the joint's absolute encoder"
        self._enter(MotorState.ARMING, "arming", self._make.arming())
        return None

    def command(self, value: float) -> None:
        """Setpoint [m/s or rad] for the next `tick` only; a value that is not finite is a fault.

        Without a command a tick sends the neutral setpoint: velocity 0, or the position held.
        """
        if math.isfinite(value):
            self._command = value
        elif self._state in _POWERED:
            self._fault(f"setpoint {value} is not finite")

    def disarm(self) -> None:
        """Let go of the motor; neutral setpoints go on until the drive says that it is idle."""
        if self._state in (MotorState.ARMING, MotorState.ACTIVE):
            self._enter(MotorState.STOPPING, "disarming", [self._make.idle()])

    def estop(self) -> None:
        """Send the emergency stop three times, 10 ms apart, and latch FAULT. The motor coasts."""
        if self._state is not MotorState.FAULT:
            self._enter(MotorState.FAULT, "emergency stop", [])
        self._estops_left = ESTOP_FRAMES
        self._t_estop_s = -math.inf

    def clear_faults(self) -> None:
        """An operator's reset: clear the drive's errors; what still stands faults again."""
        if self._state is not MotorState.FAULT:
            return
        requests = [self._make.idle(), self._make.clear_errors]
        self._enter(MotorState.OFFLINE, "waiting for a heartbeat after the reset", requests)
        self._fault_bits = 0
        self._estops_left = 0

    def tick(self, now_s: float) -> list[Frame]:
        """Check timeouts and return everything to send in this cycle, the setpoint included."""
        self._judge(now_s)
        contents = self._due(now_s)
        if self._state in _POWERED:
            contents.append(self._setpoint())
        self._command = None
        return [Frame(can_id, data, now_s) for can_id, data in contents]

    def _due(self, now_s: float) -> list[Content]:
        """Requests, unless the drive is silent, and the emergency stop in any case."""
        due, self._requests = self._requests, []
        if due:
            self._t_request_s = now_s
        if self._inputs.heartbeat_problem(now_s):
            due = []
        if self._estops_left and now_s - self._t_estop_s >= ESTOP_SPACING_S:
            self._estops_left -= 1
            self._t_estop_s = now_s
            due.append(self._make.estop())
        return due

    def _setpoint(self) -> Content:
        command = self._command if self._state is MotorState.ACTIVE else None
        if not self._is_position:
            return self._make.velocity(command or 0.0)
        assert self._zero_rev is not None, "arm() refuses an axis that is not aligned"
        assert self._inputs.estimates is not None, "_judge() faults without estimates"
        if command is not None:
            self._hold_rev = None
            return self._make.position(self._zero_rev + command * self._revolutions_per_unit)
        if self._hold_rev is None:
            self._hold_rev = self._inputs.estimates.pos_estimate
        return self._make.position(self._hold_rev)

    def _judge(self, now_s: float) -> None:
        """Compare what the drive says, or does not say, with what this driver expects."""
        inputs = self._inputs
        silence = inputs.heartbeat_problem(now_s)
        problem = silence or inputs.estimate_problem(now_s)
        if problem is not None:
            self._on_bad_feedback(problem, disarm=silence is None)
        elif inputs.heartbeat is not None and not self._requests:
            if inputs.t_heartbeat_s > self._t_request_s + SETTLING_S:
                self._on_heartbeat(inputs.heartbeat)
            self._check_transition(now_s - self._t_request_s, inputs.heartbeat)

    def _check_transition(self, waited_s: float, heartbeat: Report) -> None:
        in_transition = self._state in (MotorState.ARMING, MotorState.STOPPING)
        if in_transition and waited_s > TRANSITION_LIMIT_S:
            self._fault(
                f"{self._reason} not done after {waited_s:.2f} s, limit "
                f"{TRANSITION_LIMIT_S:.2f} s: {self._variant.describe(heartbeat)}"
            )

    def _on_bad_feedback(self, problem: str, disarm: bool) -> None:
        if self._state in _POWERED:
            self._fault(problem, disarm)
        elif self._state is not MotorState.FAULT:
            self._state, self._reason = MotorState.OFFLINE, problem

    def _on_heartbeat(self, heartbeat: Report) -> None:
        if self._state is MotorState.FAULT:
            self._fault_bits |= heartbeat.errors
        elif self._state in _POWERED:
            self._on_powered_heartbeat(heartbeat)
        else:
            self._on_unpowered_heartbeat(heartbeat)

    def _on_unpowered_heartbeat(self, heartbeat: Report) -> None:
        if heartbeat.errors & ~self._variant.initialising:
            self._fault(self._variant.describe(heartbeat))
        elif heartbeat.state == AxisState.CLOSED_LOOP_CONTROL:
            self._fault("drive is in closed-loop control although nobody armed it here")
        elif heartbeat.state == AxisState.IDLE and not heartbeat.errors:
            self._state, self._reason = MotorState.IDLE, "idle"
        else:
            self._state, self._reason = (
                MotorState.OFFLINE,
                f"busy: {self._variant.describe(heartbeat)}",
            )

    def _on_powered_heartbeat(self, heartbeat: Report) -> None:
        in_closed_loop = heartbeat.state == AxisState.CLOSED_LOOP_CONTROL
        if heartbeat.errors:
            self._fault(self._variant.describe(heartbeat))
        elif self._state is MotorState.ACTIVE and not in_closed_loop:
            self._fault(f"left closed-loop control: {self._variant.describe(heartbeat)}")
        elif self._state is MotorState.ARMING and in_closed_loop:
            self._state, self._reason = MotorState.ACTIVE, "in closed-loop control"
        elif self._state is MotorState.STOPPING and heartbeat.state == AxisState.IDLE:
            self._state, self._reason = MotorState.IDLE, "idle"

    def _fault(self, reason: str, disarm: bool = True) -> None:
        """Latch a reason; tell a drive that can hear us to let go."""
        self._enter(MotorState.FAULT, reason, [self._make.idle()] if disarm else [])
        self._fault_bits = self._inputs.heartbeat.errors if self._inputs.heartbeat else 0

    def _enter(self, state: MotorState, reason: str, requests: list[Content]) -> None:
        self._state, self._reason, self._requests = state, reason, requests
        self._command = self._hold_rev = None

    def _joint_position(self) -> float | None:
        if self._inputs.estimates is None or self._zero_rev is None:
            return None
        return (self._inputs.estimates.pos_estimate - self._zero_rev) / self._revolutions_per_unit
