"""One recorded robot as the devices on its bus: drives, steering encoder, bearing sensor.

Nothing is added to the recording. The drives stay idle whatever the host asks of them: what is
played has been driven already.
"""

from bisect import bisect_left
from collections.abc import Iterator
from itertools import groupby

from config.angles import wrap
from config.can.codec import Codec
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import AxisCodecs, AxisState, GetEncoderEstimates, Heartbeat, ProcedureResult
from config.can.vehicle import (
    INTERFACE_VERSION,
    BearingFrame,
    BearingHealth,
    BearingTarget,
    SensorState,
    SteeringAngle,
    TargetClass,
)
from config.fleet import Robot
from sim_hw.dataset.mrclam import BearingRow, Recording
from sim_hw.dataset.virtual_car import VirtualCar
from sim_hw.protected import ProtectedSender
from sim_hw.timing import TOLERANCE_S, Cycle, DeviceClock
from sim_hw.vehicle import TruthState

HEALTH_PERIOD_S = 0.1
MAX_TARGETS = 16

_BEST_QUALITY = 15
_STD_NOT_GIVEN = 0.0
_TEMPERATURE_DEGC = 25
_IDLE_HEARTBEAT = Heartbeat(0, AxisState.IDLE, ProcedureResult.SUCCESS, 1)

Look = tuple[float, tuple[BearingRow, ...]]


class PlaybackDrive:
    """An idle axis that reports a position [rev] and the mean velocity [rev/s] since the last."""

    def __init__(self, codecs: AxisCodecs, revolutions_per_unit: float, t_s: float) -> None:
        self._codecs = codecs
        self._revolutions_per_unit = revolutions_per_unit
        self._last_rev = 0.0
        self._last_s = t_s

    def heartbeat(self, t_s: float) -> Frame:
        """The cyclic sign of life."""
        return _frame(self._codecs.heartbeat, _IDLE_HEARTBEAT, t_s)

    def estimates(self, t_s: float, position: float) -> Frame:
        """Encoder estimates for a position in joint units; the velocity's integral is exact."""
        position_rev = position * self._revolutions_per_unit
        dt_s = t_s - self._last_s
        velocity = (position_rev - self._last_rev) / dt_s if dt_s > 0.0 else 0.0
        self._last_rev, self._last_s = position_rev, t_s
        row = GetEncoderEstimates(position_rev, velocity)
        return _frame(self._codecs.get_encoder_estimates, row, t_s)


class PlaybackSensor:
    """The recorded bearings as looks; it does not know its noise and has no latency."""

    def __init__(self, config: Robot, recording: Recording, database: CanDatabase, t_s: float):
        codecs = database.bearing_sensor(config.bearing_sensor.unit)
        self._config = config.bearing_sensor
        self._landmarks = recording.landmark_subjects
        self._frame = ProtectedSender(codecs.frame)
        self._target = ProtectedSender(codecs.target)
        self._health = ProtectedSender(codecs.health)
        self._clock = DeviceClock(t_s, 0.0)
        self._boot_s = t_s
        self._number = 0

    def look(self, t_s: float, rows: tuple[BearingRow, ...]) -> Iterator[Frame]:
        """Header and targets of one look; without `rows` it says that nothing is seen."""
        self._number = (self._number + 1) & 0xFF
        header = BearingFrame(
            interface_version=INTERFACE_VERSION,
            capture_id=self._number,
            n_targets=len(rows),
            targets_truncated=0,
            time_synced=0,
            frame_valid=1,
            latency=0.0,
            capture_time=self._clock.read_ms(t_s),
        )
        yield self._frame.frame(t_s, header)
        for slot, seen in enumerate(rows):
            kind = TargetClass.LANDMARK if seen.subject in self._landmarks else TargetClass.ROBOT
            bearing_rad = wrap(seen.bearing_rad)
            target = BearingTarget(
                slot, self._number, seen.subject, kind, _BEST_QUALITY, bearing_rad, _STD_NOT_GIVEN
            )
            yield self._target.frame(t_s, target)

    def health(self, t_s: float) -> Frame:
        """The sensor's report on itself: running, without faults."""
        faults = dict.fromkeys(
            (name for name in BearingHealth._fields if name.startswith("fault_")), 0
        )
        report = BearingHealth(
            sensor_state=SensorState.RUNNING,
            fov_half=self._config.fov_half_rad,
            frame_rate=self._config.rate_hz,
            temperature=_TEMPERATURE_DEGC,
            dropped_frames=0,
            uptime=int(t_s - self._boot_s) & 0xFF,
            **faults,
        )
        return self._health.frame(t_s, report)


