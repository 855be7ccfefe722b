"""The last look at every outgoing frame: who may send it, is it finite, within limits, allowed now.

A second implementation, apart from controllers and drivers: it decodes the bytes itself and
measures the steering drive's zero itself. It runs on the same computer, so it is no safety
function; the drives' watchdogs and the contactor are.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable
from enum import Enum
from typing import Any, NamedTuple

from config.can import e2e
from config.can.codec import Codec
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import AxisCodecs, AxisState, ControlMode, InputMode
from config.fleet import Limits, Vehicle
from onboard.safety.guard_measurements import Measured
from onboard.safety.rate_budget import RateBudget
from onboard.safety.window_limit import WINDOW_S, WindowLimit

SPEED_SLACK = 1.001
STEERING_SLACK_RAD = 0.01
"""The guard's zero and the driver's differ by the noise of one look at the encoder."""
HOLD_TOLERANCE_RAD = 0.05
"""Without leave to move, a steering setpoint may be this far from the measured position."""
MIN_SPACING_S = 0.0015
"""Between two frames with one identifier: no loop is faster than 500 Hz. Stops are exempt."""
REFERENCE_AGE_S = 0.1
"""A setpoint older than this no longer tells what the motor does; the measurement does."""
MAX_REPORTS = 100
_SAME_REV = 1e-4


class GuardVerdict(Enum):
    """What the guard says about one frame."""

    PASSED = "passed"
    NOT_WHITELISTED = "not whitelisted"
    WRONG_LENGTH = "wrong length"
    WRONG_CONTENT = "wrong content"
    NOT_FINITE = "not finite"
    OVER_LIMIT = "over limit"
    OVER_RATE = "over rate"
    OVER_WINDOW = "over window limit"
    TOO_SOON = "too soon"
    MOTION_NOT_ALLOWED = "motion not allowed"


class Decision(NamedTuple):
    """A verdict and, unless it is PASSED, the reason with value and limit."""

    verdict: GuardVerdict
    reason: str = ""


PASS = Decision(GuardVerdict.PASSED)
_Rule = Callable[[Frame], Decision]


class _Setpoint(NamedTuple):
    value: float
    t_s: float


class TransmitGuard:
    """Feed it received frames with `observe`, outgoing ones with `admit`.

    `motion_allowed` is the gate: while it is False only neutral setpoints (speed 0, steering
    held), stop, clear and state frames pass. `blocked` counts by verdict.
    """

    def __init__(
        self, database: CanDatabase, vehicle: Vehicle, limits: Limits, bearing_unit: int
    ) -> None:
        self.motion_allowed = False
        self.blocked: Counter[GuardVerdict] = Counter()
        self._vehicle = vehicle
        self._limits = limits
        self._measured = Measured(database, vehicle)
        self._speed: _Setpoint | None = None
        self._steering: _Setpoint | None = None
        self._faster = RateBudget(limits.acceleration_mps2)
        self._slower = RateBudget(limits.deceleration_mps2)
        self._turning = RateBudget(limits.steering_rate_radps)
        self._codecs: dict[int, Codec[Any]] = {}
        self._rules: dict[int, _Rule] = {}
        self._speeds = WindowLimit(limits.acceleration_mps2, limits.deceleration_mps2)
        self._angles = WindowLimit(limits.steering_rate_radps, limits.steering_rate_radps)
        self._queries: set[int] = set()
        self._urgent: set[int] = set()
        self._t_passed_s: dict[int, float] = {}
        self._reports: deque[str] = deque(maxlen=MAX_REPORTS)
        self._allow_protected(database.vehicle_aux())
        self._allow_protected(database.bearing_sensor(bearing_unit))
        steering, drive = database.axis(vehicle.steering.node), database.axis(vehicle.drive.node)
        self._allow_axis(steering, ControlMode.POSITION_CONTROL)
        self._allow_axis(drive, ControlMode.VELOCITY_CONTROL)
        self._clear_as_firmware_wants(database, vehicle)
        self._allow(steering.set_input_pos, self._check_steering)
        self._allow(drive.set_input_vel, self._check_speed)

    def observe(self, frame: Frame) -> None:
        """Take a frame that was received."""
        self._measured.observe(frame, self.motion_allowed)

    def admit(self, frames: Iterable[Frame]) -> list[Frame]:
        """The frames that may be sent, in order; the others are counted and reported."""
        return [frame for frame in frames if self._admit_one(frame)]

    def take_reports(self) -> list[str]:
        """The reasons of the frames blocked since the last call, at most the newest 100."""
        reports = list(self._reports)
        self._reports.clear()
        return reports

    def check(self, frame: Frame) -> Decision:
        """Judge one outgoing frame; a setpoint that passes becomes the next one's reference."""
        if frame.remote and frame.can_id in self._queries:
            return self._spaced(frame) or PASS
        codec = self._codecs.get(frame.can_id)
        if codec is None or frame.remote:
            return Decision(
                GuardVerdict.NOT_WHITELISTED, f"0x{frame.can_id:03X} is not for this host to send"
            )
        if len(frame.data) != codec.length:
            return Decision(
                GuardVerdict.WRONG_LENGTH,
                f"{codec.name} has {len(frame.data)} data bytes, the database says {codec.length}",
            )
        return self._spaced(frame) or self._rules[frame.can_id](frame)

    def _spaced(self, frame: Frame) -> Decision | None:
        """Why a frame comes too soon after the last one of its kind that passed, or None."""
        last_s = self._t_passed_s.get(frame.can_id, -math.inf)
        apart_s = frame.t_s - last_s
        if frame.can_id in self._urgent or not 0 <= apart_s < MIN_SPACING_S:
            return None
        return Decision(
            GuardVerdict.TOO_SOON,
            f"{apart_s * 1e3:.2f} ms after the last, limit {MIN_SPACING_S * 1e3:.2f} ms",
        )

    def _admit_one(self, frame: Frame) -> bool:
        decision = self.check(frame)
        if decision.verdict is GuardVerdict.PASSED:
            self._t_passed_s[frame.can_id] = frame.t_s
            return True
        self.blocked[decision.verdict] += 1
        self._reports.append(f"frame 0x{frame.can_id:03X} blocked: {decision.reason}")
        return False

    def _allow(self, codec: Codec[Any], rule: _Rule) -> None:
        assert codec.sender == "Host", f"{codec.name} is {codec.sender}'s to send"
        self._codecs[codec.can_id] = codec
        self._rules[codec.can_id] = rule

    def _allow_protected(self, codecs: Iterable[Codec[Any]]) -> None:
        for codec in codecs:
            if codec.sender == "Host":
                self._allow(codec, _check_protection)

    def _allow_axis(self, axis: AxisCodecs, mode: ControlMode) -> None:
        """What driving needs; settings, torque setpoints and reboots are not among it."""
        states = ((AxisState.IDLE,), (AxisState.CLOSED_LOOP_CONTROL,))
        modes = ((mode, InputMode.PASSTHROUGH),)
        self._urgent |= {axis.estop.can_id, axis.set_axis_state.can_id}
        self._queries |= {
            axis.get_version.can_id,
            axis.get_bus_voltage_current.can_id,
            axis.get_temperature.can_id,
        }
        self._allow(axis.estop, lambda _frame: PASS)
        self._allow(axis.clear_errors, lambda _frame: PASS)
        self._allow(axis.set_axis_state, _one_of(axis.set_axis_state, states))
        self._allow(axis.set_controller_mode, _one_of(axis.set_controller_mode, modes))
        self._allow(axis.set_limits, lambda frame: _check_drive_limits(axis, frame))

    def _clear_as_firmware_wants(self, database: CanDatabase, vehicle: Vehicle) -> None:
        for axis in (vehicle.steering, vehicle.drive):
            if axis.firmware == "0.5":
                self._allow(database.axis_05(axis.node).clear_errors, lambda _frame: PASS)

    def _check_speed(self, frame: Frame) -> Decision:
        rev_per_s, feed_forward = self._codecs[frame.can_id].unpack(frame.data)
        if bad := _bad_numbers("speed setpoint [rev/s]", rev_per_s, feed_forward):
            return bad
        speed_mps = rev_per_s / self._vehicle.drive.revolutions_per_unit
        decision = self._judge_speed(speed_mps, frame.t_s) if speed_mps else PASS
        if decision is PASS:
            self._speed = _Setpoint(speed_mps, frame.t_s)
            self._speeds.add(abs(speed_mps), frame.t_s)
        return decision

    def _judge_speed(self, speed_mps: float, now_s: float) -> Decision:
        limits = self._limits
        if not self.motion_allowed:
            return _not_allowed(f"speed setpoint {speed_mps:.3f} m/s")
        if abs(speed_mps) > limits.speed_mps * SPEED_SLACK:
            return _over_limit("speed setpoint", speed_mps, limits.speed_mps, "m/s")
        before_mps = self._reference(self._speed, self._measured.speed_mps, now_s)
        up_mps, down_mps = _speed_changes(before_mps, speed_mps)
        self._faster.refill(now_s)
        self._slower.refill(now_s)
        if not self._faster.covers(up_mps):
            return _over_rate("speed", before_mps, speed_mps, limits.acceleration_mps2, "m/s")
        if not self._slower.covers(down_mps):
            return _over_rate("speed", before_mps, speed_mps, limits.deceleration_mps2, "m/s")
        if not self._speeds.covers(abs(speed_mps), now_s):
            return _over_window("speed", speed_mps, "m/s")
        self._faster.use(up_mps)
        self._slower.use(down_mps)
        return PASS

    def _check_steering(self, frame: Frame) -> Decision:
        position_rev, *feed_forward = self._codecs[frame.can_id].unpack(frame.data)
        if bad := _bad_numbers("steering setpoint [rev]", position_rev, *feed_forward):
            return bad
        if self.motion_allowed:
            decision = self._judge_steering(position_rev, frame.t_s)
        else:
            decision = self._judge_hold(position_rev)
        if decision is PASS:
            self._steering = _Setpoint(position_rev, frame.t_s)
        return decision

    def _judge_hold(self, position_rev: float) -> Decision:
        if self._steering and abs(position_rev - self._steering.value) <= _SAME_REV:
            return PASS
        if self._measured.position_rev is None:
            return _not_allowed("steering setpoint before any position was measured")
        away_rev = position_rev - self._measured.position_rev
        away_rad = away_rev / self._vehicle.steering.revolutions_per_unit
        if abs(away_rad) <= HOLD_TOLERANCE_RAD:
            return PASS
        return _not_allowed(
            f"steering setpoint {away_rad:.3f} rad from the measured position, "
            f"limit {HOLD_TOLERANCE_RAD:.3f} rad"
        )

    def _judge_steering(self, position_rev: float, now_s: float) -> Decision:
        measured, limits = self._measured, self._limits
        if measured.zero_rev is None or measured.position_rev is None:
            return _not_allowed("steering setpoint before the drive's zero was measured")
        per_rad = self._vehicle.steering.revolutions_per_unit
        angle_rad = (position_rev - measured.zero_rev) / per_rad
        if abs(angle_rad) > limits.steering_rad + STEERING_SLACK_RAD:
            return _over_limit("steering setpoint", angle_rad, limits.steering_rad, "rad")
        before_rev = self._reference(self._steering, measured.position_rev, now_s)
        before_rad = (before_rev - measured.zero_rev) / per_rad
        self._turning.refill(now_s)
        if not self._turning.covers(abs(angle_rad - before_rad)):
            return _over_rate("steering", before_rad, angle_rad, limits.steering_rate_radps, "rad")
        if not self._angles.covers(angle_rad, now_s):
            return _over_window("steering", angle_rad, "rad")
        self._turning.use(abs(angle_rad - before_rad))
        self._angles.add(angle_rad, now_s)
        return PASS

    @staticmethod
    def _reference(last: _Setpoint | None, measured: float, now_s: float) -> float:
        """What the motor does now: the last setpoint, or where that is old the measurement."""
        return last.value if last and now_s - last.t_s <= REFERENCE_AGE_S else measured


