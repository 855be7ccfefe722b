"""A small fleet and hand-made messages whose errors are known without the code under test."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, TypedDict

from config.fleet import Fleet
from config.messages import (
    BusHealth,
    DriveHealth,
    LoopHealth,
    Message,
    Motion,
    PoseEstimate,
    RelativeEstimate,
    Status,
    Truth,
    encode,
)
from config.topics import MOTION, POSE, RELATIVE, STATUS, TRUTH, Topic

WALL_NS = 1_700_000_000_000_000_000
START_NS = 5_000_000_000
PERIOD_NS = 20_000_000


class Place(NamedTuple):
    """Front point and heading of a robot at one instant."""

    x_m: float
    y_m: float
    heading_rad: float


Path = Callable[[float], Place]


def fleet(law: str = "leader_frame", duration_s: float = 20.0, ground: str = "") -> Fleet:
    """r1 leads; r2 drives 1 m behind and 0.5 m to its left."""
    robot = {
        "start": {"x_m": 0, "y_m": 0},
        "vehicle": {
            "wheelbase_m": 0.25,
            "steering": {"node": 1, "revolutions_per_unit": 10},
            "drive": {"node": 2, "revolutions_per_unit": 5},
        },
        "can": {"interface": "virtual", "channel": "{robot}"},
        "limits": {
            "speed_mps": 2,
            "acceleration_mps2": 2,
            "deceleration_mps2": 2,
            "steering_rad": 1,
            "steering_rate_radps": 3,
        },
    }
    return Fleet.model_validate(
        {
            "version": 1,
            "name": "pair",
            "ground": ground or "tcp/127.0.0.1:7447",
            "landmarks": [{"id": 1, "x_m": 3, "y_m": 4}],
            "robots": {
                "r1": robot | {"markers": [{"id": 10, "x_m": 0, "y_m": 0}]},
                "r2": robot
                | {
                    "markers": [{"id": 20, "x_m": 0, "y_m": 0}],
                    "leader": "r1",
                    "offset": {"x_m": -1.0, "y_m": 0.5},
                    "formation": {"law": law},
                },
            },
            "mission": {
                "segments": [{"duration_s": duration_s, "speed_mps": 1, "fork_rate_radps": 0}],
                "acceptance": {"from_s": 5},
            },
        }
    )


def straight(t_s: float) -> Place:
    """A leader that drives along x at 1 m/s."""
    return Place(t_s, 0.0, 0.0)


def behind(dx_m: float = 0.0, dy_m: float = 0.0, heading_rad: float = 0.0) -> Path:
    """A follower of `straight` that is off its place by (dx, dy) and turned by the heading."""
    return lambda t_s: Place(t_s - 1.0 + dx_m, 0.5 + dy_m, heading_rad)


class Story(NamedTuple):
    """What happens in a made-up run; estimates are off truth by constant amounts."""

    leader: Path = straight
    follower: Path = behind()
    duration_s: float = 20.0
    ends_with: str = "mission complete"
    final_state: str = "STANDBY"
    pose_error_m: float = 0.0
    overruns: int = 0


def messages(story: Story) -> Iterator[tuple[str, bytes, int]]:
    """Key, payload and wall time of every message of the run, 50 per second."""
    steps = round(story.duration_s * 1e9) // PERIOD_NS
    for step in range(steps + 1):
        t_s = step * PERIOD_NS * 1e-9
        here, there = story.follower(t_s), story.leader(t_s)
        yield from _instant(step, t_s, here, there, story)
    for robot in ("r1", "r2"):
        yield _sent(STATUS, status(robot, story.final_state, story.ends_with, steps + 1, story))
        yield _sent(MOTION, motion(robot, story.final_state, story.ends_with, steps + 1, None))


def _instant(
    step: int, t_s: float, here: Place, there: Place, story: Story
) -> Iterator[tuple[str, bytes, int]]:
    for robot, place in (("r1", there), ("r2", here)):
        yield _sent(TRUTH, truth(robot, place, step))
        yield _sent(MOTION, motion(robot, "RUNNING", "", step, t_s))
    yield _sent(POSE, pose(there, story.pose_error_m, step))
    yield _sent(RELATIVE, relative(here, there, step))


def _sent(topic: Topic, message: Message) -> tuple[str, bytes, int]:
    robot = getattr(message, "robot", "all")
    return topic.key("pair", robot), encode(message), message.wall_ns


class Header(TypedDict):
    """What every message starts with."""

    seq: int
    t_ns: int
    wall_ns: int


def times(step: int) -> Header:
    """The header of a message of that step."""
    offset = step * PERIOD_NS
    return {"seq": step, "t_ns": START_NS + offset, "wall_ns": WALL_NS + offset}


def truth(robot: str, place: Place, step: int) -> Truth:
    """Where the robot is."""
    return Truth(
        **times(step),
        robot=robot,
        x_m=place.x_m,
        y_m=place.y_m,
        heading_rad=place.heading_rad,
        steering_rad=0.0,
        speed_mps=1.0,
    )


def motion(robot: str, state: str, reason: str, step: int, mission_time_s: float | None) -> Motion:
    """What the robot says of itself."""
    return Motion(
        **times(step),
        robot=robot,
        state=state,
        reason=reason,
        mission_time_s=mission_time_s,
        speed_mps=1.0,
        steering_rad=0.0,
        sightings=[],
    )


def pose(place: Place, error_m: float, step: int) -> PoseEstimate:
    """The leader's estimate, off by `error_m` along x."""
    return PoseEstimate(
        **times(step),
        robot="r1",
        x_m=place.x_m + error_m,
        y_m=place.y_m,
        fork_rad=place.heading_rad,
        heading_rad=place.heading_rad,
        covariance=[0.0] * 16,
        effective_particles=100.0,
    )


def relative(here: Place, there: Place, step: int) -> RelativeEstimate:
    """The follower's estimate, 0.1 m too far and 0.02 rad too far to the left."""
    dx, dy = there.x_m - here.x_m, there.y_m - here.y_m
    return RelativeEstimate(
        **times(step),
        robot="r2",
        leader="r1",
        range_m=math.hypot(dx, dy) + 0.1,
        bearing_rad=math.atan2(dy, dx) - here.heading_rad + 0.02,
        heading_rad=there.heading_rad - here.heading_rad,
        speed_scale=0.0,
        covariance=[0.0] * 16,
        nis=1.0,
    )


def status(robot: str, state: str, reason: str, step: int, story: Story | None = None) -> Status:
    """The robot's state and health."""
    drive = DriveHealth(state="CLOSED_LOOP", faults=[], position=0.0, velocity=0.0)
    return Status(
        **times(step),
        robot=robot,
        state=state,
        reason=reason,
        ready=True,
        not_ready=[],
        mission_time_s=None,
        loop=LoopHealth(1000, story.overruns if story else 0, 1.0, 2.0, 3.0, 0.5, realtime=False),
        bus=BusHealth("active", "", 0, 0, 0, 0),
        blocked_frames=0,
        steering=drive,
        drive=drive,
    )
