"""The fleet file's schema: everything that the processes of one fleet must agree on.

The file cascades `defaults` -> `types` -> `robots`; the models here describe the result, with
every robot's settings complete. `config.loader` reads the file and reports its mistakes.
"""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from config.failsafe import Failsafe as Failsafe
from config.section import Angle as Angle
from config.section import Finite as Finite
from config.section import NonNegative as NonNegative
from config.section import Positive as Positive
from config.section import Probability as Probability
from config.section import Section as Section

CheckName = Literal[
    "bus",
    "bus_load",
    "safety_node",
    "drives",
    "firmware",
    "supply",
    "steering_encoder",
    "steering_reference",
    "bearing_sensor",
    "sensor_rate",
    "leader",
    "clock_offset",
    "disk",
    "realtime",
    "estimate",
]
"""The checks before arming, in the order in which an operator would go about them."""


class Point(Section):
    """A point [m], in the landmark frame or in a robot's body frame (x forward, y left)."""

    x_m: Finite
    y_m: Finite


class Pose(Point):
    """Front-wheel midpoint and body heading in the landmark frame."""

    heading_rad: Angle = 0.0


class Marker(Point):
    """Something a bearing sensor can identify; on a robot, relative to its front-wheel midpoint."""

    id: Annotated[int, Field(ge=0, le=1022)]


class Axis(Section):
    """One motor drive: its CAN node and its gearing (motor revolutions per joint unit)."""

    node: Annotated[int, Field(ge=1, le=62)]
    revolutions_per_unit: Positive = Field(
        description="motor rev per metre (drive) or per radian (steering)"
    )
    firmware: Literal["0.5", "0.6"] = "0.6"


class Vehicle(Section):
    """Geometry and drives of one car-like robot with a driven and steered front wheel."""

    wheelbase_m: Positive
    steering: Axis
    drive: Axis


class Can(Section):
    """The robot's CAN bus in python-can's words.

    `channel` may hold `{fleet}`, `{robot}` and `{runtime}` (a per-user folder for sockets).
    """

    interface: str
    channel: str
    bitrate: Literal[125_000, 250_000, 500_000, 1_000_000] = 500_000


class BearingSensor(Section):
    """How the bearing sensor is mounted (at the front-wheel midpoint) and what it should deliver.

    `std_rad` is the noise that the estimators assume where the sensor does not report its own.
    """

    unit: Annotated[int, Field(ge=0, le=2)] = 0
    mounting: Literal["body", "fork"] = "body"
    yaw_rad: Angle = 0.0
    fov_half_rad: Annotated[float, Field(gt=0, le=math.pi)] = math.pi
    rate_hz: Annotated[float, Field(gt=0, le=127.5)] = 100.0
    std_rad: Positive = 0.05


class Limits(Section):
    """What this robot may do; the controllers respect it and the transmit guard enforces it."""

    speed_mps: Positive
    acceleration_mps2: Positive
    deceleration_mps2: Positive
    steering_rad: Annotated[float, Field(gt=0, lt=math.pi / 2)]
    steering_rate_radps: Positive


class Localiser(Section):
    """A robot's filter on its own pose, from bearings to landmarks.

    `gaussian` is an extended Kalman filter in square-root form, `particle` the paper's (6)-(9).
    `start: unknown` finds the pose from nothing (gaussian only). Noise densities of position and
    heading are per square root of a second; those of travel and turn per square root of the way
    (1 m) and of the turn (1 rad); a tenth of the former acts on a robot that stands. The scale
    errors of speed and turn, the share of speed lost per rad/s of turning, and the bearings' bias
    are states where their deviation is not 0.
    `encoder_std_rad` 0 leaves the steering encoder out.
    """

    kind: Literal["gaussian", "particle"] = "gaussian"
    start: Literal["known", "unknown"] = "known"
    particles: Annotated[int, Field(ge=10, le=100_000)] = 500
    position_noise_m: Positive = 0.05
    heading_noise_rad: Positive = 0.05
    travel_noise_m: NonNegative = 0.0
    turn_noise_rad: NonNegative = 0.0
    speed_scale_std: NonNegative = 0.0
    turn_scale_std: NonNegative = 0.0
    turn_loss_std: NonNegative = 0.0
    bias_std_rad: NonNegative = 0.0
    encoder_std_rad: NonNegative = 0.005
    start_std_m: Positive = 0.05
    start_std_rad: Positive = 0.05
    gate_nis: Positive = 25.0
    trusted_std_m: Positive = 0.5

    @model_validator(mode="after")
    def _only_gaussian_finds_itself(self) -> Self:
        if self.kind == "particle" and self.start == "unknown":
            raise ValueError("`start: unknown` needs `kind: gaussian`")
        return self


