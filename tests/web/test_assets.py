"""What the browser is given: a known uPlot, and nothing that points to other machines."""

import hashlib
import re
from importlib.resources import files
from pathlib import Path

STATIC = Path(str(files("groundstation.web"))) / "static"
UPLOT_1_6_32 = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    "LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}


def test_uplot_is_the_released_one_with_its_licence() -> None:
    folder = STATIC / "uplot"
    found = {each.name: hashlib.sha256(each.read_bytes()).hexdigest() for each in folder.iterdir()}
    assert found == UPLOT_1_6_32


def test_our_own_assets_name_no_other_machine() -> None:
    own = [path for path in STATIC.iterdir() if path.is_file()]
    assert len(own) > 10
    for path in own:
        addresses = re.findall(r"(?:https?:)?//[\w.-]+\.\w+[^\s\"']*", path.read_text())
        assert set(addresses) <= {"http://www.w3.org/2000/svg"}, path.name


def test_every_file_that_the_page_asks_for_exists() -> None:
    page = (STATIC / "index.html").read_text()
    for name in re.findall(r"(?:src|href)=\"([^\"#]+)\"", page):
        assert (STATIC / name).is_file(), name
    for module in STATIC.glob("*.js"):
        for name in re.findall(r"from \"\./([^\"]+)\"", module.read_text()):
            assert (STATIC / name).is_file(), f"{module.name} imports {name}"
