"""Find, read and check fleet files; every mistake is reported at once, with its place."""

import copy
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from config.advice import warnings
from config.cascade import Resolved, resolve
from config.checks import findings
from config.fleet import Fleet, Robot
from config.problems import FleetFileError, problem_at, schema_problem
from config.runtime import expand_channel, runtime_dir
from config.yaml_tree import Entry, Plain, Problem, parse

__all__ = [
    "FleetFileError",
    "LoadedFleet",
    "dump_effective",
    "expand_channel",
    "load_fleet",
    "resolve_fleet",
    "runtime_dir",
    "shipped_fleet_path",
    "shipped_fleets",
    "warnings",
]

SUPPORTED_VERSION = 1


@dataclass(frozen=True, slots=True)
class LoadedFleet:
    """A checked fleet, where it came from, and the file's settings after the cascade."""

    fleet: Fleet
    source_path: Path
    raw_effective: Plain


def shipped_fleets() -> list[str]:
    """Names of the fleets that come with the program."""
    return sorted(path.stem for path in _fleets_folder().glob("*.yaml"))


def shipped_fleet_path(name: str) -> Path:
    """File of a shipped fleet. Raises FleetFileError for an unknown name."""
    if name not in shipped_fleets():
        raise FleetFileError(f"{name}: no such fleet; shipped are {', '.join(shipped_fleets())}")
    return _fleets_folder() / f"{name}.yaml"


def resolve_fleet(name_or_path: str | Path) -> Path:
    """File meant by a shipped fleet's name or a path. Raises FleetFileError where there is none."""
    name = str(name_or_path)
    if name in shipped_fleets():
        return shipped_fleet_path(name)
    path = Path(name_or_path)
    if path.is_dir():
        raise FleetFileError(f"{path}: a folder, not a fleet file")
    if not path.exists():
        near = get_close_matches(name, shipped_fleets(), 1)
        hint = f"did you mean {near[0]!r}?" if near else f"shipped: {', '.join(shipped_fleets())}"
        raise FleetFileError(f"{path}: no such fleet file, nor a shipped fleet; {hint}")
    return path


def load_fleet(path: str | Path) -> LoadedFleet:
    """Read a fleet file and check all of it. Raises FleetFileError and nothing else."""
    path = Path(path)
    source = _read(path)
    root, problems = parse(source)
    if root is None or not isinstance(root.value, dict):
        raise _unusable(path, source, root, problems)
    if _other_version(root):
        text = f"this program reads version {SUPPORTED_VERSION} only"
        raise FleetFileError.of(path, source, [problem_at(root, ("version",), text)])
    resolved = resolve(root)
    fleet, more = _validate(resolved)
    problems += resolved.problems + more
    if fleet is None or problems:
        raise FleetFileError.of(path, source, problems)
    return LoadedFleet(fleet, path, resolved.fleet.plain())


def dump_effective(fleet: Fleet) -> str:
    """The fleet with every setting spelt out, as a fleet file that loads to an equal fleet."""
    return yaml.safe_dump(fleet.model_dump(mode="json"), sort_keys=False, allow_unicode=True)


def _fleets_folder() -> Path:
    return Path(str(resources.files("config"))) / "fleets"


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FleetFileError(f"{path}: not UTF-8 text (byte {error.start})") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FleetFileError(f"{path}: cannot be read: {reason}") from None


def _unusable(
    path: Path, source: str, root: Entry | None, problems: list[Problem]
) -> FleetFileError:
    if problems:
        return FleetFileError.of(path, source, problems)
    if root is None or root.value is None:
        return FleetFileError(f"{path}: empty; a fleet file starts with `version: 1`")
    text = "a fleet file is a mapping that starts with `version: 1`"
    return FleetFileError.of(path, source, [Problem(root.place, "", text)])


def _other_version(root: Entry) -> bool:
    version = root.child("version")
    return version is not None and version.value != SUPPORTED_VERSION


def _validate(resolved: Resolved) -> tuple[Fleet | None, list[Problem]]:
    """Judge by the schema, then by the cross-checks as soon as the schema allows them."""
    data = resolved.fleet.plain()
    fleet, errors = _fleet_of(data)
    if errors and all(error["type"] == "extra_forbidden" for error in errors):
        fleet, more = _fleet_of(_without(data, errors))
        errors += more
    problems = [
        schema_problem(resolved.fleet, error)
        for error in errors
        if not _may_be_in_unknown_type(error, resolved.doubtful)
    ]
    for unused in resolved.unused_types:
        problems += _type_problems(unused)
    if fleet is not None:
        problems += [problem_at(resolved.fleet, path, text) for path, text in findings(fleet)]
    return fleet, problems


def _fleet_of(data: Plain) -> tuple[Fleet | None, list[ErrorDetails]]:
    try:
        return Fleet.model_validate(data), []
    except ValidationError as error:
        return None, error.errors(include_url=False)


def _without(data: Plain, errors: list[ErrorDetails]) -> Plain:
    """The data without the keys that the errors are about."""
    pruned = copy.deepcopy(data)
    for error in errors:
        owner: Any = pruned
        for key in error["loc"][:-1]:
            owner = owner[key]
        del owner[error["loc"][-1]]
    return pruned


def _may_be_in_unknown_type(error: ErrorDetails, doubtful: frozenset[str]) -> bool:
    robot = error["loc"][1:2] if error["loc"][0] == "robots" else ()
    return error["type"] == "missing" and robot != () and robot[0] in doubtful


def _type_problems(entry: Entry) -> list[Problem]:
    """Mistakes in a type that no robot uses; what it lacks, a robot could still give."""
    try:
        Robot.model_validate(entry.plain())
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
        return [schema_problem(entry, e, Robot) for e in errors if e["type"] != "missing"]
    return []
