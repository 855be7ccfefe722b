"""Emulated bearing sensor: a header, one frame per target, health; all protected.

It sits at the front-wheel midpoint, on the body or on the fork, and sees landmarks and the markers
of other robots within its field of view and range. Nothing hides anything.
"""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from numpy.random import Generator

from config.angles import wrap
from config.can.frame import Frame
from config.can.vehicle import (
    INTERFACE_VERSION,
    BearingFrame,
    BearingHealth,
    BearingSensorCodecs,
    BearingTarget,
    SensorState,
    TargetClass,
)
from config.fleet import BearingSensor as SensorConfig
from config.fleet import Marker, SimulatedBearings
from sim_hw.faults import DeviceFaults, first_too_large
from sim_hw.protected import ProtectedSender
from sim_hw.timing import TOLERANCE_S, Cycle, DeviceClock
from sim_hw.vehicle import Vehicle

MAX_TARGETS = 16

_LANDMARK = int(TargetClass.LANDMARK)
_ROBOT = int(TargetClass.ROBOT)
_CLOCK_RANGE_S = 6.5536
_LEAST_STD_RAD = 0.0005
_BEST_QUALITY = 15
_TEMPERATURE_DEGC = 35


class MarkedVehicle(NamedTuple):
    """Another robot as the sensor sees it: markers relative to its front-wheel midpoint."""

    vehicle: Vehicle
    markers: Sequence[Marker]


class _Target(NamedTuple):
    """A target in sight, without error."""

    range_m: float
    id: int
    kind: int
    bearing_rad: float


class _Capture(NamedTuple):
    """One look, waiting to be sent."""

    captured_s: float
    number: int
    truncated: bool
    targets: list[_Target]


