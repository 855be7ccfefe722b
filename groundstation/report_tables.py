"""Tables of a report: what was judged, the loops, the buses, versions. Plain rows of text."""

from typing import NamedTuple

from groundstation.report_data import Told
from groundstation.summary import Summary
from groundstation.summary_table import judged_rows

GOOD, BAD, PLAIN = "good", "bad", ""


class Row(NamedTuple):
    """Cells of one row; `mark` says whether a bar was met."""

    cells: tuple[str, ...]
    mark: str = PLAIN


class Table(NamedTuple):
    """A heading, the heads of the columns and the rows."""

    heading: str
    heads: tuple[str, ...]
    rows: list[Row]


def judgement(told: Told) -> Table:
    """Every value beside its bar."""
    rows = []
    for what, value, limit, unit in judged_rows(told.judged, told.fleet.mission.acceptance):
        if unit == "ms":
            continue  # the table of loops has more of it
        mark = PLAIN
        if limit is not None:
            at_least = what.startswith("smallest")
            met = value is not None and (value >= limit if at_least else value <= limit)
            mark = GOOD if met else BAD
        rows.append(
            Row((what, _text(value, unit), "" if limit is None else _text(limit, unit)), mark)
        )
    return Table("Judgement", ("what", "value", "bar"), rows)


def run_facts(told: Told) -> Table:
    """What was run, how and when."""
    info, mission = told.info, told.judged.mission
    how = "lockstep, virtual time" if info.mode == "lockstep" else "processes, real time"
    rows = [
        Row(("recording", str(told.path))),
        Row(("fleet", f"{told.fleet.name}, {len(told.fleet.robots)} robots")),
        Row(("how", f"{how}; seed {info.seed}")),
        Row(("mission", f"{mission.duration_s:g} s, {_completed(told.judged)}")),
        Row(("judged", f"{mission.seconds_judged:.1f} s from {mission.from_s:g} s on")),
        Row(("truth", "recorded" if told.has_truth else "unknown: estimates are shown only")),
    ]
    return Table("Run", ("", ""), rows)


def loops(told: Told) -> Table:
    """Timing of the control loops and health of the buses, at the end of the run."""
    rows = []
    for name in told.fleet.robots:
        found = told.run.status.get(name)
        if not found:
            rows.append(Row((name, "no status recorded"), BAD))
            continue
        loop, bus = found[-1].loop, found[-1].bus
        bad = loop.overruns > told.fleet.mission.acceptance.overrun_fraction * max(loop.cycles, 1)
        timing = (
            f"{loop.p50_ms:.2f}",
            f"{loop.p99_ms:.2f}",
            f"{loop.max_ms:.2f}",
            f"{loop.overruns} of {loop.cycles}",
            "yes" if loop.realtime else "no",
        )
        if told.info.mode == "lockstep":
            timing = ("virtual", "", "", "", "")
        cells = (
            name,
            *timing,
            f"{bus.load:.0%}",
            f"{bus.error_frames}",
            f"{bus.send_failures}",
        )
        rows.append(Row(cells, BAD if bad else PLAIN))
    heads = (
        "robot",
        "step p50 [ms]",
        "p99",
        "max",
        "overruns",
        "real-time",
        "bus load",
        "error frames",
        "failed sends",
    )
    return Table("Loops and buses", heads, rows)


def versions(told: Told) -> Table:
    """Programs, libraries and machines of the ground station and of every robot."""
    running: dict[tuple[str, str], list[str]] = {}
    for each in told.info.versions:
        running.setdefault((each.name, each.version), []).append("ground")
    for name, starts in told.run.start.items():
        for each in starts[0].versions:
            running.setdefault((each.name, each.version), []).append(name)
    rows = [Row((*what, ", ".join(names))) for what, names in running.items()]
    return Table("Versions", ("what", "version", "running on"), rows)


def comparison(one: Told, other: Told) -> Table:
    """The values of two runs beside each other; the difference is the second minus the first."""
    first = judged_rows(one.judged, one.fleet.mission.acceptance)
    second = {
        what: value
        for what, value, _, _ in judged_rows(other.judged, other.fleet.mission.acceptance)
    }
    rows = []
    for what, value, _, unit in first:
        there = second.get(what)
        change = "" if value is None or there is None else f"{there - value:+.4f} {unit}"
        rows.append(Row((what, _text(value, unit), _text(there, unit), change)))
    return Table("Both runs", ("what", "first", "second", "difference"), rows)


def _completed(judged: Summary) -> str:
    return "completed" if judged.mission.completed else "not completed"


def _text(value: float | None, unit: str) -> str:
    return "unknown" if value is None else f"{value:.4g} {unit}"
