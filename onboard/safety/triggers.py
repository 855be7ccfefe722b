"""Every trigger of the failsafe table: what is looked at, and the sentence for what was seen.

A check of a silence applies the row's `after_s` itself, so that its sentence can name the age and
the limit; the other conditions are `lasting`, and the table counts for how long they have stood.
"""

from collections.abc import Callable
from typing import NamedTuple

from config.failsafe import Failsafe
from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.canbus.silence import ROUNDING_S, silence
from onboard.safety.observations import DriveSeen, Observations
from onboard.safety.states import State

LEADER_STATES_TO_FOLLOW = (State.ARMING, State.ARMED, State.RUNNING, State.STOPPING)

Check = Callable[[Observations, Failsafe], str | None]


class Trigger(NamedTuple):
    """One row: its name in the fleet file, what it looks at, and the check.

    `fault`: a stop for it ends in FAULT, because a person has to look.
    """

    name: str
    meaning: str
    check: Check
    lasting: bool = True
    fault: bool = False


def _bearings_stale(seen: Observations, table: Failsafe) -> str | None:
    return silence(
        "bearing sensor", "usable bearing", seen.bearing_age_s, table.bearings_stale.after_s
    )


def _mutual_bearing_lost(seen: Observations, table: Failsafe) -> str | None:
    age_s = seen.estimate.mutual_age_s
    if seen.leader is None or age_s is None:
        return None
    name = f"leader {seen.leader.name}"
    return silence(name, "bearing to this robot", age_s, table.mutual_bearing_lost.after_s)


def _leader_stale(seen: Observations, table: Failsafe) -> str | None:
    if seen.leader is None:
        return None
    name = f"leader {seen.leader.name}"
    return silence(name, "message", seen.leader.age_s, table.leader_stale.after_s)


def _leader_unfit(seen: Observations, _table: Failsafe) -> str | None:
    leader = seen.leader
    if leader is None:
        return None
    if leader.problem is not None:
        return f"leader {leader.name} {leader.problem}"
    if leader.state is None or seen.state is not State.RUNNING:
        return None
    if leader.state in LEADER_STATES_TO_FOLLOW:
        return None
    return f"leader {leader.name} is in state {leader.state}"


def _either(seen: Observations, check: Callable[[str, DriveSeen], str | None]) -> str | None:
    return check("drive", seen.drive) or check("steering", seen.steering)


def _drive_heartbeat(seen: Observations, table: Failsafe) -> str | None:
    limit_s = table.drive_heartbeat_lost.after_s
    return _either(
        seen, lambda name, axis: silence(name, "heartbeat", axis.heartbeat_age_s, limit_s)
    )


def _drive_estimate(seen: Observations, table: Failsafe) -> str | None:
    limit_s = table.drive_estimate_stale.after_s
    return _either(
        seen, lambda name, axis: silence(name, "encoder estimate", axis.estimate_age_s, limit_s)
    )


def _watchdog(seen: Observations, _table: Failsafe) -> str | None:
    return _either(
        seen, lambda name, axis: f"{name}: {axis.reason}" if axis.watchdog_expired else None
    )


def _drive_error(seen: Observations, _table: Failsafe) -> str | None:
    return _either(seen, _axis_error)


def _axis_error(name: str, axis: DriveSeen) -> str | None:
    if axis.state is MotorState.FAULT:
        return f"{name}: {axis.reason}"
    return f"{name}: drive is offline, {axis.reason}" if axis.state is MotorState.OFFLINE else None


def _encoder_stale(seen: Observations, table: Failsafe) -> str | None:
    return silence("steering encoder", "angle", seen.encoder_age_s, table.encoder_stale.after_s)


def _disagreement(seen: Observations, table: Failsafe) -> str | None:
    limit_rad = table.steering_disagreement.limit_rad
    if seen.disagreement_rad is None or not abs(seen.disagreement_rad) > limit_rad:
        return None
    return (
        f"steering drive and encoder disagree by {abs(seen.disagreement_rad):.3f} rad, "
        f"limit {limit_rad:.3f} rad"
    )


