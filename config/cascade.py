"""The cascade of a fleet file: `defaults`, then the robot's `type`, then the robot itself."""

from dataclasses import dataclass
from difflib import get_close_matches

from config.problems import problem_at
from config.yaml_tree import Entry, Problem, merge


@dataclass(frozen=True, slots=True)
class Resolved:
    """The fleet after the cascade. `unused_types` are complete with the defaults, for checking.

    `doubtful` names robots whose type is unknown: what they seem to miss may be in that type.
    """

    fleet: Entry
    unused_types: list[Entry]
    doubtful: frozenset[str]
    problems: list[Problem]


def resolve(root: Entry) -> Resolved:
    """Give every robot its settings from `types` and `defaults`, and drop these two sections."""
    assert isinstance(root.value, dict)
    problems: list[Problem] = []
    defaults = _section(root, "defaults", problems)
    types = _section(root, "types", problems)
    kinds = {name: _mapping(entry, problems) for name, entry in _children(types).items()}
    complete = {name: merge(defaults, kind) for name, kind in kinds.items()}
    rest = {key: entry for key, entry in root.value.items() if key not in ("defaults", "types")}
    doubtful: set[str] = set()
    used: set[str] = set()
    if "robots" in rest and isinstance(rest["robots"].value, dict):
        robots: dict[str, Entry] = {}
        for name, robot in rest["robots"].value.items():
            kind = _type_of(robot)
            used.add(kind or "")
            if kind is not None and kind not in complete:
                doubtful.add(name)
                problems.append(_unknown_type(root, name, kind, list(complete)))
            base = defaults if kind is None else complete.get(kind, defaults)
            robots[name] = merge(base, _without_type(_mapping(robot, problems)))
        old = rest["robots"]
        rest["robots"] = Entry(robots, old.place, old.key_place, old.path)
    return Resolved(
        Entry(rest, root.place, root.key_place, root.path),
        [entry for name, entry in complete.items() if name not in used],
        frozenset(doubtful),
        problems,
    )


def _children(entry: Entry) -> dict[str, Entry]:
    return entry.value if isinstance(entry.value, dict) else {}


def _section(root: Entry, key: str, problems: list[Problem]) -> Entry:
    entry = root.child(key)
    return _mapping(entry, problems) if entry else Entry({}, root.place, root.key_place, (key,))


def _mapping(entry: Entry, problems: list[Problem]) -> Entry:
    """The entry if it is a mapping; an empty one in its place if it is empty or a mistake."""
    if isinstance(entry.value, dict):
        return entry
    if entry.value is not None:
        problems.append(Problem(entry.place, ".".join(map(str, entry.path)), "must be a mapping"))
    return Entry({}, entry.place, entry.key_place, entry.path)


def _type_of(robot: Entry) -> str | None:
    kind = robot.child("type")
    return None if kind is None else str(kind.value)


def _without_type(robot: Entry) -> Entry:
    settings = {key: entry for key, entry in _children(robot).items() if key != "type"}
    return Entry(settings, robot.place, robot.key_place, robot.path)


def _unknown_type(root: Entry, robot: str, kind: str, known: list[str]) -> Problem:
    near = get_close_matches(kind, known, 1)
    hint = f"did you mean {near[0]!r}?" if near else f"types are {', '.join(known) or 'not given'}"
    return problem_at(root, ("robots", robot, "type"), f"no type {kind!r}; {hint}")