class PaperFilter(Section):
    """The paper's own noise settings (section 4.1, h = 0.03), and an erratum to show.

    `yaw_rate: fork` feeds the rate of the fork's direction, the omega of (3), as yaw rate of (29).
    """

    process_variance: Positive = 0.03
    output_variance: Positive = 0.03
    start_variance: Positive = 1.13
    yaw_rate: Literal["body", "fork"] = "body"


class RelativeFilter(Section):
    """Follower's filter on its leader. `reference` runs the same model on filterpy.

    `paper` is the paper's filter: three states, two outputs, and the settings of `paper` instead
    of the others. Process noise densities are per square root of a second. `start_range_fraction`
    is how well the range at the start poses is known, as a fraction of it.
    """

    kind: Literal["ukf", "reference", "paper"] = "ukf"
    position_noise_m: Positive = 0.02
    heading_noise_rad: Positive = 0.02
    speed_scale_noise: Positive = 1e-3
    speed_scale_start_std: Positive = 0.03
    start_range_fraction: Annotated[float, Field(gt=0, le=1)] = 0.3
    gate_nis: Positive = 16.0
    paper: PaperFilter = PaperFilter()


class Formation(Section):
    """Control law of a follower and its feedback gain."""

    law: Literal["leader_frame", "polar"] = "leader_frame"
    gain_per_s: Positive = 2.0


class Observability(Section):
    """When what a robot sees is too little to drive on; see docs/mathematics.md, section 5.

    A localising robot judges the bearings of the last `window_s`: the standard deviation that they
    alone leave in the weakest direction, one radian counting as one metre. One that has driven for
    `hold_s` beyond the limit stops. A follower's range is the failsafe section's matter.
    """

    window_s: Annotated[float, Field(ge=1, le=20)] = 5.0
    weakest_std_limit_m: Positive = 5.0
    hold_s: Positive = 5.0
    min_landmarks: Annotated[int, Field(ge=0)] = Field(
        default=2, description="in view before arming; with fewer, driving cannot fix the pose"
    )


class Arming(Section):
    """What arming asks for, and which of its checks an operator may override.

    Every override is recorded as an event.
    """

    allow_override: list[CheckName] = Field(default=[])
    require_realtime: bool = False
    max_bus_load: Annotated[float, Field(gt=0, le=1)] = 0.7
    min_free_disk_mb: NonNegative = 100.0
    min_sensor_rate_fraction: Annotated[float, Field(ge=0, le=1)] = 0.5
    max_clock_offset_s: Positive = 0.05


class BlackBox(Section):
    """Log of all CAN frames (BLF) in `folder`, in files of about `file_mb`, the last `files` kept.

    `folder` may hold `{fleet}`, `{robot}` and `{runtime}`. Nothing is logged without one.
    """

    folder: str | None = None
    file_mb: Positive = 32.0
    files: Annotated[int, Field(ge=2)] = 8


class Loop(Section):
    """The onboard control loop."""

    rate_hz: Annotated[float, Field(ge=10, le=500)] = 100.0
    realtime_priority: Annotated[int, Field(ge=0, le=90)] = 50


