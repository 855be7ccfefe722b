"""Messages of the bearing sensor, the steering encoder, the e-stop chain and the host.

Field names are the DBC's signal names. Times are milliseconds (sensor clocks wrap at 6553.6 ms),
angles radians. CRC and counter are left to `config.can.e2e`.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from config.can.codec import Codec
from config.can.group import CodecGroup

INTERFACE_VERSION = 1
LATENCY_UNKNOWN_MS = 6553.5
UNIDENTIFIED_TARGET = 1023
CLOCK_WRAP_MS = 6553.6


class TargetClass(IntEnum):
    """What a bearing sensor believes it sees."""

    UNKNOWN = 0
    ROBOT = 1
    LANDMARK = 2
    RESERVED = 3


class SensorState(IntEnum):
    """State in a bearing sensor's health message."""

    BOOT = 0
    STANDBY = 1
    RUNNING = 2
    DEGRADED = 3
    FAULT = 4


class RequestedState(IntEnum):
    """State that the host asks a bearing sensor for."""

    STANDBY = 1
    RUNNING = 2
    REBOOT = 15


class EstopSource(IntEnum):
    """Who asked for the emergency stop."""

    NONE = 0
    OPERATOR = 1
    NETWORK = 2
    SUPERVISOR = 3
    WATCHDOG = 4


class HostState(IntEnum):
    """State in the host's heartbeat to the safety node."""

    INIT = 0
    READY = 1
    ACTIVE = 2
    STOPPING = 3
    FAULT = 4


class BearingFrame(NamedTuple):
    """Opens a set of targets; also sent when nothing was seen."""

    interface_version: int
    capture_id: int
    n_targets: int
    targets_truncated: int
    time_synced: int
    frame_valid: int
    latency: float
    capture_time: float


class BearingTarget(NamedTuple):
    """Bearing anticlockwise from the sensor's axis; quality 0 means do not use."""

    slot: int
    capture_id: int
    target_id: int
    target_class: int
    quality: int
    bearing: float
    bearing_std: float


class BearingHealth(NamedTuple):
    """Self-report, 10 Hz."""

    sensor_state: int
    fov_half: float
    frame_rate: float
    temperature: int
    fault_camera: int
    fault_blocked: int
    fault_exposure: int
    fault_calibration: int
    fault_overtemp: int
    fault_tx_overflow: int
    fault_time_sync: int
    fault_internal: int
    dropped_frames: int
    uptime: int


class BearingCommand(NamedTuple):
    """The host's wishes and its clock."""

    requested_state: int
    max_targets: int
    report_robots: int
    report_landmarks: int
    rate_limit: float
    sync_time: float


class Estop(NamedTuple):
    estop_active: int
    estop_source: int


class SafetyStatus(NamedTuple):
    estop_latched: int
    estop_button: int
    power_enabled: int
    host_alive: int
    battery_voltage: float


class HostHeartbeat(NamedTuple):
    host_state: int
    host_time: float


class SteeringAngle(NamedTuple):
    """Road-wheel angle, left positive, and its rate [rad/s]."""

    angle_valid: int
    angle_referenced: int
    fault_magnet: int
    fault_internal: int
    angle: float
    rate: float
    sample_time: float


@dataclass(frozen=True, slots=True)
class BearingSensorCodecs(CodecGroup):
    """Codecs of one bearing sensor."""

    frame: Codec[BearingFrame]
    target: Codec[BearingTarget]
    health: Codec[BearingHealth]
    command: Codec[BearingCommand]


@dataclass(frozen=True, slots=True)
class VehicleAuxCodecs(CodecGroup):
    """Codecs of the steering encoder, the safety node and the host."""

    estop: Codec[Estop] = field(metadata={"length": 2})
    safety_status: Codec[SafetyStatus] = field(metadata={"length": 4})
    host_heartbeat: Codec[HostHeartbeat] = field(metadata={"length": 4})
    steering_angle: Codec[SteeringAngle]
