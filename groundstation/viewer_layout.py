"""A layout for Lichtblick and Foxglove: the scene, errors, speeds and the log of one fleet.

`python -m groundstation.viewer_layout` prints that of the demo fleet, docs/viewer-layout.json.
"""

import json
from collections.abc import Iterator

from config import topics
from config.fleet import Fleet
from config.loader import load_fleet, shipped_fleet_path
from groundstation import formation_tree
from groundstation.scene import LOG, MAP, SCENE, TF

Json = dict[str, object]
VIEW, TEXT = "3D!scene", "RosOut!log"
RANGE, NIS, SPEED = "Plot!range", "Plot!nis", "Plot!speed"


def layout(fleet: Fleet) -> str:
    """The layout as JSON, to be imported into the viewer."""
    followers = formation_tree.followers(fleet)
    relatives = [topics.RELATIVE.key(fleet.name, name) for name in followers]
    motions = [topics.MOTION.key(fleet.name, name) for name in fleet.robots]
    panels: Json = {
        VIEW: _scene(),
        RANGE: _plot("Range to the leader [m]", [f"{key}.range_m" for key in relatives]),
        NIS: _plot("Mean NIS", [f"{key}.nis_mean" for key in relatives]),
        SPEED: _plot("Speed [m/s]", [f"{key}.speed_mps" for key in motions]),
        TEXT: {"searchTerms": [], "minLogLevel": 1, "topicToRender": LOG},
    }
    right = _split("column", RANGE, _split("column", NIS, SPEED, 50), 34)
    whole: Json = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", _split("column", VIEW, TEXT, 75), right, 60),
    }
    return json.dumps(whole, indent=2) + "\n"


def _split(direction: str, first: object, second: object, percent: float) -> Json:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percent}


def _scene() -> Json:
    grid = {"layerId": "foxglove.Grid", "visible": True, "frameLocked": True, "label": "Grid"}
    return {
        "followMode": "follow-none",
        "followTf": MAP,
        "cameraState": {
            "distance": 30,
            "perspective": False,
            "phi": 0,
            "thetaOffset": 0,
            "target": [0, 0, 0],
            "targetOffset": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.5,
            "far": 5000,
        },
        "scene": {},
        "transforms": {},
        "topics": {TF: {"visible": True}, SCENE: {"visible": True}},
        "layers": {"grid": {**grid, "size": 60, "divisions": 60, "instanceId": "grid"}},
    }


def _plot(title: str, values: list[str]) -> Json:
    return {
        "title": title,
        "paths": list(_paths(values)),
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _paths(values: list[str]) -> Iterator[Json]:
    for value in values:
        yield {"value": value, "enabled": True, "timestampMethod": "receiveTime"}


if __name__ == "__main__":
    print(layout(load_fleet(shipped_fleet_path("demo")).fleet), end="")
