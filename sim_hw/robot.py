"""One simulated robot: its vehicle and the devices on its bus."""

from collections.abc import Iterable, Sequence

from numpy.random import Generator, SeedSequence, default_rng

from config.angles import wrap
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.fleet import Axis as AxisConfig
from config.fleet import Marker, Robot, SimulatedMotor, Simulation
from sim_hw.bearing_sensor import BearingSensor, MarkedVehicle
from sim_hw.motor import Motor
from sim_hw.odrive import OdriveAxis
from sim_hw.steering_encoder import SteeringEncoder
from sim_hw.timing import TOLERANCE_S
from sim_hw.vehicle import TruthState, Vehicle

FRICTION_MPS2 = 1.5
STEERING_STOP_FACTOR = 1.1
DRIVE_LIMIT_FACTOR = 1.2


class SimulatedRobot:
    """Vehicle, steering axis, drive axis, steering encoder and bearing sensor of one robot.

    Without power the drive wheel slows by FRICTION_MPS2 and the fork stays where it is. The fork's
    mechanical stops lie beyond the steering limit, and the drive's own velocity limit lies above
    the speed limit, by the factors above, so that a robot which breaks a limit can be seen to.
    Devices draw from random streams of their own.
    """

    def __init__(
        self,
        config: Robot,
        simulation: Simulation,
        landmarks: Sequence[Marker],
        database: CanDatabase,
        t_s: float,
        seed: SeedSequence,
    ) -> None:
        body, steering, drive, encoder, sensor = (default_rng(s) for s in seed.spawn(5))
        start, self._gear = config.start, config.vehicle
        self.vehicle = Vehicle(config.vehicle.wheelbase_m, start.x_m, start.y_m, start.heading_rad)
        self.marked = MarkedVehicle(self.vehicle, config.markers)
        sign = 1.0 if body.random() < 0.5 else -1.0
        self.odometry_scale = 1.0 + sign * simulation.odometry_scale_error
        self.steering = _steering_axis(config, simulation, database, t_s, steering)
        self.drive = _drive_axis(config, simulation, database, t_s, drive)
        aux = database.vehicle_aux()
        self.encoder = SteeringEncoder(
            aux.steering_angle, simulation.steering_encoder_std_rad, t_s, encoder
        )
        self.sensor = BearingSensor(
            database.bearing_sensor(config.bearing_sensor.unit),
            config.bearing_sensor,
            simulation.bearings,
            landmarks,
            t_s,
            sensor,
        )
        self._steering_motor, self._drive_motor = self.steering.axis.motor, self.drive.axis.motor
        self._t_s = t_s
        self._next_due_s = t_s
        self._sent: list[Frame] = []

    @property
    def truth(self) -> TruthState:
        """Where the robot really is, at the end of the last step."""
        vehicle = self.vehicle
        return TruthState(
            self._t_s,
            vehicle.x_m,
            vehicle.y_m,
            wrap(vehicle.heading_rad),
            vehicle.steering_rad,
            vehicle.speed_mps,
        )

    def deliver(self, frame: Frame) -> None:
        """A frame from the host, on the bus at its `t_s`."""
        self.steering.on_frame(frame, frame.t_s)
        self.drive.on_frame(frame, frame.t_s)
        self._next_due_s = self._t_s

    def collect(self) -> list[Frame]:
        """Frames that went on the bus since the last call, in the order of their `t_s`; frames of
        one instant in the order of their identifiers, as on a bus."""
        frames, self._sent = self._sent, []
        frames.sort(key=_bus_order)
        return frames

    def move(self, t_s: float) -> None:
        """Integrate motors and vehicle to `t_s`, one step."""
        dt_s = t_s - self._t_s
        self._t_s = t_s
        self.steering.axis.advance(t_s)
        self.drive.axis.advance(t_s)
        self.vehicle.step(
            self._drive_motor.velocity_rps
            * self.odometry_scale
            / self._gear.drive.revolutions_per_unit,
            self._steering_motor.position_rev / self._gear.steering.revolutions_per_unit,
            dt_s,
        )

    def run_devices(self, others: Iterable[MarkedVehicle]) -> None:
        """Let the devices look and send, once every robot has moved."""
        t_s = self._t_s
        if t_s + TOLERANCE_S < self._next_due_s:
            return
        sent = self._sent
        sent += self.steering.advance(t_s)
        sent += self.drive.advance(t_s)
        rate_radps = self._steering_motor.velocity_rps / self._gear.steering.revolutions_per_unit
        sent += self.encoder.advance(t_s, self.vehicle.steering_rad, rate_radps)
        sent += self.sensor.advance(t_s, self.vehicle, others)
        self._next_due_s = min(
            self.steering.next_due_s,
            self.drive.next_due_s,
            self.encoder.next_due_s,
            self.sensor.next_due_s,
        )


def _bus_order(frame: Frame) -> tuple[float, int]:
    return frame.t_s, frame.can_id


def _steering_axis(
    config: Robot, simulation: Simulation, database: CanDatabase, t_s: float, rng: Generator
) -> OdriveAxis:
    gear = config.vehicle.steering
    motor = Motor(
        simulation.steering.lag_s,
        stop_rev=STEERING_STOP_FACTOR * config.limits.steering_rad * gear.revolutions_per_unit,
    )
    limit = config.limits.steering_rate_radps
    return _axis(gear, motor, limit, simulation, simulation.steering, database, t_s, rng)


def _drive_axis(
    config: Robot, simulation: Simulation, database: CanDatabase, t_s: float, rng: Generator
) -> OdriveAxis:
    gear = config.vehicle.drive
    motor = Motor(simulation.drive.lag_s, friction_rps2=FRICTION_MPS2 * gear.revolutions_per_unit)
    limit = DRIVE_LIMIT_FACTOR * config.limits.speed_mps
    return _axis(gear, motor, limit, simulation, simulation.drive, database, t_s, rng)


def _axis(
    gear: AxisConfig,
    motor: Motor,
    velocity_limit: float,
    simulation: Simulation,
    errors: SimulatedMotor,
    database: CanDatabase,
    t_s: float,
    rng: Generator,
) -> OdriveAxis:
    """An axis whose limit and noise are given at the joint."""
    return OdriveAxis(
        database.axis(gear.node),
        motor,
        t_s=t_s,
        velocity_limit_rps=velocity_limit * gear.revolutions_per_unit,
        watchdog_s=simulation.watchdog_s,
        encoder_std_rev=errors.encoder_std * gear.revolutions_per_unit,
        rng=rng,
    )
