"""docs/safety.md says what the code does."""

from onboard.safety.states import Event, State
from onboard.safety.table import DOC_PATH, state_table, with_tables
from onboard.safety.triggers import TRIGGERS


def test_the_tables_in_the_docs_are_current() -> None:
    """If not: python -m onboard.safety.table"""
    text = DOC_PATH.read_text(encoding="utf-8")
    assert with_tables(text) == text
    assert all(f"| `{row.name}` |" in text for row in TRIGGERS)


def test_the_state_table_has_every_state_and_every_event() -> None:
    head, _, *rows = state_table().splitlines()
    assert head == f"| event | {' | '.join(State)} |"
    assert [row.split(" | ")[0] for row in rows] == [f"| {event}" for event in Event]
