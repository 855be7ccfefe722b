"""Two robots of the demo fleet on a circle of 3.8 m that never ends, with cameras' 30 looks/s."""

from config.fleet import Fleet, Segment
from config.loader import load_fleet, shipped_fleet_path

ROBOTS = ("r1", "r2")
MISSION_S = 100_000.0
LOOKS_HZ = 30.0


def circling() -> Fleet:
    """The demo's leader and its first follower at 1 m/s."""
    fleet = load_fleet(shipped_fleet_path("demo")).fleet
    segment = Segment(duration_s=MISSION_S, speed_mps=1.0, fork_rate_radps=-0.2618)
    robots = {}
    for name in ROBOTS:
        robot = fleet.robots[name]
        sensor = robot.bearing_sensor.model_copy(update={"rate_hz": LOOKS_HZ})
        robots[name] = robot.model_copy(update={"bearing_sensor": sensor})
    return fleet.model_copy(
        update={
            "robots": robots,
            "formations": {},
            "mission": fleet.mission.model_copy(update={"segments": [segment]}),
        }
    )