def _one_of(codec: Codec[Any], allowed: tuple[tuple[int, ...], ...]) -> _Rule:
    """A rule that lets only some contents of a message pass."""

    def rule(frame: Frame) -> Decision:
        content = codec.unpack(frame.data)
        if tuple(content) in allowed:
            return PASS
        return Decision(GuardVerdict.WRONG_CONTENT, f"{codec.name}: {content} is not allowed")

    return rule


def _check_protection(frame: Frame) -> Decision:
    if e2e.crc_ok(frame.data, e2e.data_id_list(frame.can_id)):
        return PASS
    return Decision(GuardVerdict.WRONG_CONTENT, f"0x{frame.can_id:03X}: CRC does not fit")


def _check_drive_limits(axis: AxisCodecs, frame: Frame) -> Decision:
    content = axis.set_limits.unpack(frame.data)
    if all(math.isfinite(limit) and limit > 0 for limit in content):
        return PASS
    return Decision(GuardVerdict.WRONG_CONTENT, f"drive limits must be above 0: {content}")


def _bad_numbers(what: str, value: float, *feed_forward: float) -> Decision | None:
    if not all(math.isfinite(number) for number in (value, *feed_forward)):
        return Decision(GuardVerdict.NOT_FINITE, f"{what}: {value}, feed-forward {feed_forward}")
    if any(feed_forward):
        return Decision(GuardVerdict.WRONG_CONTENT, f"{what}: feed-forward {feed_forward}, not 0")
    return None


