"""YAML read into a tree that remembers where every value was written.

Plain scalars follow YAML 1.2: decimal numbers (also `1e-3`), null, and text; `on`, `yes`, `true`
and dates are text, which the schema then judges. Whatever is wrong is a Problem with its place.
"""

import re
from dataclasses import dataclass, field
from typing import TypeAlias

import yaml

Key: TypeAlias = str | int
Path: TypeAlias = tuple[Key, ...]
Plain: TypeAlias = "dict[str, Plain] | list[Plain] | str | int | float | None"

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_REAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"([-+]?)\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_SCALAR_TAGS = frozenset(
    f"tag:yaml.org,2002:{kind}"
    for kind in ("null", "bool", "int", "float", "str", "timestamp", "merge", "value")
)
_MAX_VALUES = 20_000


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Line and column in the file, both from 1."""

    line: int
    column: int


@dataclass(frozen=True, slots=True, order=True)
class Problem:
    """A mistake in the file: where, at which key, and what to do about it."""

    place: Place
    path: str
    text: str


@dataclass(frozen=True, slots=True)
class Entry:
    """A value, the place where it starts, the place of its key, and its path as written."""

    value: "dict[str, Entry] | list[Entry] | str | int | float | None"
    place: Place
    key_place: Place
    path: Path

    def plain(self) -> Plain:
        """The value without places."""
        if isinstance(self.value, dict):
            return {key: entry.plain() for key, entry in self.value.items()}
        if isinstance(self.value, list):
            return [entry.plain() for entry in self.value]
        return self.value

    def find(self, path: Path) -> "tuple[Entry, Path]":
        """The deepest entry on `path` and the rest of the path below it."""
        entry = self
        for depth, key in enumerate(path):
            child = entry.child(key)
            if child is None:
                return entry, path[depth:]
            entry = child
        return entry, ()

    def child(self, key: Key) -> "Entry | None":
        """The entry under a key or index, if there is one."""
        if isinstance(self.value, dict):
            return self.value.get(str(key))
        if isinstance(self.value, list) and isinstance(key, int) and key < len(self.value):
            return self.value[key]
        return None


def merge(base: Entry, over: Entry) -> Entry:
    """`over` on top of `base`: mappings key by key, anything else is replaced."""
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    merged = dict(base.value)
    for key, entry in over.value.items():
        merged[key] = merge(merged[key], entry) if key in merged else entry
    return Entry(merged, over.place, over.key_place, over.path)


def dotted(path: Path) -> str:
    """`robots.r1.markers[0].id`."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)
    return text.removeprefix(".")


def parse(text: str) -> tuple[Entry | None, list[Problem]]:
    """Read one YAML document; the entry is None where it has no content or is no YAML."""
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        return None, [_syntax_problem(error)]
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        return None, [Problem(Place(line, 1), "", f"not YAML: {error.reason}")]
    except RecursionError:
        return None, [Problem(Place(1, 1), "", "not a fleet file: nested too deeply")]
    if node is None:
        return None, []
    reader = _Reader()
    entry = reader.read(node, _place(node.start_mark), ())
    return entry, reader.problems


def _syntax_problem(error: yaml.MarkedYAMLError) -> Problem:
    mark = error.problem_mark or error.context_mark
    text = f"not YAML: {error.problem or error.context}"
    if "'\\t'" in text:
        text += "; indent with spaces, not tabs"
    elif error.context and error.context_mark and error.problem:
        text += f" ({error.context} that starts in line {error.context_mark.line + 1})"
    return Problem(_place(mark) if mark else Place(1, 1), "", text)


def _place(mark: yaml.Mark) -> Place:
    return Place(mark.line + 1, mark.column + 1)


@dataclass(slots=True)
class _Reader:
    """Turns YAML's nodes into entries; refuses what a fleet file has no use for."""

    problems: list[Problem] = field(default_factory=list)
    _open: set[int] = field(default_factory=set)
    _count: int = 0

    def read(self, node: yaml.Node, key_place: Place, path: Path) -> Entry:
        place = _place(node.start_mark)
        self._count += 1
        if id(node) in self._open or self._count > _MAX_VALUES:
            self._refuse(place, path, "an alias that leads to itself or to too many values")
            return Entry(None, place, key_place, path)
        self._open.add(id(node))
        try:
            return Entry(self._value(node, place, path), place, key_place, path)
        finally:
            self._open.discard(id(node))

    def _value(
        self, node: yaml.Node, place: Place, path: Path
    ) -> dict[str, Entry] | list[Entry] | str | int | float | None:
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [
                self.read(child, _place(child.start_mark), (*path, index))
                for index, child in enumerate(node.value)
            ]
        if node.tag not in _SCALAR_TAGS:
            self._refuse(place, path, f"tag {node.tag} has no meaning here: leave it out")
        quoted = isinstance(node, yaml.ScalarNode) and node.style is not None
        return node.value if quoted else _plain_scalar(node.value)

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Entry]:
        entries: dict[str, Entry] = {}
        for key_node, value_node in node.value:
            place = _place(key_node.start_mark)
            key = key_node.value
            if not isinstance(key, str):
                self._refuse(place, path, "a key must be a plain word")
            elif key == "<<":
                self._refuse(place, path, "merge keys are not read: use `defaults` and `types`")
            elif key in entries:
                first = entries[key].key_place.line
                self._refuse(place, (*path, key), f"given twice, first in line {first}: keep one")
            else:
                entries[key] = self.read(value_node, place, (*path, key))
        return entries

    def _refuse(self, place: Place, path: Path, text: str) -> None:
        self.problems.append(Problem(place, dotted(path), text))


def _plain_scalar(text: str) -> str | int | float | None:
    if text in _NULL:
        return None
    if _INTEGER.fullmatch(text):
        return int(text)
    if _REAL.fullmatch(text):
        return float(text)
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    return text
