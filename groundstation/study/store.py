"""The folder of a Monte-Carlo study: one file of JSON lines per cell, one line per finished seed.

A line is written whole or, after a crash, ignored; so a study goes on where it was interrupted.
`study.json` says which study and settings the lines belong to.
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from groundstation.errors import GroundError

MANIFEST = "study.json"
CELLS = "cells"

R = TypeVar("R")


class Manifest(msgspec.Struct, frozen=True):
    """What the results in a folder depend on besides the seed."""

    study: str
    settings: str
    code: str


class Store(Generic[R]):
    """Results of type `R`, kept per cell and seed."""

    def __init__(self, folder: Path, kind: type[R]) -> None:
        self._folder = folder / CELLS
        self._decoder = msgspec.json.Decoder(kind)
        self._folder.mkdir(parents=True, exist_ok=True)

    def read(self, cell: str) -> dict[int, R]:
        """The finished seeds of a cell; a half-written last line is cut off.

        Raises GroundError where a line is not a result.
        """
        path = self._path(cell)
        if not path.exists():
            return {}
        whole, _, rest = path.read_bytes().rpartition(b"\n")
        if rest:
            with path.open("r+b") as stream:
                stream.truncate(len(whole) + 1 if whole else 0)
        return dict(self._entry(path, number, line) for number, line in _numbered(whole))

    def add(self, cell: str, seed: int, result: R) -> None:
        """Keep one result; the line is on the disk's way when this returns."""
        line = b"%d %s\n" % (seed, msgspec.json.encode(result))
        with self._path(cell).open("ab", buffering=0) as stream:
            stream.write(line)

    def _path(self, cell: str) -> Path:
        return self._folder / f"{cell}.jsonl"

    def _entry(self, path: Path, number: int, line: bytes) -> tuple[int, R]:
        seed, _, body = line.partition(b" ")
        try:
            return int(seed), self._decoder.decode(body)
        except (ValueError, msgspec.MsgspecError) as error:
            raise GroundError(
                f"{path}:{number}: not a result of this study ({error}): delete the file to "
                "compute it again"
            ) from error


def _numbered(lines: bytes) -> Iterable[tuple[int, bytes]]:
    return enumerate(lines.splitlines(), start=1) if lines else ()


def open_folder(folder: Path, manifest: Manifest, resume: bool) -> None:
    """Make the folder, or with `resume` go on in it if it belongs to the same study.

    Raises GroundError when it holds something else, or cannot be made.
    """
    path = folder / MANIFEST
    try:
        if folder.is_dir() and any(folder.iterdir()):
            _check(folder, manifest, resume)
            return
        folder.mkdir(parents=True, exist_ok=True)
        path.write_bytes(msgspec.json.format(msgspec.json.encode(manifest), indent=2) + b"\n")
    except OSError as error:
        raise GroundError(f"cannot make the folder {folder}: {error.strerror}") from error


def _check(folder: Path, manifest: Manifest, resume: bool) -> None:
    if not resume:
        raise GroundError(
            f"the folder {folder} is not empty: name another one with --out, or add --resume"
        )
    try:
        found = msgspec.json.decode((folder / MANIFEST).read_bytes(), type=Manifest)
    except (OSError, msgspec.MsgspecError) as error:
        raise GroundError(
            f"{folder} holds no study to go on with ({MANIFEST}): name another folder with --out"
        ) from error
    for field in Manifest.__struct_fields__:
        if getattr(found, field) != getattr(manifest, field):
            raise GroundError(
                f"the results in {folder} are of another {field} "
                f"({getattr(found, field)}, now {getattr(manifest, field)}): name another folder "
                "with --out"
            )


def code_fingerprint(patterns: Iterable[str]) -> str:
    """Digest of the sources that a study's numbers come from, as patterns from the top folder."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in root.glob(pattern)):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