def _drive_response(seen: Observations, table: Failsafe) -> str | None:
    limit_mps, wheel = table.drive_response.limit_mps, seen.speed_response
    if wheel is None or wheel.beyond <= limit_mps:
        return None
    return (
        f"drive: the wheel turns at {wheel.measured:.2f} m/s, asked for were {wheel.least:.2f} to "
        f"{wheel.most:.2f} m/s, limit {limit_mps:.2f} m/s beyond"
    )


def _steering_response(seen: Observations, table: Failsafe) -> str | None:
    limit_rad, fork = table.steering_response.limit_rad, seen.steering_response
    if fork is None or fork.beyond <= limit_rad:
        return None
    return (
        f"steering: the fork is at {fork.measured:.3f} rad, asked for were {fork.least:.3f} to "
        f"{fork.most:.3f} rad, limit {limit_rad:.3f} rad beyond"
    )


def _bearings_repeat(seen: Observations, table: Failsafe) -> str | None:
    limit_s = table.bearings_repeat.after_s
    if seen.bearings_repeat_s <= limit_s + ROUNDING_S:
        return None
    return (
        f"bearing sensor: the very same bearings for {seen.bearings_repeat_s:.2f} s, "
        f"limit {limit_s:.2f} s"
    )


def _bus_passive(seen: Observations, _table: Failsafe) -> str | None:
    passive = seen.bus_state is BusState.PASSIVE
    return f"CAN bus {seen.bus_state}: {seen.bus_reason}" if passive else None


def _bus_off(seen: Observations, _table: Failsafe) -> str | None:
    if seen.bus_state in (BusState.ACTIVE, BusState.PASSIVE):
        return None
    return f"CAN bus {seen.bus_state}: {seen.bus_reason}"


def _send_queue(seen: Observations, _table: Failsafe) -> str | None:
    if not seen.frames_dropped:
        return None
    return f"CAN bus: {seen.frames_dropped} frames of one cycle could not be sent, queue full"


def _loop(seen: Observations, table: Failsafe) -> str | None:
    limit_s = table.loop_overrun.after_s
    if seen.loop_late_s <= limit_s:
        return None
    return f"control loop {seen.loop_late_s:.3f} s late, limit {limit_s:.3f} s"


def _clock(seen: Observations, table: Failsafe) -> str | None:
    limit_s = table.clock_step.limit_s
    if abs(seen.clock_step_s) <= limit_s:
        return None
    return f"wall clock stepped by {seen.clock_step_s:+.3f} s, limit {limit_s:.3f} s"


def _ground(seen: Observations, table: Failsafe) -> str | None:
    if table.ground_lost is None:
        return None
    return silence("ground station", "heartbeat", seen.ground_age_s, table.ground_lost.after_s)


def _battery(seen: Observations, table: Failsafe) -> str | None:
    limit_v = table.battery_low.limit_v

    def low(name: str, axis: DriveSeen) -> str | None:
        if axis.supply_v is None or axis.supply_v >= limit_v:
            return None
        return f"{name}: supply {axis.supply_v:.1f} V, limit {limit_v:.1f} V"

    return _either(seen, low)


def _temperature(seen: Observations, table: Failsafe) -> str | None:
    limit_degc = table.temperature_high.limit_degc

    def hot(name: str, axis: DriveSeen) -> str | None:
        if axis.temperature_degc is None or axis.temperature_degc <= limit_degc:
            return None
        return f"{name}: {axis.temperature_degc:.0f} degC, limit {limit_degc:.0f} degC"

    return _either(seen, hot)


def _safety_node(seen: Observations, table: Failsafe) -> str | None:
    if seen.safety_node is None:
        return None
    limit_s = table.safety_node_lost.after_s
    return silence("safety node", "status", seen.safety_node.age_s, limit_s)


