"""Shipped fleets, shortened where a test needs only a stretch of the mission."""

from collections.abc import Iterator
from contextlib import contextmanager

from config.fleet import Fleet, Segment
from config.loader import load_fleet, shipped_fleet_path
from groundstation.lockstep import Lockstep


def shipped(name: str) -> Fleet:
    """A shipped fleet as it is."""
    return load_fleet(shipped_fleet_path(name)).fleet


def straight(name: str, duration_s: float) -> Fleet:
    """A shipped fleet with a straight mission at its own speed."""
    fleet = shipped(name)
    speed_mps = fleet.mission.segments[0].speed_mps
    segment = Segment(duration_s=duration_s, speed_mps=speed_mps, fork_rate_radps=0.0)
    mission = fleet.mission.model_copy(update={"segments": [segment]})
    return fleet.model_copy(update={"mission": mission})


@contextmanager
def driving(fleet: Fleet, seed: int = 1, for_s: float = 3.0) -> Iterator[Lockstep]:
    """A fleet that has been on its mission for `for_s`."""
    with Lockstep(fleet, seed) as lockstep:
        lockstep.start_mission()
        lockstep.run_for(for_s)
        yield lockstep


def standing(lockstep: Lockstep, name: str) -> bool:
    """Whether the robot truly stands, whatever it believes."""
    return abs(lockstep.simulation.robots[name].truth.speed_mps) < 0.02
