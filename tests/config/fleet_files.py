"""A small valid fleet file for tests to spoil."""

import json
from pathlib import Path
from typing import Any

import yaml

from config.fleet import Fleet
from config.loader import load_fleet

SMALL = """\
version: 1
name: small
landmarks: []
mission:
  segments:
    - {duration_s: 20, speed_mps: 1, fork_rate_radps: 0}
defaults:
  can: {interface: simcan, channel: "{runtime}/{robot}.sock"}
  limits:
    speed_mps: 2
    acceleration_mps2: 2
    deceleration_mps2: 4
    steering_rad: 0.6
    steering_rate_radps: 4
types:
  car:
    vehicle:
      wheelbase_m: 0.25
      steering: {node: 1, revolutions_per_unit: 8}
      drive: {node: 2, revolutions_per_unit: 16}
robots:
  r1:
    type: car
    start: {x_m: 0, y_m: 0}
    markers: [{id: 11, x_m: 0, y_m: 0}]
  r2:
    type: car
    leader: r1
    offset: {x_m: -0.5, y_m: 0}
    start: {x_m: -1, y_m: 0}
    markers: [{id: 21, x_m: 0, y_m: 0}]
  r3:
    type: car
    leader: r2
    offset: {x_m: -0.5, y_m: 0}
    start: {x_m: -2, y_m: 0}
    markers: [{id: 31, x_m: 0, y_m: 0}]
"""


def small() -> dict[str, Any]:
    """The small fleet file as data."""
    data: dict[str, Any] = yaml.safe_load(SMALL)
    return data


def written(folder: Path, content: str | dict[str, Any]) -> Path:
    """The content as a fleet file in `folder`; JSON is YAML too."""
    path = folder / "fleet.yaml"
    text = content if isinstance(content, str) else json.dumps(content)
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder: Path, content: str | dict[str, Any]) -> Fleet:
    """The content loaded as a fleet."""
    return load_fleet(written(folder, content)).fleet


def spoilt(old: str, new: str) -> str:
    """The small fleet file with its first `old` replaced."""
    assert old in SMALL
    return SMALL.replace(old, new, 1)
