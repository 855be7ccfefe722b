"""One simulated robot: its vehicle and the devices on its bus."""

from collections.abc import Iterable, Sequence

from numpy.random import Generator, SeedSequence, default_rng

from config.angles import wrap
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.faults import kind_of
from config.fleet import Axis as AxisConfig
from config.fleet import Marker, Robot, SimulatedMotor, Simulation
from sim_hw.bearing_sensor import BearingSensor, MarkedVehicle
from sim_hw.bus_faults import BusFaults
from sim_hw.bus_timing import BABBLER, HOST, TimedBus
from sim_hw.faults import (
    ActiveFaults,
    DeviceFaults,
    Wrong,
    first_too_large,
    way_and_speed_too_large,
)
from sim_hw.motor import Motor
from sim_hw.odrive import OdriveAxis
from sim_hw.steering_encoder import SteeringEncoder
from sim_hw.timing import TOLERANCE_S
from sim_hw.vehicle import TruthState, Vehicle

FRICTION_MPS2 = 1.5
STEERING_STOP_FACTOR = 1.1
DRIVE_LIMIT_FACTOR = 1.2
BABBLE_FRAMES = 16
"""Waiting in the babbling node: more than a bus of 1 Mbit/s carries in one step."""
DEVICES = ("steering", "drive", "encoder", "bearing")


class SimulatedRobot:
    """Vehicle, steering axis, drive axis, steering encoder and bearing sensor of one robot.

    Without power the drive wheel slows by FRICTION_MPS2 and the fork stays where it is. The fork's
    mechanical stops lie beyond the steering limit, and the drive's own velocity limit lies above
    the speed limit, by the factors above, so that a robot which breaks a limit can be seen to.
    Devices draw from random streams of their own, and so do their faults. Everything that they and
    the host send goes over `bus`, which takes its time.
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
        odd = [default_rng(s) for s in seed.spawn(len(DEVICES) + 1)]
        start, self._gear = config.start, config.vehicle
        self.vehicle = Vehicle(config.vehicle.wheelbase_m, start.x_m, start.y_m, start.heading_rad)
        self.marked = MarkedVehicle(self.vehicle, config.markers)
        sign = 1.0 if body.random() < 0.5 else -1.0
        self.odometry_scale = 1.0 + sign * simulation.odometry_scale_error
        self.steering = _steering_axis(config, simulation, database, t_s, steering, odd[0])
        self.drive = _drive_axis(config, simulation, database, t_s, drive, odd[1])
        aux = database.vehicle_aux()
        self.encoder = SteeringEncoder(
            aux.steering_angle, simulation.steering_encoder_std_rad, t_s, encoder, odd[2]
        )
        self.sensor = BearingSensor(
            database.bearing_sensor(config.bearing_sensor.unit),
            config.bearing_sensor,
            simulation.bearings,
            landmarks,
            t_s,
            sensor,
            odd[3],
        )
        nodes = self._gear.steering.node, self._gear.drive.node
        self.bus_faults = BusFaults(odd[4], unprotected_nodes=nodes)
        self.bus = TimedBus(config.can.bitrate, t_s, DEVICES, self.bus_faults)
        self._faults = [
            self.steering.faults,
            self.drive.faults,
            self.encoder.faults,
            self.sensor.faults,
        ]
        self._steering_motor, self._drive_motor = self.steering.axis.motor, self.drive.axis.motor
        self._t_s = t_s
        self._next_due_s = t_s

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

    @property
    def adapter_lost(self) -> bool:
        """The host has no CAN adapter at present."""
        return self.bus_faults.adapter_lost

    def deliver(self, frame: Frame) -> bool:
        """Queue a frame of the host at its `t_s`; False where its transmit queue is full, or its
        controller bus-off."""
        return self.bus.queue(HOST, frame)

    def collect(self) -> list[Frame]:
        """What the host has heard since the last call, each stamped with the end of the frame.

        Error frames carry `sim_hw.error_frames.ERROR_FLAG` in their identifier.
        """
        frames, self.bus.to_host = self.bus.to_host, []
        return frames

    def begin_fault(self, device: str, kind: str, value: float | None) -> None:
        """Start a fault now. Raises KeyError where the device has no such kind."""
        if device in ("steering", "drive"):
            kind_of(device, kind)
            self._drive_named(device).begin_fault(kind, value, self._t_s)
        else:
            self._faults_of(device).begin(kind, value, self._t_s)
        self._next_due_s = self._t_s

    def end_fault(self, device: str, kind: str) -> None:
        """End a fault now; one that is not there is no mistake."""
        if device in ("steering", "drive"):
            self._drive_named(device).end_fault(kind, self._t_s)
        else:
            self._faults_of(device).end(kind)
        self._next_due_s = self._t_s

    def active_faults(self, device: str) -> list[str]:
        """Kinds of the faults that a device has now."""
        return list(self._faults_of(device).active)

    def _drive_named(self, device: str) -> OdriveAxis:
        return self.steering if device == "steering" else self.drive

    def _faults_of(self, device: str) -> ActiveFaults:
        return self.bus_faults if device == "bus" else self._faults[DEVICES.index(device)]

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
        """Let the devices look and send, and the bus run, once every robot has moved."""
        t_s = self._t_s
        if t_s + TOLERANCE_S >= self._next_due_s:
            self._send(t_s, others)
        bus = self.bus
        if self.bus_faults.any and self.bus_faults.babbles(t_s):
            self._babble(t_s)
        bus.advance(t_s)
        if bus.to_devices:
            self._hear(bus)

    def _send(self, t_s: float, others: Iterable[MarkedVehicle]) -> None:
        rate_radps = self._steering_motor.velocity_rps / self._gear.steering.revolutions_per_unit
        made = (
            self.steering.advance(t_s),
            self.drive.advance(t_s),
            self.encoder.advance(t_s, self.vehicle.steering_rad, rate_radps),
            self.sensor.advance(t_s, self.vehicle, others),
        )
        for device, faults, frames in zip(DEVICES, self._faults, made, strict=True):
            for frame in faults.pass_on(frames, t_s):
                self.bus.queue(device, frame)
        self._next_due_s = self._due_s()

    def _due_s(self) -> float:
        """When a device has something to do; at once while one of them has a fault."""
        for faults in self._faults:
            if faults.any or faults.holds_frames:
                return self._t_s
        return min(
            self.steering.next_due_s,
            self.drive.next_due_s,
            self.encoder.next_due_s,
            self.sensor.next_due_s,
        )

    def _hear(self, bus: TimedBus) -> None:
        frames, bus.to_devices = bus.to_devices, []
        for frame in frames:
            for device, axis in (("steering", self.steering), ("drive", self.drive)):
                if not bus.is_off(device):
                    axis.on_frame(frame, frame.t_s)
        self._next_due_s = self._t_s

    def _babble(self, t_s: float) -> None:
        """Keep the babbling node's queue from running dry within a step."""
        for _ in range(BABBLE_FRAMES - len(self.bus.node(BABBLER).queue)):
            self.bus.queue(BABBLER, Frame(0x000, bytes(8), t_s))


