"""ODrive CANSimple, firmware 0.6: the axis messages' values and the enumerations in them.

Field names are the DBC's signal names; units are rev, rev/s, Nm, A, V, W and degC.
"""

from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from typing import NamedTuple

from config.can.codec import Codec
from config.can.group import CodecGroup

BROADCAST_NODE = 63


class AxisState(IntEnum):
    """Axis_State of a heartbeat and Axis_Requested_State."""

    UNDEFINED = 0
    IDLE = 1
    STARTUP_SEQUENCE = 2
    FULL_CALIBRATION_SEQUENCE = 3
    MOTOR_CALIBRATION = 4
    ENCODER_INDEX_SEARCH = 6
    ENCODER_OFFSET_CALIBRATION = 7
    CLOSED_LOOP_CONTROL = 8
    LOCKIN_SPIN = 9
    ENCODER_DIR_FIND = 10
    HOMING = 11
    ENCODER_HALL_POLARITY_CALIBRATION = 12
    ENCODER_HALL_PHASE_CALIBRATION = 13
    ANTICOGGING_CALIBRATION = 14


class ControlMode(IntEnum):
    """What the input commands."""

    VOLTAGE_CONTROL = 0
    TORQUE_CONTROL = 1
    VELOCITY_CONTROL = 2
    POSITION_CONTROL = 3


class InputMode(IntEnum):
    """How the input reaches the controller."""

    INACTIVE = 0
    PASSTHROUGH = 1
    VEL_RAMP = 2
    POS_FILTER = 3
    MIX_CHANNELS = 4
    TRAP_TRAJ = 5
    TORQUE_RAMP = 6
    MIRROR = 7
    TUNING = 8


class ProcedureResult(IntEnum):
    """How the last requested state ended; stays BUSY in closed loop from firmware 0.6.11 on."""

    SUCCESS = 0
    BUSY = 1
    CANCELLED = 2
    DISARMED = 3
    NO_RESPONSE = 4
    POLE_PAIR_CPR_MISMATCH = 5
    PHASE_RESISTANCE_OUT_OF_RANGE = 6
    PHASE_INDUCTANCE_OUT_OF_RANGE = 7
    UNBALANCED_PHASES = 8
    INVALID_MOTOR_TYPE = 9
    ILLEGAL_HALL_STATE = 10
    TIMEOUT = 11
    HOMING_WITHOUT_ENDSTOP = 12
    INVALID_STATE = 13
    NOT_CALIBRATED = 14
    NOT_CONVERGING = 15


class AxisError(IntFlag):
    """Bits of Axis_Error, Active_Errors and Disarm_Reason."""

    INITIALIZING = 0x1
    SYSTEM_LEVEL = 0x2
    TIMING_ERROR = 0x4
    MISSING_ESTIMATE = 0x8
    BAD_CONFIG = 0x10
    DRV_FAULT = 0x20
    MISSING_INPUT = 0x40
    DC_BUS_OVER_VOLTAGE = 0x100
    DC_BUS_UNDER_VOLTAGE = 0x200
    DC_BUS_OVER_CURRENT = 0x400
    DC_BUS_OVER_REGEN_CURRENT = 0x800
    CURRENT_LIMIT_VIOLATION = 0x1000
    MOTOR_OVER_TEMP = 0x2000
    INVERTER_OVER_TEMP = 0x4000
    VELOCITY_LIMIT_VIOLATION = 0x8000
    POSITION_LIMIT_VIOLATION = 0x10000
    WATCHDOG_TIMER_EXPIRED = 0x0100_0000
    ESTOP_REQUESTED = 0x0200_0000
    SPINOUT_DETECTED = 0x0400_0000
    BRAKE_RESISTOR_DISARMED = 0x0800_0000
    THERMISTOR_DISCONNECTED = 0x1000_0000
    CALIBRATION_ERROR = 0x4000_0000


class RebootAction(IntEnum):
    """Action of Reboot."""

    REBOOT = 0
    SAVE_CONFIGURATION = 1
    ERASE_CONFIGURATION = 2
    ENTER_DFU = 3


class SdoOpcode(IntEnum):
    """Opcode of RxSdo."""

    READ = 0
    WRITE = 1