def _power(seen: Observations, _table: Failsafe) -> str | None:
    if seen.safety_node is None or seen.safety_node.power:
        return None
    return "safety node: the motor supply is off"


TRIGGERS: tuple[Trigger, ...] = (
    Trigger("bus_off", "bus-off, or the link to the bus lost", _bus_off, fault=True),
    Trigger("bus_passive", "the controller is error-passive", _bus_passive),
    Trigger("power_off", "the safety node says that the motor supply is off", _power, fault=True),
    Trigger(
        "drive_heartbeat_lost", "age of a drive's heartbeat", _drive_heartbeat, False, fault=True
    ),
    Trigger(
        "drive_estimate_stale", "age of a drive's estimates", _drive_estimate, False, fault=True
    ),
    Trigger("watchdog_trip", "a drive's watchdog has expired", _watchdog, fault=True),
    Trigger(
        "drive_error", "a drive has left closed loop or reports an error", _drive_error, fault=True
    ),
    Trigger("safety_node_lost", "age of the safety node's status, once heard", _safety_node, False),
    Trigger("encoder_stale", "age of the steering encoder's angle", _encoder_stale, False),
    Trigger(
        "encoder_error",
        "the steering encoder calls its angle invalid",
        lambda seen, _table: seen.encoder_problem,
    ),
    Trigger("steering_disagreement", "steering drive against encoder", _disagreement),
    Trigger(
        "drive_response", "wheel speed against its setpoints of 0.2 s", _drive_response, fault=True
    ),
    Trigger(
        "steering_response",
        "steering angle against its setpoints of 0.2 s",
        _steering_response,
    ),
    Trigger("leader_stale", "age of the leader's newest message", _leader_stale, False),
    Trigger("leader_unfit", "the leader does not know its motion, or has given up", _leader_unfit),
    Trigger(
        "bearing_sensor_lost",
        "the bearing sensor is silent, or in fault",
        lambda seen, _table: seen.bearing_problem,
    ),
    Trigger(
        "bearings_repeat",
        "how long the sensor has given the very same bearings while driving",
        _bearings_repeat,
        False,
    ),
    Trigger("bearings_stale", "age of the last bearing that is needed", _bearings_stale, False),
    Trigger(
        "distance_low",
        "range less three deviations below `limit_m`",
        lambda seen, _table: seen.estimate.too_near,
    ),
    Trigger(
        "estimator_reset",
        "the estimator has lost what it estimates",
        lambda seen, _table: seen.estimate.lost,
    ),
    Trigger(
        "nis_alarm",
        "bearings fit worse than the filter claims",
        lambda seen, _table: seen.estimate.nis,
    ),
    Trigger(
        "unobservable",
        "driven for `observability.hold_s` on weak geometry",
        lambda seen, _table: seen.estimate.unobservable,
    ),
    Trigger(
        "range_deviation",
        "deviation of the range above `limit_fraction` of it",
        lambda seen, _table: seen.estimate.range_uncertain,
    ),
    Trigger(
        "mutual_bearing_lost", "age of the leader's look at this robot", _mutual_bearing_lost, False
    ),
    Trigger("send_queue_full", "frames that could not be sent", _send_queue),
    Trigger("loop_overrun", "how late the control loop is", _loop, False),
    Trigger("clock_step", "jump of the wall clock above `limit_s`", _clock),
    Trigger("ground_lost", "age of the ground station's heartbeat", _ground, False),
    Trigger("battery_low", "supply below `limit_v`", _battery),
    Trigger("temperature_high", "inverter or motor above `limit_degc`", _temperature),
    Trigger(
        "process_ending",
        "SIGTERM or SIGINT",
        lambda seen, _table: "the onboard process is being stopped" if seen.ending else None,
    ),
)
"""In the order in which the first of equally severe ones speaks: causes before consequences."""
