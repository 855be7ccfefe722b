"""Do the joints do what their setpoints ask? No model of the motors is needed to tell.

A loop that lags by less than `WINDOW_S` is always between the least and the greatest setpoint of
that time; what is measured outside is an error of the loop, of the mechanics or of the sensor. The
wheel's speed is measured twice, as the drive reports it and from the way that it reports, so that
a frozen estimate shows too; the steering angle twice, by drive and by encoder.
"""

import math
from collections import deque
from collections.abc import Iterable

from onboard.canbus.drive.driver import MotorFeedback
from onboard.control.steering import WheelSetpoint
from onboard.safety.observations import Response

WINDOW_S = 0.2
WAY_WINDOW_S = 0.1
"""The speed from the way is a mean over so long, at least."""


class ResponseWatch:
    """Remembers the setpoints of both joints and the way of the wheel; time is passed in."""

    def __init__(self) -> None:
        self._speeds: deque[tuple[float, float]] = deque()
        self._angles: deque[tuple[float, float]] = deque()
        self._ways: deque[tuple[float, float]] = deque()

    def ask(self, now_s: float, setpoint: WheelSetpoint | None, powered: bool) -> None:
        """The setpoints sent in this cycle; without any, powered drives hold still.

        Where the fork is held is the drive's business, so nothing is compared with it then.
        """
        if not powered:
            self._speeds.clear()
        if setpoint is None:
            self._angles.clear()
        else:
            _keep(self._angles, now_s, setpoint.steering_rad, WINDOW_S)
        if powered:
            _keep(self._speeds, now_s, 0.0 if setpoint is None else setpoint.speed_mps, WINDOW_S)

    def speed(self, drive: MotorFeedback) -> Response | None:
        """Wheel speed [m/s] against its setpoints; None before the first one."""
        if drive.position is not None and drive.t_estimate_s is not None:
            _keep(self._ways, drive.t_estimate_s, drive.position, WAY_WINDOW_S)
        return _worst(self._speeds, [drive.velocity, self._speed_from_way_mps()])

    def angle(self, steering: MotorFeedback, encoder_rad: float | None) -> Response | None:
        """Steering angle [rad] against its setpoints; None before the first one."""
        return _worst(self._angles, [encoder_rad, steering.position])

    def _speed_from_way_mps(self) -> float | None:
        if not self._ways:
            return None
        (first_s, first_m), (last_s, last_m) = self._ways[0], self._ways[-1]
        passed_s = last_s - first_s
        return (last_m - first_m) / passed_s if passed_s >= WAY_WINDOW_S - 1e-3 else None


def _keep(values: deque[tuple[float, float]], t_s: float, value: float, window_s: float) -> None:
    """Add a value unless its time is known, and drop all but one that are older than the window."""
    if values and t_s <= values[-1][0]:
        return
    values.append((t_s, value))
    while len(values) > 1 and values[1][0] <= t_s - window_s:
        values.popleft()


def _worst(asked: deque[tuple[float, float]], measured: Iterable[float | None]) -> Response | None:
    """The measured value that is furthest outside; what is no number is the drive's own fault."""
    known = [value for value in measured if value is not None and math.isfinite(value)]
    if not asked or not known:
        return None
    values = [value for _, value in asked]
    least, most = min(values), max(values)
    return max((Response(value, least, most) for value in known), key=lambda each: each.beyond)
