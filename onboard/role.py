"""What a robot does in its formation: lead or follow. The rest is the same for both."""

from typing import NamedTuple, Protocol

from config.messages import Message, Motion
from config.topics import Topic
from onboard.control.steering import WheelController, WheelSetpoint
from onboard.estimate.observability_monitor import ObservabilityMonitor
from onboard.safety.observations import EstimateSeen, LeaderSeen


class Odometry(NamedTuple):
    """A robot's own motion as its drives and its steering encoder report it."""

    speed_mps: float
    steering_rad: float
    steering_rate_radps: float


class Observation(NamedTuple):
    """One bearing to a known marker or landmark, taken `age_s` ago.

    `sensor_rad` is in the frame of the sensor's mounting (body or fork), `body_rad` in the body's.
    """

    marker: int
    sensor_rad: float
    body_rad: float
    std_rad: float
    age_s: float


class Stamp(NamedTuple):
    """The instant that a message speaks of, on both clocks [s]."""

    now_s: float
    wall_s: float


class Role(Protocol):
    """Estimation and control of a leader or a follower."""

    @property
    def observability(self) -> ObservabilityMonitor:
        """Whether the recent geometry lets the robot know what it estimates."""

    def hear(self, at: Stamp, motion: Motion) -> None:
        """Take in a message from another robot that has arrived at `at`."""

    def estimate(
        self, at: Stamp, dt_s: float, odometry: Odometry, observations: list[Observation]
    ) -> None:
        """Carry the estimate on by `dt_s` to `at` and use the observations."""

    def begin_anew(self) -> None:
        """Forget the estimate: an operator says that the robot stands at its start."""

    def start(self, steering_rad: float) -> None:
        """Begin the mission with the fork at this angle."""

    def finish(self) -> None:
        """The mission is over, however it ended."""

    def drive(self, dt_s: float, wheels: WheelController, odometry: Odometry) -> WheelSetpoint:
        """Setpoints for the next `dt_s`; called only while the robot runs."""

    def ended(self) -> str | None:
        """Why the mission is over, or None while it is not."""

    def mission_time_s(self) -> float | None:
        """Time on the mission's schedule, or None while it does not run."""

    def watches(self, marker: int) -> bool:
        """Whether bearings to this marker are what the robot cannot do without."""

    @property
    def lives_on_bearings(self) -> bool:
        """Whether there are such markers at all."""

    def leader_seen(self, at: Stamp) -> LeaderSeen | None:
        """Age and state of the leader's last message; None for a robot without a leader."""

    def estimate_seen(self, at: Stamp) -> EstimateSeen:
        """What is wrong with the estimate, for the failsafe table."""

    def restrain(self, slow: bool, hold_distance: bool) -> None:
        """What the failsafe table asks of the driving, from now on until told otherwise."""

    def not_ready(self) -> list[str]:
        """What the estimate still lacks before the robot may be armed."""

    def particles(self) -> list[tuple[float, float]]:
        """Places [m] of some of the estimate's particles, for people."""

    @property
    def formation(self) -> str:
        """Name of the formation that the robot holds or is changing to."""

    def change_formation(self, name: str) -> None:
        """Go over to another formation of the fleet file, at the pace that the file allows."""

    def report(self, seq: int, at: Stamp) -> tuple[Topic, Message] | None:
        """The estimate as a message, once there is one."""
