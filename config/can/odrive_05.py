"""ODrive CANSimple, firmware 0.5: what differs from firmware 0.6, as far as the host uses it."""

from dataclasses import dataclass, field
from enum import IntFlag
from typing import NamedTuple

from config.can.codec import Codec
from config.can.group import CodecGroup


class AxisError05(IntFlag):
    """Bits of Axis_Error; the three flags of the heartbeat follow from bit 32 on."""

    INVALID_STATE = 0x1
    MOTOR_FAILED = 0x40
    ENCODER_FAILED = 0x100
    CONTROLLER_FAILED = 0x200
    WATCHDOG_TIMER_EXPIRED = 0x800
    MIN_ENDSTOP_PRESSED = 0x1000
    MAX_ENDSTOP_PRESSED = 0x2000
    ESTOP_REQUESTED = 0x4000
    OVER_TEMP = 0x4_0000
    UNKNOWN_POSITION = 0x8_0000
    MOTOR_ERROR = 1 << 32
    ENCODER_ERROR = 1 << 33
    CONTROLLER_ERROR = 1 << 34


class Heartbeat05(NamedTuple):
    axis_error: int
    axis_state: int
    motor_error_flag: int
    encoder_error_flag: int
    controller_error_flag: int
    trajectory_done_flag: int


class ClearErrors05(NamedTuple):
    """No payload."""


@dataclass(frozen=True, slots=True)
class Axis05Codecs(CodecGroup):
    """Codecs of the messages that are different."""

    heartbeat: Codec[Heartbeat05]
    clear_errors: Codec[ClearErrors05] = field(metadata={"length": 0})
