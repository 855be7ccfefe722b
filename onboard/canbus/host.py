"""What the host says of itself: heartbeat and e-stop to the safety node, orders to the sensor."""

from config.can.frame import Frame
from config.can.vehicle import (
    CLOCK_WRAP_MS,
    BearingSensorCodecs,
    EstopSource,
    HostState,
    RequestedState,
    VehicleAuxCodecs,
)
from onboard.canbus.protection import Protector

HEARTBEAT_PERIOD_S = 0.05
ESTOP_PERIOD_S = 0.05
COMMAND_PERIOD_S = 0.1
MAX_TARGETS = 8
"""Targets per look: more would load a bus of 500 kbit/s beyond the plan."""
_EARLY_S = 0.001


class Cyclic:
    """When one cyclic frame is due: on a fixed grid, skipping what was missed."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._next_s: float | None = None

    def due(self, now_s: float) -> bool:
        """True once per period; 1 ms early counts, so that jitter does not cost a cycle."""
        if self._next_s is not None and now_s < self._next_s - _EARLY_S:
            return False
        start_s = now_s if self._next_s is None else self._next_s
        missed = max(0, int((now_s - start_s) / self._period_s))
        self._next_s = start_s + (missed + 1) * self._period_s
        return True


class HostFrames:
    """The host's heartbeat each 50 ms, and the e-stop each 50 ms while one is active."""

    def __init__(self, codecs: VehicleAuxCodecs) -> None:
        self._heartbeat = codecs.host_heartbeat
        self._estop = codecs.estop
        self._heartbeat_protector = Protector(codecs.host_heartbeat.can_id)
        self._estop_protector = Protector(codecs.estop.can_id)
        self._heartbeat_cycle = Cyclic(HEARTBEAT_PERIOD_S)
        self._estop_cycle = Cyclic(ESTOP_PERIOD_S)

    def tick(
        self, now_s: float, state: HostState, estop: EstopSource = EstopSource.NONE
    ) -> list[Frame]:
        """The frames due now; an `estop` other than NONE is announced at once and repeated."""
        frames = []
        if estop is EstopSource.NONE:
            self._estop_cycle = Cyclic(ESTOP_PERIOD_S)
        elif self._estop_cycle.due(now_s):
            data = self._estop_protector.protect(self._estop.pack(1, estop))
            frames.append(Frame(self._estop.can_id, data, now_s))
        if self._heartbeat_cycle.due(now_s):
            payload = self._heartbeat.pack(state, _clock_ms(now_s))
            data = self._heartbeat_protector.protect(payload)
            frames.append(Frame(self._heartbeat.can_id, data, now_s))
        return frames


class BearingOrders:
    """Brg_Command each 100 ms: run, report what the robot needs, and the host's clock."""

    def __init__(self, codecs: BearingSensorCodecs, rate_hz: float) -> None:
        self._codec = codecs.command
        self._protector = Protector(codecs.command.can_id)
        self._cycle = Cyclic(COMMAND_PERIOD_S)
        self._rate_hz = rate_hz

    def tick(self, now_s: float) -> list[Frame]:
        """The frame, where it is due."""
        if not self._cycle.due(now_s):
            return []
        payload = self._codec.pack(
            RequestedState.RUNNING, MAX_TARGETS, 1, 1, self._rate_hz, _clock_ms(now_s)
        )
        return [Frame(self._codec.can_id, self._protector.protect(payload), now_s)]


def _clock_ms(now_s: float) -> float:
    return now_s * 1000 % CLOCK_WRAP_MS
