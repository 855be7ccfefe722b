"""What every motor drive looks like to the robot, whatever it speaks on the bus."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from config.can.frame import Frame


class MotorState(IntEnum):
    """State of a driver. FAULT is latched: only an operator's `clear_faults` leaves it."""

    OFFLINE = 0
    IDLE = 1
    ARMING = 2
    ACTIVE = 3
    STOPPING = 4
    FAULT = 5


@dataclass(frozen=True, slots=True)
class MotorFeedback:
    """One look at a drive. Joint units: m and m/s for a drive axis, rad and rad/s for steering.

    None means that the drive has not said it (yet). `position` of a steering axis needs `align`
    first; that of a drive axis counts from wherever the drive's encoder began. `reason` says why
    the driver is in its state; `faults` are the drive's own error names. Times are monotonic.
    `temperature_degc` is the hotter of inverter and motor; `firmware_problem` why the drive is not
    the one expected.
    """

    state: MotorState
    reason: str
    faults: tuple[str, ...]
    position: float | None
    velocity: float | None
    t_estimate_s: float | None
    t_heartbeat_s: float | None
    current_a: float | None
    bus_voltage_v: float | None
    temperature_degc: float | None = None
    watchdog_expired: bool = False
    firmware_problem: str | None = None


class MotorDriver(Protocol):
    """A drive's protocol without input and output: frames in, frames out, time passed in."""

    @property
    def feedback(self) -> MotorFeedback:
        """What is known of the drive now."""
        ...

    def on_frame(self, frame: Frame) -> None:
        """Take a frame from the bus; frames of others are ignored."""
        ...

    def arm(self) -> str | None:
        """Ask for closed-loop control; returns why not, or None where arming begins."""
        ...

    def command(self, value: float) -> None:
        """Setpoint [m/s or rad] of the next `tick`; without one a tick sends the neutral one."""
        ...

    def disarm(self) -> None:
        """Ask the drive to let go of the motor."""
        ...

    def estop(self) -> None:
        """Disarm at once by the drive's emergency stop, and latch FAULT."""
        ...

    def clear_faults(self) -> None:
        """An operator's reset: clear the drive's errors and this driver's fault."""
        ...

    def tick(self, now_s: float) -> list[Frame]:
        """Check timeouts and return everything to send in this cycle, the setpoint included."""
        ...
