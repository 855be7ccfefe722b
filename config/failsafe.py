"""The failsafe table of a robot: what each trigger leads to, after how long, and what comes next.

A row that a fleet file gives in part keeps its defaults for the rest.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from config.section import NonNegative, Positive, Section

Action = Literal["warn", "slow", "hold_distance", "stop", "idle", "estop"]
"""By rising severity.

`slow` drives the schedule at `slow_factor` of its pace; `hold_distance` falls back to
`spacing_factor` times the wanted distance. A leader has nobody to fall back from and slows down in
either case; a follower would lose its leader and falls back in either case. `stop` ramps to
standstill and lets go of the drives, `idle` lets go at once: the motors coast.
"""

Halt = Literal["stop", "idle", "estop"]
"""What is left where a robot cannot go on whatever the fleet file says."""


class Escalation(Section):
    """The next step, so long after the step before it began."""

    after_s: NonNegative
    action: Action
    then: "Escalation | None" = None


class Reaction(Section):
    """What a trigger leads to once a silence, or the condition itself, has lasted `after_s`."""

    after_s: NonNegative
    action: Action
    then: Escalation | None = None


class Halting(Section):
    """The same for a trigger that a robot cannot drive on with."""

    after_s: NonNegative
    action: Halt
    then: Escalation | None = None


class RangeLimit(Reaction):
    """The standard deviation of a follower's range, as a fraction of the range."""

    limit_fraction: Annotated[float, Field(gt=0, lt=1)]


class DistanceLimit(Reaction):
    """A follower's range to its leader, less three standard deviations."""

    limit_m: Positive


class AngleLimit(Reaction):
    """A difference of angles."""

    limit_rad: Positive


class SpeedLimit(Reaction):
    """How far a wheel's speed may be from what its setpoints have asked for lately."""

    limit_mps: Positive


class ClockLimit(Reaction):
    """A jump of the wall clock against the monotonic one."""

    limit_s: Positive


class VoltageLimit(Reaction):
    """The lowest supply voltage that is good; 0 is never reached."""

    limit_v: NonNegative


class TemperatureLimit(Reaction):
    """The highest temperature of inverter or motor that is good."""

    limit_degc: Positive


def _row(after_s: float, action: Action, then: Escalation | None = None) -> Reaction:
    return Reaction(after_s=after_s, action=action, then=then)


def _halt(after_s: float, action: Halt) -> Halting:
    return Halting(after_s=after_s, action=action)


class Failsafe(Section):
    """The failsafe table. Actions hold while the drives are powered, or about to be.

    `stop` ends in STANDBY, or in FAULT where a drive was the cause; `idle` ends in FAULT.
    """

    bearings_stale: Reaction = _row(0.3, "stop")
    bearing_sensor_lost: Reaction = _row(0.0, "stop")
    bearings_repeat: Reaction = _row(0.3, "stop")
    mutual_bearing_lost: Reaction = _row(1.0, "warn")
    leader_stale: Reaction = _row(0.2, "stop")
    leader_unfit: Reaction = _row(0.0, "stop")
    distance_low: DistanceLimit = DistanceLimit(limit_m=0.2, after_s=0.0, action="stop")
    range_deviation: RangeLimit = RangeLimit(
        limit_fraction=0.15, after_s=0.0, action="hold_distance"
    )
    nis_alarm: Reaction = _row(0.0, "stop")
    estimator_reset: Reaction = _row(0.0, "stop")
    unobservable: Reaction = _row(0.0, "stop")
    drive_heartbeat_lost: Halting = _halt(0.35, "stop")
    drive_estimate_stale: Halting = _halt(0.05, "stop")
    drive_error: Halting = _halt(0.0, "stop")
    watchdog_trip: Halting = _halt(0.0, "stop")
    encoder_stale: Halting = _halt(0.05, "stop")
    encoder_error: Halting = _halt(0.0, "stop")
    steering_disagreement: AngleLimit = AngleLimit(limit_rad=0.15, after_s=0.0, action="stop")
    drive_response: SpeedLimit = SpeedLimit(limit_mps=0.2, after_s=0.1, action="stop")
    steering_response: AngleLimit = AngleLimit(limit_rad=0.1, after_s=0.1, action="stop")
    bus_passive: Reaction = _row(0.0, "stop")
    bus_off: Halting = _halt(0.0, "idle")
    send_queue_full: Reaction = _row(0.1, "stop")
    loop_overrun: Reaction = _row(0.05, "stop")
    clock_step: ClockLimit = ClockLimit(limit_s=0.05, after_s=0.05, action="stop")
    ground_lost: Reaction | None = Field(
        default=None, description="heartbeat of the ground station; nothing where it is not given"
    )
    battery_low: VoltageLimit = VoltageLimit(
        limit_v=0.0, after_s=2.0, action="warn", then=Escalation(after_s=30.0, action="stop")
    )
    temperature_high: TemperatureLimit = TemperatureLimit(
        limit_degc=70.0, after_s=1.0, action="slow", then=Escalation(after_s=10.0, action="stop")
    )
    safety_node_lost: Halting = _halt(0.35, "stop")
    power_off: Halting = _halt(0.0, "idle")
    process_ending: Halting = _halt(0.0, "stop")

    slow_factor: Annotated[float, Field(gt=0, lt=1)] = 0.5
    spacing_factor: Annotated[float, Field(gt=1, le=10)] = 2.0

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, given: Any) -> Any:
        """Rows given in part take the rest from the defaults."""
        if not isinstance(given, dict):
            return given
        rows = {name: field.default for name, field in cls.model_fields.items()}
        rows["ground_lost"] = _row(1.0, "stop")
        return {
            name: rows[name].model_dump() | row
            if isinstance(row, dict) and isinstance(rows.get(name), Section)
            else row
            for name, row in given.items()
        }

    @model_validator(mode="after")
    def _process_ending_is_immediate(self) -> Self:
        if self.process_ending.after_s:
            raise ValueError("`process_ending.after_s` must be 0: the process is being stopped")
        return self
