"""The devices on one robot's bus behind one face: frames in, measurements and frames out."""

import math

from config.angles import wrap
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import ControlMode
from config.can.vehicle import EstopSource, HostState
from config.fleet import Robot
from config.messages import DriveHealth
from onboard.canbus.bearing_sensor import Bearing, BearingSensor, BearingSet
from onboard.canbus.drive.driver import MotorDriver, MotorFeedback, MotorState
from onboard.canbus.drive.odrive import OdriveAxis
from onboard.canbus.drive.queries import OdriveQueries
from onboard.canbus.drive.variant import variant_of
from onboard.canbus.host import BearingOrders, HostFrames
from onboard.canbus.safety_node import SafetyNode
from onboard.canbus.steering_encoder import SteeringEncoder
from onboard.control.steering import WheelSetpoint
from onboard.role import Observation, Odometry
from onboard.safety.observations import DriveSeen, Response
from onboard.safety.response_watch import ResponseWatch


class Hardware:
    """Two drives, the steering encoder and the bearing sensor of one robot."""

    def __init__(self, robot: Robot, database: CanDatabase) -> None:
        vehicle, table, aux = robot.vehicle, robot.failsafe, database.vehicle_aux()
        steering = variant_of(database, vehicle.steering.node, vehicle.steering.firmware)
        drive = variant_of(database, vehicle.drive.node, vehicle.drive.firmware)
        self._queries = OdriveQueries(steering), OdriveQueries(drive)
        self.steering = OdriveAxis(
            database.axis(vehicle.steering.node),
            ControlMode.POSITION_CONTROL,
            vehicle.steering.revolutions_per_unit,
            table,
            variant=steering,
        )
        self.drive = OdriveAxis(
            database.axis(vehicle.drive.node),
            ControlMode.VELOCITY_CONTROL,
            vehicle.drive.revolutions_per_unit,
            table,
            variant=drive,
        )
        sensor_codecs = database.bearing_sensor(robot.bearing_sensor.unit)
        self.sensor = BearingSensor(sensor_codecs, robot.bearing_sensor)
        self.encoder = SteeringEncoder(aux, table.encoder_stale.after_s)
        self.safety_node = SafetyNode(aux)
        self._orders = BearingOrders(sensor_codecs, robot.bearing_sensor.rate_hz)
        self._host = HostFrames(aux)
        self._timeout_s = table.drive_estimate_stale.after_s
        self._assumed_std_rad = robot.bearing_sensor.std_rad
        self._steering_rad: float | None = None
        self._rate_radps = 0.0
        self._setpoint: WheelSetpoint | None = None
        self._responses = ResponseWatch()
        self.looks = 0

    @property
    def axes(self) -> tuple[MotorDriver, MotorDriver]:
        """Steering and drive."""
        return self.steering, self.drive

    def take(self, frames: list[Frame], dt_s: float) -> None:
        """Hand the frames of the last `dt_s` to the devices; each picks its own."""
        for frame in frames:
            self.steering.on_frame(frame)
            self.drive.on_frame(frame)
            self.encoder.on_frame(frame)
            self.safety_node.on_frame(frame)
            self.sensor.on_frame(frame)
        angle_rad = self.encoder.angle_rad
        if angle_rad is not None and self._steering_rad is not None and dt_s > 0:
            self._rate_radps = wrap(angle_rad - self._steering_rad) / dt_s
        self._steering_rad = angle_rad

    def odometry(self, now_s: float) -> Odometry | None:
        """Own motion; None while the drive or the steering encoder has not spoken lately.

        The steering rate is the difference of the last two angles over the time between the
        steps, so that its integral is the angle itself.
        """
        drive = self.drive.feedback
        if drive.velocity is None or drive.t_estimate_s is None or self._steering_rad is None:
            return None
        if not math.isfinite(drive.velocity) or now_s - drive.t_estimate_s > self._timeout_s:
            return None
        if self.encoder.problem(now_s) is not None:
            return None
        return Odometry(drive.velocity, self._steering_rad, self._rate_radps)

    def observations(self, now_s: float) -> list[Observation]:
        """Identified bearings that have come in since the last call, in `looks` looks."""
        looks = self.sensor.take(now_s)
        self.looks = len(looks)
        return [
            self._observation(seen, look, now_s)
            for look in looks
            for seen in look.targets
            if seen.target is not None
        ]

    def arm(self) -> str | None:
        """Align the steering and arm both drives; returns why not, or None where it begins."""
        if self._steering_rad is None:
            return "steering encoder gives no angle"
        return self.steering.align(self._steering_rad) or self.steering.arm() or self.drive.arm()

    def steering_disagreement_rad(self) -> float | None:
        """Angle by the steering drive minus that by the absolute encoder; None before arming.

        Both may be 10 ms old: at 4 rad/s that alone is 0.08 rad.
        """
        return None if self._steering_rad is None else self.steering.difference(self._steering_rad)

    @property
    def speed_mps(self) -> float:
        """Of the wheel, as its drive has reported it last; 0 before."""
        return self.drive.feedback.velocity or 0.0

    def speed_response(self) -> Response | None:
        """Wheel speed against its setpoints; call it once per cycle."""
        return self._responses.speed(self.drive.feedback)

    def steering_response(self) -> Response | None:
        """Steering angle against its setpoints."""
        return self._responses.angle(self.steering.feedback, self._steering_rad)

    def command(self, setpoint: WheelSetpoint) -> None:
        """Setpoints of this cycle."""
        self._setpoint = setpoint
        self.steering.command(setpoint.steering_rad)
        self.drive.command(setpoint.speed_mps)

    def disarm(self) -> None:
        """Let go of both motors."""
        for axis in self.axes:
            axis.disarm()

    def estop(self) -> None:
        """Emergency stop of both drives."""
        for axis in self.axes:
            axis.estop()

    def clear_faults(self) -> None:
        """An operator's reset of both drives."""
        for axis in self.axes:
            axis.clear_faults()

    @property
    def active(self) -> bool:
        """Both drives in closed-loop control."""
        return all(axis.feedback.state is MotorState.ACTIVE for axis in self.axes)

    @property
    def powered(self) -> bool:
        """Any drive armed, or on its way in or out."""
        powered = (MotorState.ARMING, MotorState.ACTIVE, MotorState.STOPPING)
        return any(axis.feedback.state in powered for axis in self.axes)

    def frames(self, now_s: float, state: HostState, estop: EstopSource) -> list[Frame]:
        """Everything to send in this cycle, most urgent first."""
        self._responses.ask(now_s, self._setpoint, self.active)
        self._setpoint = None
        return [
            *self._host.tick(now_s, state, estop),
            *self.steering.tick(now_s),
            *self.drive.tick(now_s),
            *self._orders.tick(now_s),
            *(frame for queries in self._queries for frame in queries.tick(now_s)),
        ]

    def _observation(self, seen: Bearing, look: BearingSet, now_s: float) -> Observation:
        assert seen.target is not None, "unidentified targets are left out"
        age_s = max(0.0, now_s - look.t_capture_s)
        body_rad = seen.bearing_rad
        if look.frame == "fork":
            body_rad += (self._steering_rad or 0.0) - age_s * self._rate_radps
        std_rad = seen.std_rad or self._assumed_std_rad
        return Observation(seen.target, seen.bearing_rad, wrap(body_rad), std_rad, age_s)


def drive_seen(driver: MotorDriver, now_s: float) -> DriveSeen:
    """A drive as the safety checks see it."""
    feedback = driver.feedback
    return DriveSeen(
        feedback.state,
        feedback.reason,
        None if feedback.t_heartbeat_s is None else now_s - feedback.t_heartbeat_s,
        None if feedback.t_estimate_s is None else now_s - feedback.t_estimate_s,
        feedback.watchdog_expired,
        feedback.bus_voltage_v,
        feedback.temperature_degc,
        feedback.firmware_problem,
    )


def drive_health(feedback: MotorFeedback) -> DriveHealth:
    """A drive as the operator sees it."""
    return DriveHealth(
        feedback.state.name,
        [*feedback.faults] or ([feedback.reason] if feedback.state is MotorState.FAULT else []),
        _finite(feedback.position),
        _finite(feedback.velocity),
        _finite(feedback.bus_voltage_v),
        _finite(feedback.temperature_degc),
    )


def _finite(value: float | None) -> float | None:
    """Not-a-number has no JSON form."""
    return value if value is not None and math.isfinite(value) else None