def _speed_changes(before_mps: float, after_mps: float) -> tuple[float, float]:
    """How much of a change speeds up and how much slows down; a reversal does both."""
    if before_mps * after_mps < 0:
        return abs(after_mps), abs(before_mps)
    change_mps = abs(after_mps) - abs(before_mps)
    return max(0.0, change_mps), max(0.0, -change_mps)


def _not_allowed(what: str) -> Decision:
    return Decision(GuardVerdict.MOTION_NOT_ALLOWED, f"{what}, but motion is not allowed now")


def _over_limit(what: str, value: float, limit: float, unit: str) -> Decision:
    return Decision(GuardVerdict.OVER_LIMIT, f"{what} {value:.3f} {unit}, limit {limit:.3f} {unit}")


def _over_window(what: str, value: float, unit: str) -> Decision:
    return Decision(
        GuardVerdict.OVER_WINDOW,
        f"{what} setpoint {value:.3f} {unit} is too far from those of the last {WINDOW_S:.2f} s",
    )


def _over_rate(what: str, before: float, after: float, limit: float, unit: str) -> Decision:
    return Decision(
        GuardVerdict.OVER_RATE,
        f"{what} setpoint from {before:.3f} to {after:.3f} {unit} is faster than "
        f"{limit:.3f} {unit} per s allows",
    )
