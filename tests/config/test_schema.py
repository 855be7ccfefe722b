"""The JSON schema that editors use."""

import json
from pathlib import Path

import pytest

from config.loader import shipped_fleet_path, shipped_fleets
from config.schema import SCHEMA_PATH, fleet_file_schema, schema_text


def test_the_committed_schema_is_current() -> None:
    """If not: python -m config.schema"""
    assert SCHEMA_PATH.read_text(encoding="utf-8") == schema_text()


@pytest.mark.parametrize("name", shipped_fleets())
def test_shipped_fleets_name_their_schema(name: str) -> None:
    path = shipped_fleet_path(name)
    first = path.read_text(encoding="utf-8").splitlines()[0]
    reference = Path(first.removeprefix("# yaml-language-server: $schema="))
    assert (path.parent / reference).resolve() == SCHEMA_PATH.resolve()


def test_every_reference_leads_somewhere() -> None:
    text = schema_text()
    used = {part.split('"')[0] for part in text.split("#/$defs/")[1:]}
    assert used <= set(json.loads(text)["$defs"])


def test_a_robot_may_give_part_of_its_settings_but_a_marker_is_whole() -> None:
    schema = fleet_file_schema()
    robot = schema["$defs"]["RobotEntry"]
    assert "required" not in robot
    assert "type" in robot["properties"]
    assert "required" not in schema["$defs"]["VehicleSettings"]
    assert schema["$defs"]["Marker"]["required"] == ["x_m", "y_m", "id"]
    assert robot["properties"]["markers"]["items"] == {"$ref": "#/$defs/Marker"}


def test_unknown_keys_are_marked_everywhere() -> None:
    schema = fleet_file_schema()
    assert schema["additionalProperties"] is False
    assert all(d["additionalProperties"] is False for d in schema["$defs"].values())
