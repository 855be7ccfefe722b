"""The safety node's status: emergency-stop button and latch, motor supply. It may be absent."""

from config.can.frame import Frame
from config.can.vehicle import SafetyStatus, VehicleAuxCodecs
from onboard.canbus.protection import Receiver
from onboard.safety.observations import SafetyNodeSeen


class SafetyNode:
    """Keeps the newest status that passed its check."""

    def __init__(self, codecs: VehicleAuxCodecs) -> None:
        self._codec = codecs.safety_status
        self._protection = Receiver(self._codec.can_id, self._codec.length)
        self._last: SafetyStatus | None = None
        self._t_s = 0.0

    def on_frame(self, frame: Frame) -> None:
        """Take a frame; those of others, remote ones and those that fail their check are not."""
        if frame.can_id != self._codec.can_id or frame.remote:
            return
        if self._protection.accept(frame.data):
            self._last, self._t_s = self._codec.unpack(frame.data), frame.t_s

    def seen(self, now_s: float) -> SafetyNodeSeen | None:
        """The last status and its age; None before the first."""
        last = self._last
        if last is None:
            return None
        return SafetyNodeSeen(
            age_s=now_s - self._t_s,
            button=bool(last.estop_button),
            latched=bool(last.estop_latched),
            power=bool(last.power_enabled),
        )
