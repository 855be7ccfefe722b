"""Two faults per run, drawn at random: whatever they are, nobody collides and who stops stands.

The seed of a run draws its faults; the fleet and the phase that they meet are shared by the runs
of a block, so that the way there is driven once.
"""

import random
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import groupby
from typing import NamedTuple

import msgspec

from config.faults import DEVICES, Fault, kind_of, kinds_of
from config.fleet import Fleet
from tests.campaign.expectations import Row, Shows, expected
from tests.campaign.forks import Job, in_forks
from tests.campaign.scenario import FAULTY, ROBOTS, Phase, Role, fleet_of
from tests.campaign.trial import Trial
from tests.campaign.verdict import COLLISION_M, STANDSTILL_S, due_after_s
from tests.campaign.witness import Outcome

HORIZON_S = 2.5
SECOND_WITHIN_S = 1.0
_FLEETS = ((Role.LEADER, 1), (Role.FOLLOWER, 2), (Role.LEADER, 3))
BLOCKS = [(role, phase, seed) for role, seed in _FLEETS for phase in Phase]


class Pair(NamedTuple):
    """One run: where, and what breaks; the first fault begins at 0."""

    seed: int
    role: Role
    phase: Phase
    fleet_seed: int
    faults: tuple[Fault, Fault]

    @property
    def key(self) -> str:
        """Name in the journal."""
        return str(self.seed)

    @property
    def told(self) -> str:
        """The run in a line."""
        return f"seed {self.seed} {self.role} {self.phase}: " + ", ".join(map(_told, self.faults))


def pairs(seeds: Iterable[int]) -> list[Pair]:
    """The runs of these seeds; those that share a beginning stand together."""
    return sorted((drawn(seed) for seed in seeds), key=lambda pair: pair.seed % len(BLOCKS))


def drawn(seed: int) -> Pair:
    """The run that a seed stands for."""
    rng = random.Random(seed)
    role, phase, fleet_seed = BLOCKS[seed % len(BLOCKS)]
    first = _fault(rng, ROBOTS[role], 0.0)
    second = _fault(rng, ROBOTS[role], rng.uniform(0.0, SECOND_WITHIN_S))
    return Pair(seed, role, phase, fleet_seed, (first, second))


def _fault(rng: random.Random, robots: tuple[str, ...], at_s: float) -> Fault:
    """Half of them with the default value, half of them for ever."""
    device = rng.choice(DEVICES)
    row = kind_of(device, rng.choice(kinds_of(device)))
    value = for_s = None
    if row.unit and rng.random() < 0.5:
        value = min(max(row.default * 10.0 ** rng.uniform(-0.7, 0.7), row.least), row.most)
    if not row.once and rng.random() < 0.5:
        for_s = rng.uniform(0.02, 2.0)
    robot = rng.choice(robots)
    return Fault(at_s=at_s, for_s=for_s, robot=robot, device=device, kind=row.name, value=value)


def run(some: Iterable[Pair], at_once: int) -> Iterator[tuple[str, bytes]]:
    """The outcomes of runs, in JSON, in the order in which they come."""
    for (role, phase, seed), block in groupby(some, key=lambda pair: pair[1:4]):
        trial = Trial(role, phase, seed)
        jobs = [Job(pair.key, partial(_outcome, trial, pair)) for pair in block]
        yield from in_forks(jobs, at_once)
        trial.close()


def _outcome(trial: Trial, pair: Pair) -> bytes:
    outcome = trial.run(pair.faults, list(trial.fleet.robots), HORIZON_S)
    return msgspec.json.encode(outcome)


def problems(pair: Pair, outcome: Outcome) -> list[str]:
    """What breaks a bar: a collision, a robot that moves on although it has stopped or had to."""
    found = []
    if outcome.min_distance_m < COLLISION_M:
        found.append(f"collision: {outcome.min_distance_m:.2f} m")
    fleet = fleet_of(pair.role, pair.phase)
    for name, fate in outcome.robots.items():
        due_s = _due_s(pair, name, fate.started_s, fleet)
        if fate.gave_up_s is not None:
            due_s = min(due_s, fate.gave_up_s)
        if fate.moved_s is not None and fate.moved_s > due_s + STANDSTILL_S:
            found.append(f"{name} moves {fate.moved_s - due_s:.2f} s after its stop was due")
    return found


def _due_s(pair: Pair, name: str, started_s: float | None, fleet: Fleet) -> float:
    """When a fault that lasts, with the value that its row is meant for, has to have spoken."""
    dues_s = [float("inf")]
    for fault in pair.faults:
        row = _row(fault, name)
        if fault.robot == name and fault.for_s is None and fault.value is None and _certain(row):
            began_s = max(f.at_s for f in pair.faults)
            if row.shows is Shows.DRIVING and started_s is not None:
                began_s = max(began_s, started_s)
            dues_s.append(began_s + due_after_s(row, fleet.robots[name].failsafe))
    return min(dues_s)


def _row(fault: Fault, name: str) -> Row:
    role = next((role for role in Role if FAULTY[role] == name), Role.FOLLOWER)
    return expected(role, Phase.ARMING, fault.device, fault.kind)


def _certain(row: Row) -> bool:
    return bool(row.triggers) and not row.may_drive and row.shows is not Shows.STEERING


def _told(fault: Fault) -> str:
    value = "" if fault.value is None else f" {fault.value:.3g}"
    duration = "" if fault.for_s is None else f" for {fault.for_s:.2f} s"
    at = f" at {fault.at_s:.2f} s" if fault.at_s else ""
    return f"{fault.robot} {fault.device} {fault.kind}{value}{at}{duration}"
