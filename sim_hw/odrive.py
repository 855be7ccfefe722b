"""Emulated ODrive axis on the bus: protocol CANSimple, firmware 0.6.

SDO and node assignment are not emulated; feed-forwards are ignored.
"""

import math
from collections.abc import Callable
from typing import Any

from numpy.random import Generator

from config.can.codec import Codec
from config.can.frame import Frame
from config.can.odrive import (
    BROADCAST_NODE,
    AxisCodecs,
    AxisError,
    GetBusVoltageCurrent,
    GetEncoderEstimates,
    GetError,
    GetIq,
    GetPowers,
    GetTemperature,
    GetTorques,
    GetVersion,
    Heartbeat,
    ProcedureResult,
    RebootAction,
)
from sim_hw.axis import INITIALISING_S, Axis
from sim_hw.faults import DeviceFaults
from sim_hw.motor import Motor
from sim_hw.timing import Cycle

REBOOT_S = 1.0

_COMMAND_BITS = 5
_COMMAND_MASK = 0x1F
_BUS_VOLTAGE_V = 24.0
_LEAST_VOLTAGE_V = 12.0
_TEMPERATURE_DEGC = 30.0
_MOST_TEMPERATURE_DEGC = 80.0
_VERSION = GetVersion(2, 4, 4, 58, 0, 6, 11, 0)


