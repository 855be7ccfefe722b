"""Fleets and host frames for the tests of the emulated hardware."""

from functools import lru_cache
from typing import Any

from config.can.codec import Codec
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.fleet import (
    Axis,
    BearingSensor,
    Can,
    Fleet,
    Limits,
    Marker,
    Mission,
    Point,
    Pose,
    Robot,
    Segment,
    SimulatedBearings,
    Simulation,
    Vehicle,
)

WHEELBASE_M = 0.25
STEERING_NODE = 1
DRIVE_NODE = 2
STEERING_REV_PER_RAD = 4.0
DRIVE_REV_PER_M = 3.0
LIMITS = Limits(
    speed_mps=6.0,
    acceleration_mps2=4.0,
    deceleration_mps2=4.0,
    steering_rad=1.0,
    steering_rate_radps=3.0,
)
LANDMARKS = [
    Marker(id=1, x_m=10, y_m=-3),
    Marker(id=2, x_m=-6, y_m=-8),
    Marker(id=3, x_m=3, y_m=5),
    Marker(id=4, x_m=3, y_m=-20),
]
EXACT = Simulation(
    odometry_scale_error=0.0,
    bearings=SimulatedBearings(std_rad=0.0, latency_s=0.0),
    steering_encoder_std_rad=0.0,
)


@lru_cache(maxsize=1)
def database() -> CanDatabase:
    return CanDatabase.load()


def markers(first_id: int) -> list[Marker]:
    return [
        Marker(id=first_id, x_m=0.0, y_m=0.0),
        Marker(id=first_id + 1, x_m=-0.25, y_m=0.0),
        Marker(id=first_id + 2, x_m=-0.125, y_m=0.1),
    ]


def robot(
    number: int, start: Pose, sensor: BearingSensor | None = None, channel: str = "none"
) -> Robot:
    leading = number == 1
    return Robot(
        leader=None if leading else f"r{number - 1}",
        offset=None if leading else Point(x_m=-0.3, y_m=-0.3),
        start=start,
        markers=markers(10 * number),
        vehicle=Vehicle(
            wheelbase_m=WHEELBASE_M,
            steering=Axis(node=STEERING_NODE, revolutions_per_unit=STEERING_REV_PER_RAD),
            drive=Axis(node=DRIVE_NODE, revolutions_per_unit=DRIVE_REV_PER_M),
        ),
        can=Can(interface="simcan", channel=channel),
        bearing_sensor=sensor or BearingSensor(),
        limits=LIMITS,
    )


def fleet(
    count: int = 3, simulation: Simulation | None = None, sensor: BearingSensor | None = None
) -> Fleet:
    return Fleet(
        version=1,
        name="test",
        landmarks=LANDMARKS,
        robots={
            f"r{n}": robot(n, Pose(x_m=-0.4 * n, y_m=-0.3 * n, heading_rad=0.5), sensor)
            for n in range(1, count + 1)
        },
        mission=Mission(segments=[Segment(duration_s=1, speed_mps=1, fork_rate_radps=0)]),
        simulation=simulation or Simulation(),
    )


def frame(codec: Codec[Any], t_s: float, *values: float) -> Frame:
    """A host's frame."""
    return Frame(codec.can_id, codec.pack(*values), t_s)
