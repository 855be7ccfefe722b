"""The registry of topics and what the documentation says of it."""

from pathlib import Path

import pytest

from config import topics
from config.topics import Topic

TABLE = Path(__file__).parents[2] / "docs" / "transport.md"
EVERY_TOPIC = [value for value in vars(topics).values() if isinstance(value, Topic)]


@pytest.mark.parametrize("topic", EVERY_TOPIC, ids=lambda topic: topic.name)
def test_the_documentation_has_each_topic_with_its_type_and_rate(topic: Topic) -> None:
    rows = [line for line in TABLE.read_text().splitlines() if line.startswith(f"| {topic.name} |")]
    assert len(rows) == 1
    assert f"`{topic.message.__name__}`" in rows[0]
    if topic.rate_hz:
        period = f"every {1 / topic.rate_hz:g} s" if topic.rate_hz < 1 else f"{topic.rate_hz:g} Hz"
        assert f"| {period}" in rows[0]
        stale = f"{topic.stale_after_s:g} s" if topic.stale_after_s else "-"
        assert f"| {stale} |" in rows[0]


def test_no_key_expression_of_the_robots_reaches_the_truth_or_the_emulated_hardware() -> None:
    trees = {topic.name: topic.template.partition("/")[0] for topic in EVERY_TOPIC}
    of_the_simulation = {"truth", "bus", "fault"}
    assert {name for name, tree in trees.items() if tree != "echelon"} == of_the_simulation
