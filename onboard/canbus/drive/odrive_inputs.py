"""What one ODrive axis has said last, and whether it still talks."""

import math

from config.can.frame import Frame
from config.can.odrive import AxisCodecs, GetEncoderEstimates
from config.fleet import Failsafe
from onboard.canbus.drive.variant import OdriveVariant, Report
from onboard.canbus.silence import overdue

_LENGTH = 8
"""All messages that are read have 8 bytes; a shorter frame counts as none."""


class OdriveInputs:
    """Keeps the newest of every message of one axis, with the time of its arrival."""

    def __init__(self, codecs: AxisCodecs, variant: OdriveVariant, timeouts: Failsafe) -> None:
        self.heartbeat: Report | None = None
        self.t_heartbeat_s = -math.inf
        self.estimates: GetEncoderEstimates | None = None
        self.t_estimate_s = -math.inf
        self.current_a: float | None = None
        self.bus_voltage_v: float | None = None
        self.temperature_degc: float | None = None
        self.firmware_problem: str | None = None
        self._codecs, self._variant = codecs, variant
        self._timeouts = timeouts

    def on_frame(self, frame: Frame) -> None:
        """Take a frame; those of others, remote ones and truncated ones are ignored."""
        codecs = self._codecs
        if frame.remote or len(frame.data) < _LENGTH:
            return
        if frame.can_id == codecs.get_encoder_estimates.can_id:
            self.estimates = codecs.get_encoder_estimates.unpack(frame.data)
            self.t_estimate_s = frame.t_s
        elif frame.can_id == self._variant.heartbeat_id:
            self.heartbeat = self._variant.report(frame.data)
            self.t_heartbeat_s = frame.t_s
        elif frame.can_id == codecs.get_iq.can_id:
            self.current_a = codecs.get_iq.unpack(frame.data).iq_measured
        elif frame.can_id == codecs.get_bus_voltage_current.can_id:
            voltage = codecs.get_bus_voltage_current.unpack(frame.data).bus_voltage
            self.bus_voltage_v = voltage if math.isfinite(voltage) else None
        elif frame.can_id == codecs.get_version.can_id:
            version = codecs.get_version.unpack(frame.data)
            self.firmware_problem = self._variant.firmware_problem(version)
        elif frame.can_id == codecs.get_temperature.can_id and self._variant.tells_temperature:
            self.temperature_degc = _hottest(codecs.get_temperature.unpack(frame.data))

    def heartbeat_problem(self, now_s: float) -> str | None:
        """Reason where the heartbeat is silent, else None."""
        age_s = now_s - self.t_heartbeat_s if self.heartbeat else None
        return overdue("heartbeat", age_s, self._timeouts.drive_heartbeat_lost.after_s)

    def estimate_problem(self, now_s: float) -> str | None:
        """Reason where the encoder estimates are silent or not finite, else None."""
        if self.estimates is not None and not all(map(math.isfinite, self.estimates)):
            position, velocity = self.estimates
            return f"encoder estimate not finite: {position} rev, {velocity} rev/s"
        age_s = now_s - self.t_estimate_s if self.estimates else None
        return overdue("encoder estimate", age_s, self._timeouts.drive_estimate_stale.after_s)


def _hottest(temperatures: tuple[float, ...]) -> float | None:
    """A missing thermistor reads not-a-number or 0."""
    known = [degc for degc in temperatures if math.isfinite(degc) and degc]
    return max(known, default=None)