class BearingSensor:
    """One sensor. `config` says how it is mounted, `errors` how it errs.

    Targets beyond the sixteen nearest are left out and the frame is marked as truncated.
    """

    def __init__(
        self,
        codecs: BearingSensorCodecs,
        config: SensorConfig,
        errors: SimulatedBearings,
        landmarks: Sequence[Marker],
        t_s: float,
        rng: Generator,
        fault_rng: Generator,
    ) -> None:
        self.faults = DeviceFaults("bearing", fault_rng, (math.pi,), first_too_large())
        self._config = config
        self._errors = errors
        self._landmarks = landmarks
        self._rng = rng
        self._boot_s = t_s
        self._on_fork = config.mounting == "fork"
        self._fov_half_rad = config.fov_half_rad
        self._range_m, self._dropout = errors.range_m, errors.dropout
        self._frame = ProtectedSender(codecs.frame)
        self._target = ProtectedSender(codecs.target)
        self._health = ProtectedSender(codecs.health)
        period_s = 1.0 / config.rate_hz
        self._look = Cycle(t_s + rng.random() * period_s, period_s)
        self._report = Cycle(t_s, codecs.health.cycle_time_s)
        self._clock = DeviceClock(t_s, rng.random() * _CLOCK_RANGE_S)
        self._number = 0
        self._pending: deque[_Capture] = deque()
        self._last_targets: list[_Target] = []

    @property
    def next_due_s(self) -> float:
        """When there is the next look to take or frame to send."""
        next_s = min(self._look.next_s, self._report.next_s)
        if self._pending:
            next_s = min(next_s, self._pending[0].captured_s + self._errors.latency_s)
        return next_s

    def advance(self, t_s: float, own: Vehicle, others: Iterable[MarkedVehicle]) -> list[Frame]:
        """Frames due until `t_s`; a look taken at `t_s` sees `own` and `others` as they are."""
        frames: list[Frame] = []
        if self._look.due(t_s) and not self._leaves_out("look"):
            self._pending.append(self._capture(t_s, own, others))
        latency_s = self._errors.latency_s
        while self._pending and self._pending[0].captured_s + latency_s <= t_s + TOLERANCE_S:
            frames += self._frames_of(self._pending.popleft())
        if self._report.due(t_s) and not self._leaves_out("health"):
            frames.append(self._health.frame(t_s, self._health_row(t_s)))
        return frames

    def _leaves_out(self, message: str) -> bool:
        return self.faults.any and self.faults.skips(message)

    def _capture(self, t_s: float, own: Vehicle, others: Iterable[MarkedVehicle]) -> _Capture:
        targets = self._in_sight(own, others)
        targets.sort()
        truncated = len(targets) > MAX_TARGETS
        measured = self._measured(targets[:MAX_TARGETS])
        if self.faults.any and self.faults.has("stuck"):
            measured = self._last_targets
        self._last_targets = measured
        if self.faults.any and self.faults.has("blind"):
            measured = []
        self._number = (self._number + 1) & 0xFF
        return _Capture(t_s, self._number, truncated, measured)

    def _measured(self, targets: list[_Target]) -> list[_Target]:
        """The same targets where the sensor takes them to be."""
        noise = self._rng.standard_normal(len(targets)).tolist()
        std_rad, bias_rad = self._errors.std_rad, self._errors.bias_rad
        return [
            target._replace(bearing_rad=target.bearing_rad + bias_rad + std_rad * deviation)
            for target, deviation in zip(targets, noise, strict=True)
        ]

    def _in_sight(self, own: Vehicle, others: Iterable[MarkedVehicle]) -> list[_Target]:
        axis_rad = own.heading_rad + self._config.yaw_rad
        if self._on_fork:
            axis_rad += own.steering_rad
        targets: list[_Target] = []
        for mark in self._landmarks:
            east, north = mark.x_m - own.x_m, mark.y_m - own.y_m
            self._look_at(targets, mark.id, _LANDMARK, east, north, axis_rad)
        for other in others:
            vehicle = other.vehicle
            cosine, sine = math.cos(vehicle.heading_rad), math.sin(vehicle.heading_rad)
            for mark in other.markers:
                east = vehicle.x_m + cosine * mark.x_m - sine * mark.y_m - own.x_m
                north = vehicle.y_m + sine * mark.x_m + cosine * mark.y_m - own.y_m
                self._look_at(targets, mark.id, _ROBOT, east, north, axis_rad)
        return targets

    def _look_at(
        self,
        targets: list[_Target],
        target_id: int,
        kind: int,
        east_m: float,
        north_m: float,
        axis_rad: float,
    ) -> None:
        """Add a target, unless it is out of range, out of the field of view, or missed."""
        range_m = math.hypot(east_m, north_m)
        bearing_rad = wrap(math.atan2(north_m, east_m) - axis_rad)
        if range_m > self._range_m or abs(bearing_rad) > self._fov_half_rad:
            return
        if self._dropout and self._rng.random() < self._dropout:
            return
        targets.append(_Target(range_m, target_id, kind, bearing_rad))

    def _frames_of(self, capture: _Capture) -> list[Frame]:
        sent_s = capture.captured_s + self._errors.latency_s
        header = BearingFrame(
            interface_version=INTERFACE_VERSION,
            capture_id=capture.number,
            n_targets=len(capture.targets),
            targets_truncated=int(capture.truncated),
            time_synced=0,
            frame_valid=1,
            latency=self._errors.latency_s * 1e3,
            capture_time=self._clock.read_ms(capture.captured_s),
        )
        frames = [self._frame.frame(sent_s, header)]
        told_rad = max(self._errors.std_rad, _LEAST_STD_RAD)
        for slot, target in enumerate(capture.targets):
            bearing_rad = target.bearing_rad
            if self.faults.any and not self.faults.has("stuck"):
                (bearing_rad,) = self.faults.distort((bearing_rad,))
            bearing_rad = wrap(bearing_rad)
            row = BearingTarget(
                slot, capture.number, target.id, target.kind, _BEST_QUALITY, bearing_rad, told_rad
            )
            frames.append(self._target.frame(sent_s, row))
        return frames

    def _health_row(self, t_s: float) -> BearingHealth:
        failed = self.faults.any and self.faults.has("failed")
        return BearingHealth(
            sensor_state=SensorState.FAULT if failed else SensorState.RUNNING,
            fov_half=self._config.fov_half_rad,
            frame_rate=self._config.rate_hz,
            temperature=_TEMPERATURE_DEGC,
            fault_camera=0,
            fault_blocked=0,
            fault_exposure=0,
            fault_calibration=0,
            fault_overtemp=0,
            fault_tx_overflow=0,
            fault_time_sync=0,
            fault_internal=failed,
            dropped_frames=0,
            uptime=int(t_s - self._boot_s) & 0xFF,
        )
