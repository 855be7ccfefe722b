"""One fault per run: every kind of every device, on a leader and on a follower, in every phase."""

from collections.abc import Iterable, Iterator
from functools import partial
from itertools import groupby, product
from typing import NamedTuple

import msgspec

from config.faults import DEVICES, Fault, kinds_of
from tests.campaign.expectations import expected
from tests.campaign.forks import Job, in_forks
from tests.campaign.scenario import FAULTY, Phase, Role, behind, fleet_of
from tests.campaign.trial import Trial
from tests.campaign.verdict import Verdict, judge
from tests.campaign.witness import Outcome

HORIZON_S = 4.0


class Case(NamedTuple):
    """One run of the matrix."""

    role: Role
    phase: Phase
    device: str
    kind: str

    @property
    def key(self) -> str:
        """Name in the journal."""
        return "/".join(self)


def matrix() -> list[Case]:
    """All cases; those that share a beginning stand together."""
    faults = [(device, kind) for device in DEVICES for kind in kinds_of(device)]
    return [Case(role, phase, *fault) for role, phase in product(Role, Phase) for fault in faults]


def run(cases: Iterable[Case], seed: int, at_once: int) -> Iterator[tuple[str, bytes]]:
    """The outcomes of cases, in JSON, in the order in which they come."""
    for (role, phase), some in groupby(cases, key=lambda case: case[:2]):
        trial = Trial(role, phase, seed)
        jobs = [Job(case.key, partial(_outcome, trial, case)) for case in some]
        yield from in_forks(jobs, at_once)
        trial.close()


def _outcome(trial: Trial, case: Case) -> bytes:
    name = FAULTY[case.role]
    fault = Fault(robot=name, device=case.device, kind=case.kind)
    return msgspec.json.encode(trial.run([fault], behind(trial.fleet, name), HORIZON_S))


def verdict_of(case: Case, outcome: Outcome) -> Verdict:
    """Judged by the case's row and the fleet's own failsafe table."""
    fleet, name = fleet_of(case.role, case.phase), FAULTY[case.role]
    table = fleet.robots[name].failsafe
    row = expected(case.role, case.phase, case.device, case.kind)
    return judge(outcome, row, case.phase, case.device, table, behind(fleet, name))
