"""Read a file of scripted faults; every mistake is reported at once, with its place."""

from collections.abc import Collection
from pathlib import Path

from pydantic import ValidationError

from config.faults import FaultScript, problems
from config.problems import FleetFileError, problem_at, schema_problem
from config.yaml_tree import parse


def load_faults(path: Path, robots: Collection[str]) -> FaultScript:
    """The faults in a file, for a fleet of these robots. Raises FleetFileError and nothing else."""
    try:
        source = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FleetFileError(f"{path}: cannot be read: {reason}") from None
    root, found = parse(source)
    if found:
        raise FleetFileError.of(path, source, found)
    if root is None or not isinstance(root.value, dict):
        raise FleetFileError(f"{path}: a fault file starts with `version: 1` and lists `faults:`")
    try:
        script = FaultScript.model_validate(root.plain())
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
        mistakes = [schema_problem(root, error, FaultScript) for error in errors]
        raise FleetFileError.of(path, source, mistakes) from None
    mistakes = [
        problem_at(root, ("faults", index, key), text)
        for index, fault in enumerate(script.faults)
        for key, text in problems(fault, robots)
    ]
    if mistakes:
        raise FleetFileError.of(path, source, mistakes)
    return script
