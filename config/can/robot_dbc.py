"""One DBC file for a whole robot, so that stock CAN tools can decode its bus.

The templates are merged as text: cantools keeps only the last file's nodes and attribute
definitions when it joins databases, and then writes a file that it cannot read.
"""

import re
from collections.abc import Iterable

from config.can.database import AXIS_DBC, BEARING_SENSOR_DBC, VEHICLE_AUX_DBC, template_text
from config.can.plan import IDS_PER_NODE

_HEADER = 'VERSION "echelon robot: steering {steering}, drive {drive}, bearing sensor {sensor}"'
_SECTIONS = ("BO_", "CM_", "BA_DEF_", "BA_DEF_DEF_", "BA_", "VAL_", "SIG_VALTYPE_")
"""In the order that a DBC file needs."""

_ID = re.compile(r'^((?:BO_|(?:CM_|BA_ "\w+") (?:BO_|SG_)|VAL_|SIG_VALTYPE_) )(\d+)')
_DATA_ID = re.compile(r'^(BA_ "E2E_DataID" BO_ \d+ )(\d+)')


def robot_dbc(steering_node: int, drive_node: int, sensor_unit: int = 0) -> str:
    """DBC text of one robot's bus: messages `Steering_*`, `Drive_*`, `Brg_*`, `Sys_*`, ..."""
    axis = template_text(AXIS_DBC)
    parts = [
        _moved(template_text(VEHICLE_AUX_DBC), 0),
        _moved(_named(axis, "Steering"), steering_node * IDS_PER_NODE),
        _moved(_named(axis, "Drive"), drive_node * IDS_PER_NODE),
        _moved(template_text(BEARING_SENSOR_DBC), sensor_unit * IDS_PER_NODE),
    ]
    nodes = dict.fromkeys(name for part in parts for name in _nodes(part))
    header = _HEADER.format(steering=steering_node, drive=drive_node, sensor=sensor_unit)
    body = [f"{header}\n\nNS_ :\n\nBS_:\n\nBU_: {' '.join(nodes)}\n"]
    body += ["\n".join(_section(parts, keyword)) + "\n" for keyword in _SECTIONS]
    return "\n".join(body)


def _named(axis: str, name: str) -> str:
    """The axis template with its messages and its node named after one axis."""
    axis = re.sub(r"^(BO_ \d+ )Axis_", rf"\1{name}_", axis, flags=re.MULTILINE)
    return re.sub(r"^((?:BU_| ?SG_|BO_).*)\bODrive$", rf"\1{name}ODrive", axis, flags=re.MULTILINE)


def _moved(text: str, shift: int) -> str:
    def higher(match: re.Match[str]) -> str:
        return f"{match[1]}{int(match[2]) + shift}"

    return "\n".join(_DATA_ID.sub(higher, _ID.sub(higher, line)) for line in text.splitlines())


def _nodes(text: str) -> list[str]:
    found = re.search(r"^BU_:(.*)$", text, flags=re.MULTILINE)
    return found[1].split() if found else []


def _section(parts: Iterable[str], keyword: str) -> list[str]:
    """Lines of one section of all parts, each distinct line once (messages keep every line).

    Comments on a whole file are dropped: a database has room for one.
    """
    lines = [line for part in parts for line in _lines(part, keyword)]
    return lines if keyword == "BO_" else list(dict.fromkeys(lines))


def _lines(part: str, keyword: str) -> list[str]:
    if keyword == "BO_":
        return [line for line in part.splitlines() if line.startswith(("BO_ ", " SG_ "))]
    return [
        line
        for line in part.splitlines()
        if line.startswith(f"{keyword} ") and not line.startswith('CM_ "')
    ]