def _steering_axis(
    config: Robot,
    simulation: Simulation,
    database: CanDatabase,
    t_s: float,
    rng: Generator,
    fault_rng: Generator,
) -> OdriveAxis:
    gear = config.vehicle.steering
    faults = _drive_faults("steering", fault_rng, first_too_large(gear.revolutions_per_unit))
    motor = Motor(
        simulation.steering.lag_s,
        stop_rev=STEERING_STOP_FACTOR * config.limits.steering_rad * gear.revolutions_per_unit,
    )
    limit = config.limits.steering_rate_radps
    return _axis(gear, motor, limit, simulation, simulation.steering, database, t_s, rng, faults)


def _drive_axis(
    config: Robot,
    simulation: Simulation,
    database: CanDatabase,
    t_s: float,
    rng: Generator,
    fault_rng: Generator,
) -> OdriveAxis:
    gear = config.vehicle.drive
    faults = _drive_faults("drive", fault_rng, way_and_speed_too_large)
    motor = Motor(simulation.drive.lag_s, friction_rps2=FRICTION_MPS2 * gear.revolutions_per_unit)
    limit = DRIVE_LIMIT_FACTOR * config.limits.speed_mps
    return _axis(gear, motor, limit, simulation, simulation.drive, database, t_s, rng, faults)


def _drive_faults(device: str, rng: Generator, wrong: Wrong) -> DeviceFaults:
    return DeviceFaults(device, rng, (1.0, 1.0), wrong, garbage_by_value=True)


def _axis(
    gear: AxisConfig,
    motor: Motor,
    velocity_limit: float,
    simulation: Simulation,
    errors: SimulatedMotor,
    database: CanDatabase,
    t_s: float,
    rng: Generator,
    faults: DeviceFaults,
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
        faults=faults,
    )
