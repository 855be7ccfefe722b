"""The bearing sensor: an object list over CAN, put together to sets of bearings.

A header (Brg_Frame) opens a set; the set closes when its targets are in, at the next header, or
after 20 ms, and says whether it is complete. A header with 0 targets is a look that saw nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from config.angles import wrap
from config.can.frame import Frame
from config.can.vehicle import (
    INTERFACE_VERSION,
    LATENCY_UNKNOWN_MS,
    UNIDENTIFIED_TARGET,
    BearingFrame,
    BearingHealth,
    BearingSensorCodecs,
    BearingTarget,
    SensorState,
    TargetClass,
)
from config.fleet import BearingSensor as BearingSensorSettings
from onboard.canbus.protection import Receiver
from onboard.canbus.silence import silence

SET_TIMEOUT_S = 0.02
BUS_DELAY_S = 0.0003
"""From hand-over to the controller until reception, typical; up to 5.6 ms in the worst case."""
HEALTH_TIMEOUT_S = 0.35
MIN_STALE_S = 0.1
STALE_PERIODS = 3

_USABLE_STATES = (SensorState.RUNNING, SensorState.DEGRADED)


@dataclass(frozen=True, slots=True)
class Bearing:
    """One target [rad], anticlockwise from the forward axis of the frame that the set names.

    `target` is None where the sensor did not identify it, `std_rad` None where it gave none
    (0.1275 rad, the largest that the wire can carry, means at least that).
    """

    target: int | None
    kind: TargetClass
    bearing_rad: float
    std_rad: float | None
    quality: int


@dataclass(frozen=True, slots=True)
class BearingSet:
    """The bearings of one look. `frame` says whether they are relative to the body or the fork.

    `t_capture_s` is the middle of the exposure on the monotonic clock; where the sensor does not
    know its latency (`latency_known` False), it is the time of hand-over to the bus.
    """

    t_capture_s: float
    targets: tuple[Bearing, ...]
    complete: bool
    truncated: bool
    latency_known: bool
    frame: Literal["body", "fork"]


@dataclass(slots=True)
class _OpenSet:
    header: BearingFrame
    t_header_s: float
    by_slot: dict[int, BearingTarget]


class BearingSensor:
    """Receiver of one sensor: `on_frame` takes frames, `take` gives the finished sets."""

    def __init__(self, codecs: BearingSensorCodecs, settings: BearingSensorSettings) -> None:
        self._codecs = codecs
        self._settings = settings
        self._protections = {
            codec.can_id: Receiver(codec.can_id, codec.length)
            for codec in (codecs.frame, codecs.target, codecs.health)
        }
        self._handlers: dict[int, Callable[[Frame], None]] = {
            codecs.frame.can_id: self._on_header,
            codecs.target.can_id: self._on_target,
            codecs.health.can_id: self._on_health,
        }
        self._open: _OpenSet | None = None
        self._done: list[BearingSet] = []
        self._t_header_s: float | None = None
        self._health: BearingHealth | None = None
        self._t_health_s: float | None = None
        self._refusal: str | None = None

    @property
    def health(self) -> BearingHealth | None:
        """The sensor's last report on itself."""
        return self._health

    def on_frame(self, frame: Frame) -> None:
        """Take a frame; those of others, remote ones and those that fail their check are not."""
        handler = self._handlers.get(frame.can_id)
        if handler is None or frame.remote:
            return
        if self._protections[frame.can_id].accept(frame.data):
            handler(frame)

    def take(self, now_s: float) -> list[BearingSet]:
        """The sets finished since the last call, oldest first."""
        if self._open is not None and now_s - self._open.t_header_s >= SET_TIMEOUT_S:
            self._close()
        done, self._done = self._done, []
        return done

    def stale_for(self, now_s: float) -> float | None:
        """Age of the last header [s]; None before the first."""
        return None if self._t_header_s is None else now_s - self._t_header_s

    def problem(self, now_s: float) -> str | None:
        """Why the sensor's bearings are not to be relied on, or None."""
        if self._refusal is not None:
            return self._refusal
        health_age_s = None if self._t_health_s is None else now_s - self._t_health_s
        header_limit_s = max(STALE_PERIODS / self._settings.rate_hz, MIN_STALE_S)
        return (
            silence("bearing sensor", "health report", health_age_s, HEALTH_TIMEOUT_S)
            or _health_problem(self._health)
            or silence("bearing sensor", "bearing frame", self.stale_for(now_s), header_limit_s)
        )

    def _on_header(self, frame: Frame) -> None:
        header = self._codecs.frame.unpack(frame.data)
        if self._open is not None:
            self._close()
        if header.interface_version != INTERFACE_VERSION:
            self._refusal = (
                f"bearing sensor: interface version {header.interface_version} of the sensor is "
                f"not supported, this software speaks version {INTERFACE_VERSION}"
            )
            return
        self._refusal = None
        if not header.frame_valid:
            return
        self._t_header_s = frame.t_s
        self._open = _OpenSet(header, frame.t_s, {})
        if header.n_targets == 0:
            self._close()

    def _on_target(self, frame: Frame) -> None:
        target = self._codecs.target.unpack(frame.data)
        opened = self._open
        if opened is None or target.capture_id != opened.header.capture_id:
            return
        opened.by_slot[target.slot] = target
        if len(opened.by_slot) >= opened.header.n_targets:
            self._close()

    def _on_health(self, frame: Frame) -> None:
        self._health = self._codecs.health.unpack(frame.data)
        self._t_health_s = frame.t_s

    def _close(self) -> None:
        opened, self._open = self._open, None
        assert opened is not None, "only called with a set open"
        header = opened.header
        latency_known = header.latency < LATENCY_UNKNOWN_MS - 0.05
        latency_s = header.latency / 1000 if latency_known else 0.0
        self._done.append(
            BearingSet(
                t_capture_s=opened.t_header_s - latency_s - BUS_DELAY_S,
                targets=tuple(
                    self._bearing(target) for target in opened.by_slot.values() if target.quality
                ),
                complete=len(opened.by_slot) >= header.n_targets,
                truncated=bool(header.targets_truncated),
                latency_known=latency_known,
                frame=self._settings.mounting,
            )
        )

    def _bearing(self, target: BearingTarget) -> Bearing:
        identified = target.target_id != UNIDENTIFIED_TARGET
        return Bearing(
            target=target.target_id if identified else None,
            kind=TargetClass(target.target_class),
            bearing_rad=wrap(target.bearing + self._settings.yaw_rad),
            std_rad=target.bearing_std or None,
            quality=target.quality,
        )


def _health_problem(health: BearingHealth | None) -> str | None:
    if health is None or health.sensor_state in _USABLE_STATES:
        return None
    faults = [
        name.removeprefix("fault_")
        for name, value in health._asdict().items()
        if name.startswith("fault_") and value
    ]
    known = health.sensor_state in SensorState.__members__.values()
    state = SensorState(health.sensor_state).name if known else str(health.sensor_state)
    return f"bearing sensor: state {state}, faults {', '.join(faults) or 'none'}"