class OdriveAxis:
    """One axis with its motor, powered up and idle at `t_s`.

    `encoder_std_rev` is white noise on the estimates: revolutions, and revolutions per second.
    Faults are begun and ended through this class, since some of them happen to the axis.
    """

    def __init__(
        self,
        codecs: AxisCodecs,
        motor: Motor,
        *,
        t_s: float,
        velocity_limit_rps: float,
        watchdog_s: float,
        encoder_std_rev: float,
        rng: Generator,
        faults: DeviceFaults,
    ) -> None:
        self.faults = faults
        self._motor = motor
        self.axis = Axis(
            motor, t_s=t_s, velocity_limit_rps=velocity_limit_rps, watchdog_s=watchdog_s
        )
        self._codecs = codecs
        self._node = codecs.heartbeat.can_id >> _COMMAND_BITS
        self._encoder_std_rev = encoder_std_rev
        self._rng = rng
        self._out: list[Frame] = []
        self._actions = self._action_table()
        self._answers = self._answer_table()
        self._start_sending(t_s)

    @property
    def next_due_s(self) -> float:
        """When the next cyclic frame is due."""
        return min(self._heartbeat.next_s, self._estimates.next_s)

    def on_frame(self, frame: Frame, t_s: float) -> None:
        """Take a frame from the bus; frames for others, unknown or too short ones do nothing."""
        node, command = frame.can_id >> _COMMAND_BITS, frame.can_id & _COMMAND_MASK
        if node not in (self._node, BROADCAST_NODE) or t_s < self._boot_s:
            return
        self.axis.at(t_s)
        if frame.remote or not frame.data:
            self._answer(command, t_s)
        if not frame.remote and command in self._actions:
            codec, act = self._actions[command]
            if len(frame.data) >= codec.min_length:
                act(*codec.unpack(frame.data))

    def advance(self, t_s: float) -> list[Frame]:
        """Move on to `t_s` and return the frames sent since the last call."""
        self.axis.advance(t_s)
        if self.faults.any:
            self._suffer(t_s)
        if self._heartbeat.due(t_s) and not self._leaves_out("heartbeat"):
            self._send(self._codecs.heartbeat, self._heartbeat_row(), t_s)
        if self._estimates.due(t_s) and not self._leaves_out("estimates"):
            self._send(self._codecs.get_encoder_estimates, self._estimates_row(), t_s)
        if not self._out:
            return self._out
        frames, self._out = self._out, []
        return frames

    def begin_fault(self, kind: str, value: float | None, t_s: float) -> None:
        """Start one of the drive's faults."""
        self.axis.at(t_s)
        if kind == "disarm":
            self.axis.to_idle(ProcedureResult.SUCCESS)
        elif kind == "failed":
            self.axis.trip(AxisError.DRV_FAULT)
        elif kind == "restart":
            self._reboot()
        else:
            self.faults.begin(kind, value, t_s)
            self._motor.jammed = self.faults.has("jammed")
            if kind == "off":
                self._lose_power(math.inf)

    def end_fault(self, kind: str, t_s: float) -> None:
        """End one of the drive's faults; power that comes back boots it."""
        self.axis.at(t_s)
        had_power = not self.faults.has("off")
        self.faults.end(kind)
        self._motor.jammed = self.faults.has("jammed")
        if kind == "off" and not had_power:
            self._lose_power(t_s)

    @property
    def temperature_degc(self) -> float:
        """Of the inverter."""
        if not self.faults.has("overheat"):
            return _TEMPERATURE_DEGC
        warming_s = self.faults.lasts_s("overheat", self.axis.now_s)
        return _TEMPERATURE_DEGC + self.faults.value("overheat") * warming_s

    @property
    def supply_v(self) -> float:
        """Voltage of the DC bus."""
        return self.faults.value("undervolt") if self.faults.has("undervolt") else _BUS_VOLTAGE_V

    def _suffer(self, t_s: float) -> None:
        """What heat and voltage do to the axis; their errors come back until they are gone."""
        if t_s < self._boot_s:
            return
        if self.temperature_degc >= _MOST_TEMPERATURE_DEGC:
            self.axis.trip(AxisError.INVERTER_OVER_TEMP)
        if self.supply_v < _LEAST_VOLTAGE_V:
            self.axis.trip(AxisError.DC_BUS_UNDER_VOLTAGE)

    def _leaves_out(self, message: str) -> bool:
        return self.faults.any and self.faults.skips(message)

    def _reboot(self) -> None:
        self._lose_power(self.axis.now_s + REBOOT_S)

    def _lose_power(self, boot_s: float) -> None:
        """Silent and deaf until `boot_s`, then as after power-up."""
        self.axis.boot(boot_s, initialised_s=boot_s + INITIALISING_S)
        self._out.clear()
        self._start_sending(boot_s)

    def _start_sending(self, boot_s: float) -> None:
        self._boot_s = boot_s
        estimates_s = self._codecs.get_encoder_estimates.cycle_time_s
        self._heartbeat = Cycle(boot_s, self._codecs.heartbeat.cycle_time_s)
        self._estimates = Cycle(boot_s + self._rng.random() * estimates_s, estimates_s)

    def _action_table(self) -> dict[int, tuple[Codec[Any], Callable[..., object]]]:
        codecs, axis = self._codecs, self.axis
        actions: list[tuple[Codec[Any], Callable[..., object]]] = [
            (codecs.estop, lambda: axis.trip(AxisError.ESTOP_REQUESTED)),
            (codecs.set_axis_state, axis.request_state),
            (codecs.set_controller_mode, self._on_controller_mode),
            (codecs.set_input_pos, lambda position, *_: axis.input_position(position)),
            (codecs.set_input_vel, lambda velocity, *_: axis.input_velocity(velocity)),
            (codecs.set_input_torque, axis.accepts_input),
            (codecs.set_limits, self._on_limits),
            (codecs.reboot, self._on_reboot),
            (codecs.clear_errors, lambda _: axis.clear_errors()),
            (codecs.set_absolute_position, axis.set_position),
        ]
        return {codec.can_id & _COMMAND_MASK: (codec, act) for codec, act in actions}

    def _on_controller_mode(self, control_mode: int, input_mode: int) -> None:
        self.axis.control_mode = control_mode
        self.axis.input_mode = input_mode

    def _on_limits(self, velocity_rps: float, _current_a: float) -> None:
        if velocity_rps >= 0.0:
            self.axis.velocity_limit_rps = velocity_rps

    def _on_reboot(self, action: int) -> None:
        if action in (RebootAction.REBOOT, RebootAction.SAVE_CONFIGURATION):
            self._reboot()

    def _answer_table(self) -> dict[int, tuple[Codec[Any], Callable[[], tuple[float, ...]]]]:
        codecs, axis = self._codecs, self.axis
        answers: list[tuple[Codec[Any], Callable[[], tuple[float, ...]]]] = [
            (codecs.get_version, lambda: _VERSION),
            (codecs.heartbeat, self._heartbeat_row),
            (codecs.get_error, lambda: GetError(axis.active_errors, axis.disarm_reason)),
            (codecs.get_encoder_estimates, self._estimates_row),
            (codecs.get_iq, lambda: GetIq(0.0, 0.0)),
            (codecs.get_temperature, lambda: GetTemperature(self.temperature_degc, math.nan)),
            (codecs.get_bus_voltage_current, lambda: GetBusVoltageCurrent(self.supply_v, 0.0)),
            (codecs.get_torques, lambda: GetTorques(0.0, 0.0)),
            (codecs.get_powers, lambda: GetPowers(0.0, 0.0)),
        ]
        return {codec.can_id & _COMMAND_MASK: (codec, row) for codec, row in answers}

    def _answer(self, command: int, t_s: float) -> None:
        if command in self._answers:
            codec, row = self._answers[command]
            self._send(codec, row(), t_s)

    def _send(self, codec: Codec[Any], row: tuple[float, ...], t_s: float) -> None:
        self._out.append(Frame(codec.can_id, codec.pack(*row), t_s))

    def _heartbeat_row(self) -> Heartbeat:
        errors = self.axis.active_errors | self.axis.disarm_reason
        return Heartbeat(errors, self.axis.state, self.axis.result, trajectory_done_flag=1)

    def _estimates_row(self) -> GetEncoderEstimates:
        position, velocity = self.axis.position_rev, self.axis.motor.velocity_rps
        if self._encoder_std_rev:
            position += self._encoder_std_rev * self._rng.standard_normal()
            velocity += self._encoder_std_rev * self._rng.standard_normal()
        return GetEncoderEstimates(*self.faults.distort((position, velocity)))