class PlaybackRobot:
    """All devices of one robot. Standing at the recording's start until `play` is called."""

    adapter_lost = False

    def __init__(
        self, config: Robot, recording: Recording, database: CanDatabase, t_s: float
    ) -> None:
        vehicle, aux = config.vehicle, database.vehicle_aux()
        self.recording = recording
        self._car = VirtualCar(vehicle.wheelbase_m, recording.odometry, recording.start_s)
        self._drive = PlaybackDrive(
            database.axis(vehicle.drive.node), vehicle.drive.revolutions_per_unit, t_s
        )
        self._steering = PlaybackDrive(
            database.axis(vehicle.steering.node), vehicle.steering.revolutions_per_unit, t_s
        )
        self._encoder = ProtectedSender(aux.steering_angle)
        self._encoder_clock = DeviceClock(t_s, 0.0)
        self._sensor = PlaybackSensor(config, recording, database, t_s)
        self._motion_cycle = Cycle(t_s, 1.0 / config.loop.rate_hz)
        self._health_cycle = Cycle(t_s, HEALTH_PERIOD_S)
        self._look_cycle = Cycle(t_s, 1.0 / config.bearing_sensor.rate_hz)
        self._looks = _looks(recording)
        self._next_look = 0
        self._started_s: float | None = None
        self._t_s = t_s
        self._sent: list[Frame] = []

    @property
    def started_s(self) -> float | None:
        """When the recording's start was played; None before."""
        return self._started_s

    @property
    def ended(self) -> bool:
        """All of the recording that can be judged has been played."""
        return self._recorded_s(self._t_s) >= self.recording.end_s

    @property
    def truth(self) -> TruthState:
        """The motion capture's pose, with the body and the fork of the car that is played."""
        truth, t_s = self.recording.truth, self._recorded_s(self._t_s)
        after = min(max(1, bisect_left(truth, t_s, key=lambda row: row.t_s)), len(truth) - 1)
        one, two = truth[after - 1], truth[after]
        span_s = two.t_s - one.t_s
        share = min(max((t_s - one.t_s) / span_s, 0.0), 1.0) if span_s > 0.0 else 0.0
        fork_rad = one.heading_rad + share * wrap(two.heading_rad - one.heading_rad)
        return TruthState(
            self._t_s,
            one.x_m + share * (two.x_m - one.x_m),
            one.y_m + share * (two.y_m - one.y_m),
            wrap(fork_rad - self._car.steering_rad),
            wrap(self._car.steering_rad),
            self._car.speed_mps,
        )

    def play(self, t_s: float) -> None:
        """Let the recording run from `t_s` on; later calls change nothing."""
        if self._started_s is None:
            self._started_s = t_s

    def deliver(self, frame: Frame) -> bool:
        """A frame from the host. A host that speaks is there to listen: the recording starts."""
        self.play(max(frame.t_s, self._t_s))
        return True

    def collect(self) -> list[Frame]:
        """Frames that went on the bus since the last call, in the order of time."""
        frames, self._sent = self._sent, []
        return frames

    def advance(self, t_s: float) -> None:
        """Play everything that is due until `t_s`."""
        while (due_s := self._next_due_s()) <= t_s + TOLERANCE_S:
            self._car.advance(self._recorded_s(due_s))
            self._play_at(due_s)
        self._car.advance(self._recorded_s(t_s))
        self._t_s = t_s

    def _next_due_s(self) -> float:
        cycles = self._motion_cycle.next_s, self._health_cycle.next_s, self._look_cycle.next_s
        if self._started_s is None or self._next_look == len(self._looks):
            return min(cycles)
        look_s = self._looks[self._next_look][0] - self.recording.start_s + self._started_s
        return min(*cycles, look_s)

    def _play_at(self, t_s: float) -> None:
        sent, car = self._sent, self._car
        if self._motion_cycle.due(t_s):
            sent.append(self._drive.estimates(t_s, car.way_m))
            sent.append(self._encoder.frame(t_s, self._angle(t_s)))
        if self._health_cycle.due(t_s):
            sent.append(self._steering.estimates(t_s, car.steering_rad))
            sent.extend(axis.heartbeat(t_s) for axis in (self._steering, self._drive))
            sent.append(self._sensor.health(t_s))
        recorded_s = self._recorded_s(t_s)
        seen = False
        while (
            self._started_s is not None
            and self._next_look < len(self._looks)
            and self._looks[self._next_look][0] <= recorded_s + TOLERANCE_S
        ):
            sent.extend(self._sensor.look(t_s, self._looks[self._next_look][1]))
            self._next_look += 1
            seen = True
        if self._look_cycle.due(t_s) and not seen:
            sent.extend(self._sensor.look(t_s, ()))

    def _angle(self, t_s: float) -> SteeringAngle:
        return SteeringAngle(
            angle_valid=1,
            angle_referenced=1,
            fault_magnet=0,
            fault_internal=0,
            angle=wrap(self._car.steering_rad),
            rate=self._car.steering_rate_radps,
            sample_time=self._encoder_clock.read_ms(t_s),
        )

    def _recorded_s(self, t_s: float) -> float:
        played_s = 0.0 if self._started_s is None else max(0.0, t_s - self._started_s)
        return self.recording.start_s + played_s


def _looks(recording: Recording) -> list[Look]:
    """Bearings of one instant belong to one look, as far as a look can carry them."""
    looks: list[Look] = []
    within = (b for b in recording.bearings if recording.start_s <= b.t_s <= recording.end_s)
    for t_s, rows in groupby(within, key=lambda row: row.t_s):
        seen = tuple(rows)
        looks += [
            (t_s, seen[first : first + MAX_TARGETS]) for first in range(0, len(seen), MAX_TARGETS)
        ]
    return looks


def _frame(
    codec: Codec[Heartbeat] | Codec[GetEncoderEstimates], row: tuple[float, ...], t_s: float
) -> Frame:
    return Frame(codec.can_id, codec.pack(*row), t_s)
