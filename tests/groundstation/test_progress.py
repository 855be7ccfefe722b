"""What the operator sees while a fleet runs."""

import io

from rich.console import Console

from config.topics import RELATIVE, STATUS
from groundstation import keys
from groundstation.fleet_view import FleetView
from groundstation.progress import PlainLines, fleet_table
from tests.groundstation.synthetic import WALL_NS, behind, fleet, relative, status, straight


def _view() -> FleetView:
    view = FleetView()
    view.hear(keys.parse(STATUS.key("pair", "r2")), status("r2", "RUNNING", "lost [Error 104]", 10))
    seen = relative(behind()(3.0), straight(3.0), 10)
    view.hear(keys.parse(RELATIVE.key("pair", "r2")), seen)
    return view


def _console() -> Console:
    return Console(file=io.StringIO(), width=160)


def _text(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_the_table_shows_state_errors_timing_and_age() -> None:
    console = _console()
    console.print(fleet_table("driving", fleet(), _view(), WALL_NS + 250_000_000))
    r1, r2 = (line for line in _text(console).splitlines() if line.startswith("│"))
    assert "silent" in r1
    # The estimate is 0.1 m and 0.02 rad off; the status was captured 0.2 s after the start.
    for expected in ("RUNNING", "lost [Error 104]", "+0.100 m", "+1.1 deg", "2.00 ms", "50 ms"):
        assert expected in r2


def test_without_a_terminal_each_phase_is_one_line() -> None:
    console = _console()
    lines = PlainLines(console)
    for phase in ("waiting", "waiting", "driving"):
        lines.update(phase, fleet(), _view())
    assert _text(console) == "waiting: r1 silent, r2 RUNNING\ndriving: r1 silent, r2 RUNNING\n"


def test_an_older_message_does_not_replace_a_newer_one() -> None:
    view = _view()
    view.hear(keys.parse(STATUS.key("pair", "r2")), status("r2", "ARMED", "", 5))
    assert view.state("r2") == "RUNNING"
