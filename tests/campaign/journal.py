"""Results of finished runs as JSON lines, so that an interrupted campaign goes on where it was.

The first line names the program that the results are of: with other sources they begin anew.
"""

import hashlib
from pathlib import Path
from typing import Any

import msgspec

from config.closing import Closing

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build" / "campaign"
_SOURCES = ("config", "onboard", "sim_hw", "tests/campaign")
_SCENARIO = ("witness.py", "trial.py", "scenario.py")


class _Head(msgspec.Struct):
    sources: str


class _Line(msgspec.Struct):
    key: str
    result: msgspec.Raw


class Journal(Closing):
    """One file of results by key; `done` holds those that are already there.

    `script` is the file of this folder that says what is run.
    """

    def __init__(self, path: Path, script: str, fresh: bool = False) -> None:
        head = msgspec.json.encode(_Head(fingerprint(script)))
        self.done: dict[str, bytes] = {} if fresh else _read(path, head)
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = [msgspec.json.encode(_Line(k, msgspec.Raw(v))) for k, v in self.done.items()]
        path.write_bytes(b"\n".join([head, *lines, b""]))
        self._file = path.open("ab")

    def close(self) -> None:
        """No more results."""
        self._file.close()

    def add(self, key: str, result: bytes) -> None:
        """Keep one result, at once."""
        self.done[key] = result
        self._file.write(msgspec.json.encode(_Line(key, msgspec.Raw(result))) + b"\n")
        self._file.flush()


def _read(path: Path, expected: bytes) -> dict[str, bytes]:
    """What a file holds of this program's results; a line that was cut off is left out."""
    if not path.exists():
        return {}
    head, *lines = path.read_bytes().splitlines() or [b""]
    if head != expected:
        return {}
    read = (_parsed(line, _Line) for line in lines)
    return {line.key: bytes(line.result) for line in read if line is not None}


def _parsed(line: bytes, kind: type[Any]) -> Any:
    try:
        return msgspec.json.decode(line, type=kind)
    except msgspec.DecodeError:
        return None


def fingerprint(script: str) -> str:
    """Of everything that a run depends on; how runs are judged and shown is not."""
    digest = hashlib.sha256()
    files = [f for folder in _SOURCES for f in sorted((ROOT / folder).rglob("*")) if f.is_file()]
    for file in [*files, ROOT / "groundstation" / "lockstep.py"]:
        judges = file.parent.name == "campaign" and file.name not in (*_SCENARIO, script)
        if file.suffix in (".py", ".yaml", ".dbc") and not judges:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