class Robot(Section):
    """One robot, complete. A robot without a leader drives the mission's schedule."""

    leader: str | None = None
    offset: Point | None = Field(
        default=None, description="desired place of the front point in the leader's body axes"
    )
    start: Pose
    markers: Annotated[list[Marker], Field(min_length=1)]
    listen: str = Field(default="tcp/127.0.0.1:0", description="Zenoh endpoint of this robot")
    vehicle: Vehicle
    can: Can
    bearing_sensor: BearingSensor = BearingSensor()
    limits: Limits
    localiser: Localiser = Localiser()
    relative_filter: RelativeFilter = RelativeFilter()
    formation: Formation = Formation()
    observability: Observability = Observability()
    failsafe: Failsafe = Failsafe()
    arming: Arming = Arming()
    black_box: BlackBox = BlackBox()
    loop: Loop = Loop()

    @model_validator(mode="after")
    def _follower_needs_a_place(self) -> Self:
        if (self.leader is None) != (self.offset is None):
            raise ValueError("a follower needs both `leader` and `offset`, a leader neither")
        return self


class Segment(Section):
    """A stretch of the mission: speed of the front wheel and rate of the fork's direction eta."""

    duration_s: Positive
    speed_mps: NonNegative
    fork_rate_radps: Finite


class Acceptance(Section):
    """The bars that a run is judged by, from `from_s` of mission time on, against truth."""

    from_s: NonNegative = 10.0
    position_rms_m: Positive = 0.04
    range_rms_m: Positive = 0.03
    bearing_rms_rad: Positive = 0.06
    leader_rmse_m: Positive = 0.09
    min_distance_m: Positive = 0.15
    overrun_fraction: Positive = 0.01


class Mission(Section):
    """What the leader drives and how the run is judged."""

    segments: Annotated[list[Segment], Field(min_length=1)]
    acceptance: Acceptance = Acceptance()

    @property
    def duration_s(self) -> float:
        """Length of the schedule [s]."""
        return sum(segment.duration_s for segment in self.segments)


class SimulatedBearings(Section):
    """The emulated bearing sensor's errors."""

    std_rad: NonNegative = 0.05
    bias_rad: Finite = 0.0
    latency_s: NonNegative = 0.01
    range_m: Positive = 50.0
    dropout: Probability = 0.0


class SimulatedMotor(Section):
    """First-order lag of a motor loop and the noise of its encoder (in joint units)."""

    lag_s: Positive = 0.03
    encoder_std: NonNegative = 0.0


class Simulation(Section):
    """The emulated hardware's errors, per robot alike. Only sim_hw reads this section.

    `odometry_scale_error` is a magnitude: the sign is drawn per robot from the seed. The emulated
    hardware asks for a priority above the robots', since real hardware does not wait for software.
    """

    odometry_scale_error: Annotated[float, Field(ge=0, lt=0.5)] = 0.01
    watchdog_s: Positive = 0.2
    bearings: SimulatedBearings = SimulatedBearings()
    drive: SimulatedMotor = SimulatedMotor()
    steering: SimulatedMotor = SimulatedMotor()
    steering_encoder_std_rad: NonNegative = 0.001
    realtime_priority: Annotated[int, Field(ge=0, le=90)] = 60


class Fleet(Section):
    """A whole fleet, resolved."""

    version: Literal[1]
    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]*$")]
    ground: str = Field(
        default="tcp/127.0.0.1:7447", description="Zenoh endpoint of the ground station"
    )
    landmarks: list[Marker] = Field(default=[])
    robots: Annotated[dict[str, Robot], Field(min_length=1)]
    formations: dict[str, dict[str, Point]] = Field(
        default={},
        description="named formations to change to: place per follower in its leader's body axes",
    )
    formation_change_mps: Positive = Field(
        default=0.2, description="speed of the longest way when the formation changes"
    )
    mission: Mission
    simulation: Simulation = Simulation()

    def followers_of(self, leader: str) -> list[str]:
        """Names of the robots that follow `leader` directly."""
        return [name for name, robot in self.robots.items() if robot.leader == leader]
