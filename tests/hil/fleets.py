"""Shipped fleets, shortened where a test needs only a stretch of the mission."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager

from config.fleet import Fleet, Segment
from config.loader import load_fleet, shipped_fleet_path
from groundstation.lockstep import Lockstep, Record
from tests.hil.clean import assert_ends_well


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
def powered_up(
    fleet: Fleet, seed: int = 1, record: Record | None = None, broken: Collection[str] = ()
) -> Iterator[Lockstep]:
    """A fleet; in the end it has to stand, all but the `broken` robots without any fault."""
    with Lockstep(fleet, seed, record) as lockstep:
        yield lockstep
        assert_ends_well(lockstep, broken)


@contextmanager
def driving(
    fleet: Fleet, seed: int = 1, for_s: float = 3.0, broken: Collection[str] = ()
) -> Iterator[Lockstep]:
    """The same, after `for_s` on its mission."""
    with powered_up(fleet, seed, broken=broken) as lockstep:
        lockstep.start_mission()
        lockstep.run_for(for_s)
        yield lockstep


def carry_back(lockstep: Lockstep) -> None:
    """Carry every robot to its start pose, and tell it so."""
    for name, robot in lockstep.simulation.robots.items():
        start, vehicle = lockstep.fleet.robots[name].start, robot.vehicle
        vehicle.x_m, vehicle.y_m, vehicle.heading_rad = start.x_m, start.y_m, start.heading_rad
        lockstep.command(name, "at_start")
