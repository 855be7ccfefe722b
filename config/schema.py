"""JSON schema of the fleet file for editors: `python -m config.schema` writes it again.

It describes the file before the cascade, so `defaults`, `types` and `robots` may each give only
some of a robot's settings.
"""

import copy
import json
from pathlib import Path
from typing import Any

from config.fleet import Fleet

SCHEMA_PATH = Path(__file__).with_name("fleet.schema.json")

_REF = "#/$defs/"
_PARTIAL = "Settings"


def fleet_file_schema() -> dict[str, Any]:
    """JSON schema (2020-12) of a fleet file."""
    schema = Fleet.model_json_schema()
    definitions = schema["$defs"]
    settings = {"$ref": _partial(definitions, "Robot")}
    robot = copy.deepcopy(definitions["Robot" + _PARTIAL])
    robot["properties"] = {"type": {"type": "string", "title": "Type"}, **robot["properties"]}
    definitions["RobotEntry"] = robot
    schema["properties"] |= {
        "defaults": settings,
        "types": {"type": "object", "additionalProperties": settings},
        "robots": {
            "type": "object",
            "minProperties": 1,
            "additionalProperties": {"$ref": _REF + "RobotEntry"},
        },
    }
    schema["title"] = "Echelon fleet file"
    schema["required"] = [*schema["required"], "landmarks"]
    del definitions["Robot"]
    return schema


def schema_text() -> str:
    """The schema as the committed file holds it."""
    return json.dumps(fleet_file_schema(), indent=1, sort_keys=True) + "\n"


def _partial(definitions: dict[str, Any], name: str) -> str:
    """Add a copy of a definition with nothing required, in its mappings neither; its reference."""
    copied = name + _PARTIAL
    if copied not in definitions:
        definition = copy.deepcopy(definitions[name])
        definition.pop("required", None)
        definitions[copied] = definition
        for value in definition["properties"].values():
            for option in [value, *value.get("anyOf", [])]:
                if "$ref" in option:
                    option["$ref"] = _partial(definitions, option["$ref"].removeprefix(_REF))
    return _REF + copied


if __name__ == "__main__":
    SCHEMA_PATH.write_text(schema_text(), encoding="utf-8")
