"""The fleet file of a recorded robot: made from its data set, the same for every robot.

Nothing in it is tuned to a robot or a recording. The recorded robots are unicycles of at most
0.1 m/s with a camera that looks ahead; its bearings are relative to the direction of motion, which
is that of the fork in the car that `sim_hw.dataset` makes of them.
"""

import bisect
import math
from collections.abc import Mapping
from typing import Literal

from config.angles import wrap
from config.fleet import (
    Axis,
    BearingSensor,
    Can,
    Failsafe,
    Fleet,
    Limits,
    Localiser,
    Loop,
    Marker,
    Mission,
    Point,
    Pose,
    RelativeFilter,
    Robot,
    Segment,
    Simulation,
    Vehicle,
)
from groundstation.errors import GroundError
from groundstation.lockstep import Recording

Start = Literal["known", "unknown"]

LOOP_HZ = 20.0
# Far longer than the way between two looks: a unicycle has no body that follows its fork.
WHEELBASE_M = 20.0
# A forward camera of 72 degrees or less; its noise where the lens is at its worst.
FOV_HALF_RAD = 0.63
BEARING_STD_RAD = 0.015
# Gaps of tens of seconds are in the nature of these recordings; devices report at 10 to 20 Hz.
BEARING_TIMEOUT_S = 60.0
DEVICE_TIMEOUT_S = 0.25
# Commands stand in for odometry: scale errors of some percent, and a speed that drops in turns.
LOCALISER = Localiser(
    position_noise_m=0.002,
    heading_noise_rad=0.02,
    travel_noise_m=0.05,
    turn_noise_rad=0.12,
    speed_scale_std=0.05,
    turn_scale_std=0.08,
    turn_loss_std=1.2,
    bias_std_rad=0.015,
    start_std_m=0.05,
    start_std_rad=0.05,
    gate_nis=16.0,
)

RELATIVE_FILTER = RelativeFilter(
    position_noise_m=0.05,
    heading_noise_rad=0.05,
    speed_scale_start_std=0.1,
    start_range_fraction=0.1,
)


def start_kind(text: str) -> Start:
    """Raises GroundError for anything but "known" and "unknown"."""
    match text:
        case "known" | "unknown":
            return text
    raise GroundError(f"--start {text!r}: choose known or unknown")


def robot_name(number: int) -> str:
    """Name of a recorded robot in its fleet."""
    return f"r{number}"


def dataset_fleet(
    recordings: Mapping[int, Recording],
    start: Start,
    follow: tuple[int, int] | None = None,
    interface: str = "virtual",
) -> Fleet:
    """A fleet of the recorded robots on landmarks of their data set; markers bear the subjects.

    `follow` is (follower, leader); without it there is one robot. Raises GroundError where
    landmarks and robots share a subject number.
    """
    recording = next(iter(recordings.values()))
    if shared := recording.landmark_subjects & set(recordings):
        numbers = ", ".join(map(str, sorted(shared)))
        raise GroundError(
            f"{recording.path}: subject {numbers} is a robot and a landmark: correct "
            "Landmark_Groundtruth.dat"
        )
    landmarks = [
        Marker(id=mark.subject, x_m=mark.x_m, y_m=mark.y_m) for mark in recording.landmarks
    ]
    robots = {
        robot_name(number): _robot(number, each, interface, start, follow)
        for number, each in recordings.items()
    }
    return Fleet(
        version=1,
        name="dataset",
        ground="tcp/127.0.0.1:0",
        landmarks=landmarks,
        robots=robots,
        mission=Mission(segments=[Segment(duration_s=3600.0, speed_mps=0.0, fork_rate_radps=0.0)]),
        simulation=Simulation(),
    )


def start_pose(recording: Recording) -> Pose:
    """Pose by motion capture at the recording's start; the fork is straight."""
    rows, t_s = recording.truth, recording.start_s
    after = min(max(1, bisect.bisect_left(rows, t_s, key=lambda row: row.t_s)), len(rows) - 1)
    one, two = rows[after - 1], rows[after]
    span_s = two.t_s - one.t_s
    share = (t_s - one.t_s) / span_s if span_s > 0.0 else 0.0
    return Pose(
        x_m=one.x_m + share * (two.x_m - one.x_m),
        y_m=one.y_m + share * (two.y_m - one.y_m),
        heading_rad=wrap(one.heading_rad + share * wrap(two.heading_rad - one.heading_rad)),
    )


def _robot(
    number: int,
    recording: Recording,
    interface: str,
    start: Start,
    follow: tuple[int, int] | None,
) -> Robot:
    follows = follow is not None and follow[0] == number
    return Robot(
        leader=robot_name(follow[1]) if follow is not None and follows else None,
        offset=Point(x_m=-1.0, y_m=0.0) if follows else None,
        start=start_pose(recording),
        markers=[Marker(id=number, x_m=0.0, y_m=0.0)],
        vehicle=Vehicle(
            wheelbase_m=WHEELBASE_M,
            steering=Axis(node=1, revolutions_per_unit=1.0),
            drive=Axis(node=2, revolutions_per_unit=10.0),
        ),
        can=Can(interface=interface, channel="{runtime}/{fleet}/{robot}.sock"),
        bearing_sensor=BearingSensor(
            mounting="fork", fov_half_rad=FOV_HALF_RAD, rate_hz=LOOP_HZ, std_rad=BEARING_STD_RAD
        ),
        limits=Limits(
            speed_mps=0.5,
            acceleration_mps2=1.0,
            deceleration_mps2=1.0,
            steering_rad=math.pi / 2 - 0.01,
            steering_rate_radps=4.0,
        ),
        relative_filter=RELATIVE_FILTER,
        localiser=LOCALISER.model_copy(update={"start": start}),
        failsafe=Failsafe.model_validate(
            {
                "bearings_stale": {"after_s": BEARING_TIMEOUT_S},
                "drive_estimate_stale": {"after_s": DEVICE_TIMEOUT_S},
                "encoder_stale": {"after_s": DEVICE_TIMEOUT_S},
                "loop_overrun": {"after_s": DEVICE_TIMEOUT_S},
            }
        ),
        loop=Loop(rate_hz=LOOP_HZ),
    )