class GetVersion(NamedTuple):
    protocol_version: int
    hw_version_major: int
    hw_version_minor: int
    hw_version_variant: int
    fw_version_major: int
    fw_version_minor: int
    fw_version_revision: int
    fw_version_unreleased: int


class Heartbeat(NamedTuple):
    axis_error: int
    axis_state: int
    procedure_result: int
    trajectory_done_flag: int


class Estop(NamedTuple):
    """No payload: disarms the axis with ESTOP_REQUESTED."""


class GetError(NamedTuple):
    active_errors: int
    disarm_reason: int


class RxSdo(NamedTuple):
    opcode: int
    endpoint_id: int
    value: int


class TxSdo(NamedTuple):
    endpoint_id: int
    value: int


class Address(NamedTuple):
    node_id: int
    serial_number: int
    connection_id: int


class SetAxisState(NamedTuple):
    axis_requested_state: int


class GetEncoderEstimates(NamedTuple):
    pos_estimate: float
    vel_estimate: float


class SetControllerMode(NamedTuple):
    control_mode: int
    input_mode: int


class SetInputPos(NamedTuple):
    """The feed-forwards' scale is a setting of the drive; the DBC holds its default."""

    input_pos: float
    vel_ff: float
    torque_ff: float


class SetInputVel(NamedTuple):
    input_vel: float
    input_torque_ff: float


class SetInputTorque(NamedTuple):
    input_torque: float


class SetLimits(NamedTuple):
    velocity_limit: float
    current_limit: float


class SetTrajVelLimit(NamedTuple):
    traj_vel_limit: float


class SetTrajAccelLimits(NamedTuple):
    traj_accel_limit: float
    traj_decel_limit: float


class GetIq(NamedTuple):
    iq_setpoint: float
    iq_measured: float


class GetTemperature(NamedTuple):
    """NaN or 0 where a thermistor is missing."""

    fet_temperature: float
    motor_temperature: float


class Reboot(NamedTuple):
    action: int


class GetBusVoltageCurrent(NamedTuple):
    bus_voltage: float
    bus_current: float


class ClearErrors(NamedTuple):
    identify: int


class SetAbsolutePosition(NamedTuple):
    position: float


class SetPosGain(NamedTuple):
    pos_gain: float


class SetVelGains(NamedTuple):
    vel_gain: float
    vel_integrator_gain: float


class GetTorques(NamedTuple):
    torque_target: float
    torque_estimate: float


class GetPowers(NamedTuple):
    electrical_power: float
    mechanical_power: float


@dataclass(frozen=True, slots=True)
class AxisCodecs(CodecGroup):
    """Codecs of one axis. `set_*`, `estop`, `reboot`, `clear_errors`, `rx_sdo` go to the drive;
    the others come from it, `get_*` cyclically or on a remote frame with the same identifier."""

    get_version: Codec[GetVersion]
    heartbeat: Codec[Heartbeat]
    estop: Codec[Estop] = field(metadata={"length": 0})
    get_error: Codec[GetError]
    rx_sdo: Codec[RxSdo]
    tx_sdo: Codec[TxSdo]
    address: Codec[Address] = field(metadata={"min_length": 7})
    set_axis_state: Codec[SetAxisState] = field(metadata={"min_length": 4})
    get_encoder_estimates: Codec[GetEncoderEstimates]
    set_controller_mode: Codec[SetControllerMode]
    set_input_pos: Codec[SetInputPos]
    set_input_vel: Codec[SetInputVel]
    set_input_torque: Codec[SetInputTorque] = field(metadata={"min_length": 4})
    set_limits: Codec[SetLimits]
    set_traj_vel_limit: Codec[SetTrajVelLimit]
    set_traj_accel_limits: Codec[SetTrajAccelLimits]
    get_iq: Codec[GetIq]
    get_temperature: Codec[GetTemperature]
    reboot: Codec[Reboot] = field(metadata={"length": 1})
    get_bus_voltage_current: Codec[GetBusVoltageCurrent]
    clear_errors: Codec[ClearErrors] = field(metadata={"length": 1})
    set_absolute_position: Codec[SetAbsolutePosition]
    set_pos_gain: Codec[SetPosGain]
    set_vel_gains: Codec[SetVelGains]
    get_torques: Codec[GetTorques]
    get_powers: Codec[GetPowers]
