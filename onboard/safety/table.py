"""The tables of docs/safety.md, made from the code: `python -m onboard.safety.table` writes them.

Each stands between a line `<!-- begin: name -->` and a line `<!-- end: name -->`.
"""

from pathlib import Path

from config.failsafe import Escalation, Failsafe, Halting, Reaction
from onboard.safety.preflight.checklist import CHECKS
from onboard.safety.states import TABLE, Event, Rule, State
from onboard.safety.triggers import TRIGGERS

DOC_PATH = Path(__file__).parents[2] / "docs" / "safety.md"
_COMMON = {"after_s", "action", "then"}


def failsafe_table() -> str:
    """Every trigger with what it leads to where the fleet file says nothing else."""
    defaults = Failsafe()
    lines = [
        "| trigger | what it looks at | after [s] | action | then | limits |",
        "|---|---|---|---|---|---|",
    ]
    for row in TRIGGERS:
        reaction: Reaction | Halting | None = getattr(defaults, row.name)
        kind = "age" if not row.lasting else "lasting"
        if reaction is None:
            lines.append(f"| `{row.name}` | {row.meaning} | - | nothing | - | - |")
            continue
        action = f"`{reaction.action}`{', ends in FAULT' if row.fault else ''}"
        limits = [
            f"`{name}` {getattr(reaction, name):g}"
            for name in type(reaction).model_fields
            if name not in _COMMON
        ]
        cells = (
            f"`{row.name}`",
            row.meaning,
            f"{reaction.after_s:g} ({kind})",
            action,
            _then(reaction.then),
            ", ".join(limits) or "-",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def state_table() -> str:
    """Every state and every event: where it leads, or a dot where it is refused."""
    lines = [f"| event | {' | '.join(State)} |", f"|---|{'---|' * len(State)}"]
    for event in Event:
        cells = [_target(TABLE[state].get(event)) for state in State]
        lines.append(f"| {event} | {' | '.join(cells)} |")
    return "\n".join(lines)


def check_list() -> str:
    """Names of the checks before arming, in their order."""
    return ", ".join(f"`{name}`" for name in [*CHECKS, "estimate"])


def with_tables(text: str) -> str:
    """The page with all tables made anew. Raises ValueError where it has no place for one."""
    tables = {"failsafe": failsafe_table(), "states": state_table(), "checks": check_list()}
    for name, table in tables.items():
        begin, end = f"<!-- begin: {name} -->\n", f"\n<!-- end: {name} -->"
        head, found, rest = text.partition(begin)
        _, closed, tail = rest.partition(end)
        if not found or not closed:
            raise ValueError(f"no place for table {name}: a line {begin.strip()} and its end")
        text = f"{head}{begin}{table}{end}{tail}"
    return text


def _then(step: Escalation | None) -> str:
    steps = []
    while step is not None:
        steps.append(f"{step.after_s:g} s later `{step.action}`")
        step = step.then
    return ", ".join(steps) or "-"


def _target(rule: Rule | None) -> str:
    if rule is None:
        return "."
    text = str(rule.target)
    if rule.after_fault is not None:
        text += f" ({rule.after_fault} after a fault)"
    return f"{text}, if nothing blocks" if rule.guarded else text


if __name__ == "__main__":
    DOC_PATH.write_text(with_tables(DOC_PATH.read_text(encoding="utf-8")), encoding="utf-8")
