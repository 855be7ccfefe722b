"""All simulated robots of a fleet, moved together in steps of one millisecond."""

import math
from collections.abc import Collection

from numpy.random import SeedSequence

from config.can.database import CanDatabase
from config.fleet import Fleet
from sim_hw.robot import SimulatedRobot

STEP_S = 0.001

_TOLERANCE_STEPS = 1e-6


class SimulatedFleet:
    """The robots of a fleet, or those in `names`, standing at their start poses at `t0_s`.

    A robot's random streams depend on `seed` and its place in the fleet, not on `names`. Raises
    KeyError for a name that is not in the fleet.
    """

    def __init__(
        self,
        fleet: Fleet,
        seed: int,
        t0_s: float,
        database: CanDatabase,
        names: Collection[str] | None = None,
    ) -> None:
        wanted = set(fleet.robots if names is None else names)
        if unknown := wanted - fleet.robots.keys():
            raise KeyError(f"no robot {sorted(unknown)} in fleet {fleet.name}")
        self._t0_s = t0_s
        self._steps = 0
        seeds = SeedSequence(seed).spawn(len(fleet.robots))
        self.robots: dict[str, SimulatedRobot] = {
            name: SimulatedRobot(
                config, fleet.simulation, fleet.landmarks, database, t0_s, robot_seed
            )
            for (name, config), robot_seed in zip(fleet.robots.items(), seeds, strict=True)
            if name in wanted
        }
        self._sights = [
            (robot, [other.marked for other in self.robots.values() if other is not robot])
            for robot in self.robots.values()
        ]

    @property
    def t_s(self) -> float:
        """Time of the last step."""
        return self._t0_s + self._steps * STEP_S

    def advance(self, t_s: float) -> None:
        """Step everything on to the last whole step at or before `t_s`."""
        target = math.floor((t_s - self._t0_s) / STEP_S + _TOLERANCE_STEPS)
        while self._steps < target:
            self._steps += 1
            now_s = self.t_s
            for robot, _ in self._sights:
                robot.move(now_s)
            for robot, others in self._sights:
                robot.run_devices(others)
