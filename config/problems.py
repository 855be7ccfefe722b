"""Mistakes in a fleet file, worded for the person who wrote it."""

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path as FilePath
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from config.fleet import Fleet, Robot
from config.yaml_tree import Entry, Path, Problem, dotted

FILE_ONLY_KEYS: Mapping[type[BaseModel], tuple[str, ...]] = {
    Fleet: ("defaults", "types"),
    Robot: ("type",),
}
"""Keys of the file that the cascade uses up before the schema sees the result."""

_LONGEST_VALUE = 40
_LONGEST_LINE = 120


class FleetFileError(Exception):
    """A fleet file that cannot be used; the text lists every mistake with its place.

    `problems` holds the same mistakes as data, in the order of the file.
    """

    def __init__(self, text: str, problems: Sequence[Problem] = ()) -> None:
        super().__init__(text)
        self.problems = tuple(problems)

    @classmethod
    def of(cls, file: FilePath, source: str, problems: Iterable[Problem]) -> "FleetFileError":
        """All problems of one file, each with its source line and a caret below it."""
        ordered = sorted(set(problems))
        lines = source.splitlines()
        return cls("\n".join(_render(file, lines, problem) for problem in ordered), ordered)


def _render(file: FilePath, lines: list[str], problem: Problem) -> str:
    line, column = problem.place.line, problem.place.column
    where = f"{problem.path}: " if problem.path else ""
    head = f"{file}:{line}:{column}: {where}{problem.text}"
    if line > len(lines):
        return head
    skipped = max(0, column - _LONGEST_LINE)
    shown = lines[line - 1].replace("\t", " ")[skipped : skipped + _LONGEST_LINE]
    return f"{head}\n    {shown}\n    {' ' * (column - 1 - skipped)}^"


def problem_at(root: Entry, path: Path, text: str) -> Problem:
    """A problem with the value at `path`, placed where the file wrote it."""
    entry, rest = root.find(path)
    if rest or isinstance(entry.value, dict | list):
        return Problem(entry.key_place, dotted(entry.path + rest), text)
    return Problem(entry.place, dotted(entry.path), text)


def schema_problem(root: Entry, error: ErrorDetails, model: type[BaseModel] = Fleet) -> Problem:
    """Word one of pydantic's errors about the tree `root`, which should hold a `model`."""
    path = error["loc"]
    if error["type"] == "extra_forbidden":
        entry, _ = root.find(path)
        text = f"unknown key; {_known_keys(model, path)}"
        return Problem(entry.key_place, dotted(entry.path), text)
    if error["type"] == "missing":
        parent, _ = root.find(path[:-1])
        return Problem(parent.key_place, dotted(parent.path), f"`{path[-1]}` is missing")
    return problem_at(root, path, _wording(error))


def _known_keys(model: type[BaseModel], path: Path) -> str:
    owner = _model_at(model, path[:-1])
    fields = [(field.validation_alias, name) for name, field in owner.model_fields.items()]
    names = [alias if isinstance(alias, str) else name for alias, name in fields]
    known = [*names, *FILE_ONLY_KEYS.get(owner, ())]
    near = get_close_matches(str(path[-1]), known, 1, cutoff=0.5)
    return f"did you mean `{near[0]}`?" if near else f"known here: {', '.join(sorted(known))}"


def _model_at(model: type[BaseModel], path: Path) -> type[BaseModel]:
    """The model that describes the mapping at `path`."""
    annotation: Any = model
    for key in path:
        annotation = _bare(annotation)
        if get_origin(annotation) in (dict, list):
            annotation = get_args(annotation)[-1]
        else:
            annotation = annotation.model_fields[key].annotation
    found: type[BaseModel] = _bare(annotation)
    return found


def _bare(annotation: Any) -> Any:
    """An annotation without `Annotated` and `| None`."""
    if get_origin(annotation) is Annotated:
        return _bare(get_args(annotation)[0])
    options = [option for option in get_args(annotation) if option is not type(None)]
    if type(None) in get_args(annotation) and len(options) == 1:
        return _bare(options[0])
    return annotation


def _wording(error: ErrorDetails) -> str:
    if error["type"] in ("value_error", "assertion_error"):
        return str(error["ctx"]["error"])
    message = error["msg"].replace("Input should be", "must be")
    message = message.replace("String should match", "must match").split(", unable to")[0]
    message = re.sub(r"must be a valid dictionary( or .*)?", "must be a mapping", message)
    message = re.sub(r"List should have (.*) after validation.*", r"must have \1", message)
    text = f"{_shown(error['input'])} is not allowed: {message}"
    if error["type"] == "literal_error":
        allowed = re.findall(r"'([^']*)'", error["ctx"]["expected"])
        near = get_close_matches(str(error["input"]), allowed, 1)
        text += f"; did you mean {near[0]!r}?" if near else ""
    return text


def _shown(value: object) -> str:
    if value is None:
        return "an empty value"
    if isinstance(value, dict | list):
        return f"a {'mapping' if isinstance(value, dict) else 'list'}"
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}..."
