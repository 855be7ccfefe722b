"""docs/paper.md names code that exists, and shows pictures that are there and small."""

import re
from pathlib import Path

import pytest

from groundstation.study.errata import EXPERIMENTS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
PICTURE_BYTES = 200_000
NAMED = re.compile(r"`([\w/.]+\.(?:py|yaml))`|`(\w+)`")


def named_code() -> list[tuple[Path, str]]:
    """Every (file, function or class) of the table of equations."""
    section = PAGE.split("## Where each equation is")[1].split("\n## ")[0]
    found, file = [], ROOT
    for row in section.splitlines():
        for path, name in NAMED.findall(row.rsplit("|", 2)[-2] if row.startswith("| ") else ""):
            if path:
                file = ROOT / path if "/" in path else file.parent / path
            else:
                found.append((file, name))
    return found


@pytest.mark.parametrize(("file", "name"), named_code(), ids=lambda each: str(each)[-40:])
def test_code_of_an_equation_exists(file: Path, name: str) -> None:
    assert re.search(rf"^(def|class) {name}\b", file.read_text(encoding="utf-8"), re.MULTILINE)


def test_the_table_was_read() -> None:
    assert {"front_drive_rates", "riccati", "PaperFilter"} <= {name for _, name in named_code()}


def test_pictures_are_there_and_small() -> None:
    pictures = re.findall(r"\]\((images/[\w.-]+)\)", PAGE)
    assert len(pictures) == 3
    assert all((ROOT / "docs" / each).stat().st_size < PICTURE_BYTES for each in pictures)


def test_every_erratum_of_the_command_has_its_row() -> None:
    assert [name for name in EXPERIMENTS if not re.search(rf"^\| `(--)?{name}`", PAGE, re.M)] == []
