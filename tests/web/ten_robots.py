"""Publishes what ten robots publish, and their truth, at the registry's rates, until it is ended.

Run as `python -m tests.web.ten_robots ENDPOINT`.
"""

import math
import sys
import time
from collections.abc import Callable

import zenoh

from config import messages, topics
from config.fleet import Fleet, Marker, Pose
from config.loader import load_fleet, shipped_fleet_path
from config.messages import Message, encode
from config.topics import Topic
from config.zenoh_settings import session_config
from tests.groundstation.synthetic import Header

ROBOTS = 10
PERIOD_S = 0.01
RADIUS_M, TURN_RADPS = 4.0, 0.25
LOOP = messages.LoopHealth(1000, 0, 1.2, 2.0, 3.0, 0.5, realtime=True)
BUS = messages.BusHealth("active", "", 0, 0, 0, 0, 0.34)
COVARIANCE = [4e-4, 0, 0, 0, 0, 4e-4, 0, 0, 0, 0, 1e-4, 0, 0, 0, 0, 1e-4]


def ten_robots(endpoint: str) -> Fleet:
    """The demo fleet with more followers, each behind the one before."""
    fleet = load_fleet(shipped_fleet_path("demo")).fleet
    robots = {"r1": fleet.robots["r1"]}
    for number in range(2, ROBOTS + 1):
        markers = [Marker(id=200 + 10 * number + end, x_m=-0.25 * end, y_m=0.0) for end in (0, 1)]
        changes = {
            "leader": f"r{number - 1}",
            "markers": markers,
            "start": Pose(x_m=-0.5 * number, y_m=0.0),
        }
        robots[f"r{number}"] = fleet.robots["r2"].model_copy(update=changes)
    return fleet.model_copy(update={"robots": robots, "ground": endpoint, "formations": {}})


def run(endpoint: str) -> None:
    """Publish until SIGTERM."""
    fleet = ten_robots(endpoint)
    settings = zenoh.Config.from_json5(session_config("tcp/127.0.0.1:0", [endpoint]))
    with zenoh.open(settings) as session:
        publishers = {
            (topic.name, name): session.declare_publisher(topic.key(fleet.name, name))
            for topic in (*topics.ROBOTS_OWN, topics.STEP, topics.TRUTH)
            for name in fleet.robots
        }
        token = session.liveliness().declare_token(topics.liveliness_key(fleet.name, "r1"))
        step, next_s = 0, time.monotonic()
        while True:
            for number, name in enumerate(fleet.robots):
                for topic, message in _due(step, number, name):
                    publishers[topic.name, name].put(encode(message))
            step, next_s = step + 1, next_s + PERIOD_S
            time.sleep(max(0.0, next_s - time.monotonic()))
        del token


def _due(step: int, number: int, name: str) -> list[tuple[Topic, Message]]:
    header: Header = {"seq": step, "t_ns": time.monotonic_ns(), "wall_ns": time.time_ns()}
    makers: list[tuple[Topic, Callable[[Header, int, str], Message]]] = [
        (topics.MOTION, _motion),
        (topics.STEP, _step),
        (topics.TRUTH, _truth),
        (topics.RELATIVE if number else topics.POSE, _relative if number else _pose),
        (topics.BEARINGS, _bearings),
        (topics.STATUS, _status),
        (topics.OBSERVABILITY, _observability),
    ]
    return [
        (topic, make(header, number, name))
        for topic, make in makers
        if (step + number) % round(1 / (topic.rate_hz * PERIOD_S)) == 0
    ]


def _where(header: Header, number: int) -> tuple[float, float, float]:
    """A circle, each robot a little behind the one before."""
    angle = TURN_RADPS * header["t_ns"] * 1e-9 - number * 0.45 / RADIUS_M
    return RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), angle + math.pi / 2


def _motion(header: Header, number: int, name: str) -> messages.Motion:
    sightings = [
        messages.Sighting(f"r{number + 2}", marker, -2.4, 0.05, header["t_ns"])
        for marker in (21, 22)
    ]
    return messages.Motion(
        **header,
        robot=name,
        state="RUNNING",
        reason="start by a test",
        mission_time_s=10.0,
        speed_mps=1.0,
        steering_rad=0.06,
        sightings=sightings,
    )


def _truth(header: Header, number: int, name: str) -> Message:
    x_m, y_m, heading = _where(header, number)
    return messages.Truth(
        **header,
        robot=name,
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading,
        steering_rad=0.06,
        speed_mps=1.0,
    )


def _step(header: Header, number: int, name: str) -> Message:
    frames = [
        messages.CanFrame(can_id, "00" * 8, header["t_ns"] * 1e-9) for can_id in range(0x100, 0x109)
    ]
    return messages.StepRecord(
        **header,
        robot=name,
        now_s=header["t_ns"] * 1e-9,
        wall_s=header["wall_ns"] * 1e-9,
        late_s=0.0,
        bus=BUS,
        loop=LOOP,
        frames=frames,
        motions=[_motion(header, number, name)],
    )


def _pose(header: Header, number: int, name: str) -> Message:
    x_m, y_m, heading = _where(header, number)
    return messages.PoseEstimate(
        **header,
        robot=name,
        x_m=x_m,
        y_m=y_m,
        fork_rad=heading,
        heading_rad=heading,
        covariance=[float(value) for value in COVARIANCE],
    )


def _relative(header: Header, number: int, name: str) -> Message:
    return messages.RelativeEstimate(
        **header,
        robot=name,
        leader=f"r{number}",
        range_m=0.45 + 0.02 * math.sin(header["t_ns"] * 1e-9 + number),
        bearing_rad=0.056,
        heading_rad=0.1125,
        speed_scale=0.0,
        covariance=[float(value) for value in COVARIANCE],
        nis=1.0,
        nis_mean=1.0,
        place_x_m=-0.45,
        place_y_m=0.0,
    )


def _bearings(header: Header, number: int, name: str) -> Message:
    looks = [messages.Look(marker, 0.2 * marker, 0.05) for marker in (101, 102, 103, 104, 11, 12)]
    return messages.Bearings(**header, robot=name, looks=looks)


def _status(header: Header, number: int, name: str) -> Message:
    drive = messages.DriveHealth("ACTIVE", [], 1.0, 1.0, 24.0, 31.0)
    return messages.Status(
        **header,
        robot=name,
        state="RUNNING",
        reason="start by a test",
        ready=True,
        not_ready=[],
        mission_time_s=10.0,
        loop=LOOP,
        bus=BUS,
        blocked_frames=0,
        steering=drive,
        drive=drive,
        formation="default",
    )


def _observability(header: Header, number: int, name: str) -> Message:
    return messages.Observability(
        **header,
        robot=name,
        source="landmarks",
        weak=False,
        direction="",
        std_m=0.03,
        limit_m=5.0,
        weak_for_s=0.0,
        singular_value=1.0,
        landmarks=[101, 102],
        transverse_mps=None,
    )


if __name__ == "__main__":
    run(sys.argv[1])
