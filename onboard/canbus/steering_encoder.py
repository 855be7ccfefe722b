"""The absolute steering encoder: road-wheel angle, left positive, with end-to-end protection."""

from config.can.frame import Frame
from config.can.vehicle import SteeringAngle, VehicleAuxCodecs
from onboard.canbus.protection import Receiver
from onboard.canbus.silence import silence


class SteeringEncoder:
    """Keeps the newest angle that passed its check and that the encoder calls valid."""

    def __init__(self, codecs: VehicleAuxCodecs, timeout_s: float) -> None:
        self._codec = codecs.steering_angle
        self._protection = Receiver(self._codec.can_id, self._codec.length)
        self._timeout_s = timeout_s
        self._last: SteeringAngle | None = None
        self._t_s: float | None = None

    @property
    def angle_rad(self) -> float | None:
        """The last angle; None until one came, and while the encoder says that it is invalid."""
        last = self._last
        return last.angle if last is not None and _is_usable(last) else None

    @property
    def rate_radps(self) -> float | None:
        """Rate of the last angle; None where `angle_rad` is."""
        last = self._last
        return last.rate if last is not None and _is_usable(last) else None

    def on_frame(self, frame: Frame) -> None:
        """Take a frame; those of others, remote ones and those that fail their check are not."""
        if frame.can_id != self._codec.can_id or frame.remote:
            return
        if self._protection.accept(frame.data):
            self._last = self._codec.unpack(frame.data)
            self._t_s = frame.t_s

    def stale_for(self, now_s: float) -> float | None:
        """Age of the last angle [s]; None before the first."""
        return None if self._t_s is None else now_s - self._t_s

    def problem(self, now_s: float) -> str | None:
        """Why the angle is not to be relied on, or None."""
        overdue = silence("steering encoder", "angle", self.stale_for(now_s), self._timeout_s)
        return overdue or self.complaint

    @property
    def complaint(self) -> str | None:
        """What the encoder itself says against its last angle, or None."""
        if self._last is None or _is_usable(self._last):
            return None
        return f"steering encoder: {_complaint(self._last)}"


def _is_usable(angle: SteeringAngle) -> bool:
    return bool(angle.angle_valid and angle.angle_referenced and not angle.fault_internal)


def _complaint(angle: SteeringAngle) -> str:
    complaints = {
        "angle not valid": not angle.angle_valid,
        "angle not referenced": not angle.angle_referenced,
        "magnet fault": angle.fault_magnet,
        "internal fault": angle.fault_internal,
    }
    return ", ".join(text for text, applies in complaints.items() if applies)
