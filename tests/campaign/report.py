"""The tables of docs/campaign.md, made from the runs: `python -m tests.campaign --docs`."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from config.faults import DEVICES, kinds_of
from tests.campaign.double import Pair
from tests.campaign.double import problems as double_problems
from tests.campaign.expectations import expected
from tests.campaign.scenario import FAULTY, Role, behind, fleet_of
from tests.campaign.single import Case, verdict_of
from tests.campaign.verdict import STANDSTILL_S, Verdict, due_after_s, end_state
from tests.campaign.witness import Outcome

DOC_PATH = Path(__file__).parents[2] / "docs" / "campaign.md"


class Run(NamedTuple):
    """One case with what became of it."""

    case: Case
    outcome: Outcome
    verdict: Verdict

    @property
    def late_s(self) -> float | None:
        """When the last robot that had to stop stood, after the stop was due; None: all drive."""
        if self.verdict.due_s is None:
            return None
        fleet = fleet_of(self.case.role, self.case.phase)
        moved_s = (self.outcome.robots[n].moved_s for n in behind(fleet, FAULTY[self.case.role]))
        return max((t or 0.0 for t in moved_s), default=0.0) - self.verdict.due_s


def runs(results: Iterable[tuple[Case, Outcome]]) -> list[Run]:
    """The results, judged."""
    return [Run(case, outcome, verdict_of(case, outcome)) for case, outcome in results]


def matrix_tables(done: list[Run]) -> str:
    """One table per device, one row per kind."""
    lines: list[str] = []
    for device in DEVICES:
        lines += [
            f"\n### `{device}`\n",
            "| kind | has to be | due after [s] | was (runs) | stands after due [s] | nearest [m] |"
            " as expected |",
            "|---|---|---|---|---|---|---|",
        ]
        for kind in kinds_of(device):
            some = [run for run in done if run.case[2:] == (device, kind)]
            if some:
                lines.append(f"| `{kind}` | {' | '.join(_cells(device, kind, some))} |")
    return "\n".join(lines)


def matrix_summary(done: list[Run]) -> str:
    """The bars over all runs."""
    good = sum(not run.verdict.problems for run in done)
    late_s = max(run.late_s for run in done if run.late_s is not None)
    nearest_m = min(run.outcome.min_distance_m for run in done)
    return (
        f"{len(done)} runs, {good} as their row demands ({100 * good / len(done):.1f} %). "
        f"Nearest front points {nearest_m:.2f} m, bar 0.15 m. "
        f"Last standstill {late_s:.2f} s after the stop was due, bar {STANDSTILL_S:.1f} s."
    )


def double_summary(done: list[tuple[Pair, Outcome]]) -> str:
    """The bars over the random runs, and the seeds that break one."""
    broken = [(pair, found) for pair, o in done if (found := double_problems(pair, o))]
    nearest_m = min(outcome.min_distance_m for _, outcome in done)
    seeds = [pair.seed for pair, _ in done]
    lines = [
        f"{len(done)} runs, seeds {min(seeds)} to {max(seeds)}: {len(broken)} break a bar. "
        f"Nearest front points {nearest_m:.2f} m."
    ]
    lines += [f"* {pair.told}: {'; '.join(found)}" for pair, found in broken]
    return "\n".join(lines)


def written(sections: dict[str, str]) -> None:
    """Put sections into the page, each between its begin and end line."""
    text = DOC_PATH.read_text(encoding="utf-8")
    for name, body in sections.items():
        begin, end = f"<!-- begin: {name} -->\n", f"\n<!-- end: {name} -->"
        head, found, rest = text.partition(begin)
        _, closed, tail = rest.partition(end)
        if not found or not closed:
            raise ValueError(f"{DOC_PATH}: no place for {name}")
        text = f"{head}{begin}{body}{end}{tail}"
    DOC_PATH.write_text(text, encoding="utf-8")


def _cells(device: str, kind: str, some: list[Run]) -> Iterator[str]:
    rows = [expected(run.case.role, run.case.phase, device, kind) for run in some]
    table = fleet_of(Role.LEADER, some[0].case.phase).robots["r1"].failsafe
    names = list(dict.fromkeys(name for row in rows for name in row.triggers))
    ends = dict.fromkeys(s for row in rows for s in row.ends)
    ends = ends or dict.fromkeys(end_state(name, table) for name in names)
    if any(row.may_drive for row in rows):
        ends["RUNNING"] = None
    because = next((f" ({row.why})" for row in rows if row.why), "")
    reasons = ", ".join(f"`{name}`" for name in names) or "nothing"
    yield f"{reasons}: {' or '.join(ends)}{because}"
    dues_s = sorted({round(due_after_s(row, table), 2) for row in rows if row.triggers})
    yield (
        "-"
        if not dues_s
        else " to ".join(f"{t:.2f}" for t in dict.fromkeys((dues_s[0], dues_s[-1])))
    )
    yield _counted(some)
    late_s = [run.late_s for run in some if run.late_s is not None]
    yield f"{max(late_s):.2f}" if late_s else "-"
    yield f"{min(run.outcome.min_distance_m for run in some):.2f}"
    good = sum(not run.verdict.problems for run in some)
    yield f"{good} of {len(some)}"


def _counted(some: list[Run]) -> str:
    """First reasons with their numbers of runs."""
    counts: dict[str, int] = {}
    for run in some:
        trigger = run.verdict.trigger
        name = f"`{trigger}`" if trigger else "drives on"
        counts[name] = counts.get(name, 0) + 1
    return ", ".join(f"{name} {count}" for name, count in counts.items())
