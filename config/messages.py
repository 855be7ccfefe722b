"""Messages between processes: msgspec Structs, JSON on the wire.

Every message carries `seq` (per publisher and topic), `t_ns` (monotonic time at which its content
was true, comparable between processes of one host), `wall_ns` (the same instant on the wall clock)
and `valid`. Angles are radians in (-pi, pi], anticlockwise positive.
"""

from typing import TypeVar

import msgspec

StructT = TypeVar("StructT", bound=msgspec.Struct)


class Message(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """What every published message starts with."""

    seq: int
    t_ns: int
    wall_ns: int
    valid: bool = True


class Sighting(msgspec.Struct, frozen=True):
    """One bearing that a robot took to a marker of another robot.

    The bearing [rad] is in the observer's body frame, from its front-wheel midpoint.
    """

    target: str
    marker: int
    bearing_rad: float
    std_rad: float
    t_ns: int


class Motion(Message, frozen=True, kw_only=True):
    """What a follower needs from its leader, 100 Hz along the chain.

    `mission_time_s` is None until the mission's schedule runs, and again after it has ended.
    """

    robot: str
    state: str
    reason: str
    mission_time_s: float | None
    speed_mps: float
    steering_rad: float
    sightings: list[Sighting]


class PoseEstimate(Message, frozen=True, kw_only=True):
    """Front-wheel midpoint, fork direction eta and body heading theta in the landmark frame.

    `covariance` is 4 x 4, row by row, in the order (x, y, eta, theta). `trusted` says that the pose
    may be driven on, `trusted_since_s` from when on, on the clock of `t_ns` [s]. `rejected` counts
    the bearings that did not fit, `nis_median` is the median of the last bearings' normalised
    innovations squared (0.45 where the filter is right), `bias_rad` the estimated bias of the
    bearings. What a kind of localiser does not have is None or 0.
    """

    robot: str
    x_m: float
    y_m: float
    fork_rad: float
    heading_rad: float
    covariance: list[float]
    effective_particles: float | None = None
    trusted: bool = True
    trusted_since_s: float | None = None
    rejected: int = 0
    nis_median: float | None = None
    bias_rad: float = 0.0


class RelativeEstimate(Message, frozen=True, kw_only=True):
    """A follower's estimate of its leader: the leader's front point seen from its own.

    `heading_rad` is alpha = theta_leader - theta_follower; `speed_scale` is the leader's speed
    error epsilon, its true speed being (1 + epsilon) times the speed it reports, in the follower's
    odometry units. `covariance` is 4 x 4, row by row, (range, bearing, heading, speed scale).
    `nis` is the normalised innovation squared of the last bearing (1 degree of freedom), `nis_mean`
    its mean over the last bearings (None while they are too few), and `nis_state` what that says:
    "filling", "ok", "low" or "high". `range_told` says that something makes the range observable;
    `range_state` is "ok", "degraded" (the follower falls back) or "stop", `range_reason` why.
    `place_x_m` and `place_y_m` are where the follower wants to be by now, in its leader's body
    axes, from front point to front point.
    """

    robot: str
    leader: str
    range_m: float
    bearing_rad: float
    heading_rad: float
    speed_scale: float
    covariance: list[float]
    nis: float
    nis_mean: float | None = None
    nis_low: float = 0.0
    nis_high: float = 0.0
    nis_state: str = "filling"
    range_told: bool = True
    range_state: str = "ok"
    range_reason: str = ""
    place_x_m: float | None = None
    place_y_m: float | None = None


class Observability(Message, frozen=True, kw_only=True):
    """How well a robot's recent geometry lets it know what it estimates.

    `source` is "landmarks" for a robot that localises itself, otherwise its leader's name. `weak`
    says that the standard deviation `std_m` of the weakest direction (one radian counts as one
    metre; None is unbounded) is beyond `limit_m`; `direction` names it, `weak_for_s` is how long
    the robot has been driving so. `singular_value` [1/m^2] is the smallest of the Gramian of the
    last bearings and `landmarks` are those seen in it; `transverse_mps` is a follower's q, the
    relative speed across the line of sight.
    """

    robot: str
    source: str
    weak: bool
    direction: str
    std_m: float | None
    limit_m: float
    weak_for_s: float
    singular_value: float | None
    landmarks: list[int]
    transverse_mps: float | None


class Look(msgspec.Struct, frozen=True):
    """The newest bearing [rad] to one marker or landmark, in the body frame."""

    marker: int
    bearing_rad: float
    std_rad: float


class Bearings(Message, frozen=True, kw_only=True):
    """What a robot has seen since its last such message, one look per marker, for people."""

    robot: str
    looks: list[Look]


class Particles(Message, frozen=True, kw_only=True):
    """Places of some of a particle filter's particles, drawn by their weights, for people."""

    robot: str
    x_m: list[float]
    y_m: list[float]


class LoopHealth(msgspec.Struct, frozen=True):
    """Timing of the control loop since its start: step duration and wake-up lateness."""

    cycles: int
    overruns: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    late_p99_ms: float
    realtime: bool


class BusHealth(msgspec.Struct, frozen=True):
    """State and counters of one robot's CAN port since the process began.

    `load` is the share of the bus that the frames of the last second fill, stuffing at its worst.
    `reopened` counts how often the link was opened again; `log_dropped` the frames that the black
    box had no time for.
    """

    state: str
    reason: str
    received: int
    sent: int
    send_failures: int
    error_frames: int
    load: float = 0.0
    reopened: int = 0
    log_dropped: int = 0


class DriveHealth(msgspec.Struct, frozen=True):
    """One motor drive as its driver sees it; None where it has not said a finite number.

    Position and velocity are the joint's: m and m/s for the drive, rad and rad/s for the steering.
    `temperature_degc` is the hotter of inverter and motor.
    """

    state: str
    faults: list[str]
    position: float | None
    velocity: float | None
    bus_voltage_v: float | None = None
    temperature_degc: float | None = None


class Status(Message, frozen=True, kw_only=True):
    """One robot's state and health, 10 Hz and at every change of state.

    `ready` says that the checks for arming pass; `not_ready` names those that do not.
    `blocked_frames` counts what the transmit guard did not let pass. `formation` is the one that
    the robot holds or is changing to.
    """

    robot: str
    state: str
    reason: str
    ready: bool
    not_ready: list[str]
    mission_time_s: float | None
    loop: LoopHealth
    bus: BusHealth
    blocked_frames: int
    steering: DriveHealth
    drive: DriveHealth
    formation: str = ""


class Event(Message, frozen=True, kw_only=True):
    """Something that happened once. `severity` is "info", "warning" or "error"."""

    source: str
    severity: str
    text: str


class Command(msgspec.Struct, frozen=True, kw_only=True):
    """An operator's request: name is "arm", "start", "stop", "reset", "formation" or "at_start".

    `override` names checks that arming and starting may leave aside, where the fleet file allows;
    `formation` the one to change to.
    """

    name: str
    operator: str
    override: list[str] = []
    formation: str = ""


class CommandReply(msgspec.Struct, frozen=True, kw_only=True):
    """Accepted, or refused and why."""

    robot: str
    accepted: bool
    reason: str


class Estop(Message, frozen=True, kw_only=True):
    """Emergency stop, repeated until every robot is in state ESTOP. Latched by the robots."""

    operator: str


class Ground(Message, frozen=True, kw_only=True):
    """Heartbeat of the ground station, for robots whose fleet file asks for it."""

    operator: str


class CanFrame(msgspec.Struct, frozen=True):
    """One frame on a robot's bus, as `config.can.frame.Frame`; `data` is hexadecimal.

    `t_s` is the robot's monotonic time, `sent` tells the robot's own frames from received ones.
    """

    id: int
    data: str
    t_s: float
    sent: bool = False
    remote: bool = False


class StepRequest(msgspec.Struct, frozen=True):
    """An operator's command as it reached the step, with its number."""

    number: int
    command: Command


class StepReply(msgspec.Struct, frozen=True):
    """What the step answered to the request of that number."""

    number: int
    reply: CommandReply


class StepRecord(Message, frozen=True, kw_only=True):
    """All that one step of a robot consumed, losslessly, and its frames; `seq` counts the steps.

    `now_s` and `wall_s` are the clocks as the step saw them, `frames` what was on the bus in both
    directions. `replies` and `messages_crc`, the CRC-32 of the encoded messages in their order,
    belong to its output.
    """

    robot: str
    now_s: float
    wall_s: float
    late_s: float
    bus: BusHealth
    loop: LoopHealth
    frames: list[CanFrame]
    motions: list[Motion] = []
    requests: list[StepRequest] = []
    estops: list[Estop] = []
    grounds: list[Ground] = []
    unreadable: list[str] = []
    notes: list[str] = []
    shutdown: bool = False
    free_disk_mb: float | None = None
    replies: list[StepReply] = []
    messages_crc: int = 0


class Version(msgspec.Struct, frozen=True):
    """A program or library, and its version."""

    name: str
    version: str


class RobotStart(Message, frozen=True, kw_only=True):
    """What a robot's program was started with; sent again every 10 s for late listeners.

    `fleet_json` is the effective fleet, `seed` that of the particle filter.
    """

    robot: str
    seed: int
    fleet_json: str
    versions: list[Version]


class InCommand(Message, frozen=True, kw_only=True):
    """Who commands the fleet at the ground station that sends this, and since when (wall clock).

    The latest to have taken command has it; an empty `operator` gives it back.
    """

    operator: str
    since_ns: int


class Truth(Message, frozen=True, kw_only=True):
    """Where a simulated robot really is. Published by sim_hw only; robots never subscribe to it."""

    robot: str
    x_m: float
    y_m: float
    heading_rad: float
    steering_rad: float
    speed_mps: float


class SimulatedBus(Message, frozen=True, kw_only=True):
    """A simulated robot's CAN bus over the last second, 1 Hz, from sim_hw only.

    `load` is the share of the time that the bus was taken; `errors` counts error frames on it. The
    host's controller: error state, transmit and receive error counters, frames lost so far to a
    full transmit queue.
    """

    robot: str
    load: float
    frames: int
    errors: int
    host_state: str
    transmit_errors: int
    receive_errors: int
    host_overflowed: int


class FaultOrder(msgspec.Struct, frozen=True, kw_only=True):
    """A fault to inject into a device of a simulated robot now; `config.faults` has the kinds.

    Answered with a CommandReply.
    """

    device: str
    kind: str
    for_s: float | None = None
    value: float | None = None
    operator: str = ""


class Unreadable(ValueError):
    """Bytes that are no message of the kind expected; the text says what is wrong with them."""


def decode(payload: bytes, kind: type[StructT]) -> StructT:
    """The message in JSON bytes. Raises Unreadable, whatever the bytes are.

    Bad UTF-8 and nesting without end are not among the decoder's own errors.
    """
    try:
        return msgspec.json.decode(payload, type=kind)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise Unreadable(str(error)) from error


_ENCODER = msgspec.json.Encoder()


def encode(message: msgspec.Struct) -> bytes:
    """JSON bytes of a message. Not-a-number has no JSON form: publishers set `valid` instead."""
    return _ENCODER.encode(message)
