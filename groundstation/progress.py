"""What the operator sees while a fleet runs: a live table on a terminal, else plain lines."""

import contextlib
import math
import time
from collections.abc import Iterator
from typing import Protocol

from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.table import Table

from config.angles import wrap
from config.fleet import Fleet
from groundstation.fleet_view import FleetView
from groundstation.formation_error import desired_sightline

TABLE_PERIOD_S = 0.2
LINE_PERIOD_S = 5.0
STATE_STYLES = {"RUNNING": "green", "FAULT": "bold red", "ESTOP": "bold red"}


class Display(Protocol):
    """Shows the fleet; `update` may be called as often as wanted."""

    def update(self, phase: str, fleet: Fleet, view: FleetView) -> None:
        """Show the fleet if it is time to."""

    def note(self, text: str) -> None:
        """Say something once."""


class LiveTable:
    """One row per robot, five times a second."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._next_s = 0.0

    def update(self, phase: str, fleet: Fleet, view: FleetView) -> None:
        """Show the fleet if it is time to."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + TABLE_PERIOD_S
            self._live.update(fleet_table(phase, fleet, view, time.time_ns()), refresh=True)

    def note(self, text: str) -> None:
        """Say something once, above the table."""
        self._live.console.print(text, highlight=False, markup=False, soft_wrap=True)


class PlainLines:
    """One line every few seconds, and at every new phase."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._next_s = 0.0
        self._phase = ""

    def update(self, phase: str, fleet: Fleet, view: FleetView) -> None:
        """Show the fleet if it is time to."""
        now_s = time.monotonic()
        if phase == self._phase and now_s < self._next_s:
            return
        self._next_s, self._phase = now_s + LINE_PERIOD_S, phase
        states = ", ".join(f"{name} {view.state(name) or 'silent'}" for name in fleet.robots)
        self._console.print(
            f"{phase}: {states}{_mission_time(fleet, view)}", highlight=False, soft_wrap=True
        )

    def note(self, text: str) -> None:
        """Say something once."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)


@contextlib.contextmanager
def display(console: Console) -> Iterator[Display]:
    """The display that suits the console."""
    if not console.is_terminal:
        yield PlainLines(console)
        return
    with Live(console=console, auto_refresh=False) as live:
        yield LiveTable(live)


def fleet_table(phase: str, fleet: Fleet, view: FleetView, now_wall_ns: int) -> Table:
    """State, errors, timing and age of data of each robot."""
    table = Table(title=f"{fleet.name}: {phase}", title_justify="left")
    for heading in ("robot", "state", "reason"):
        table.add_column(heading)
    for heading in ("mission", "range error", "bearing error", "loop p99", "data age"):
        table.add_column(heading, justify="right")
    for name in fleet.robots:
        state, reason = view.state_and_reason(name)
        status, age_s = view.status(name), view.age_s(name, now_wall_ns)
        style = STATE_STYLES.get(state, "")
        mission_s = None if status is None else status.mission_time_s
        table.add_row(
            name,
            f"[{style}]{state}[/]" if style else state or "silent",
            escape(reason),
            "" if mission_s is None else f"{mission_s:.1f} s",
            *_errors(fleet, name, view),
            "" if status is None else f"{status.loop.p99_ms:.2f} ms",
            "" if age_s is None else f"{age_s * 1e3:.0f} ms",
        )
    return table


def _errors(fleet: Fleet, name: str, view: FleetView) -> tuple[str, str]:
    """How far the follower believes to be from its place; empty for a leader."""
    estimate, offset = view.relative(name), fleet.robots[name].offset
    if estimate is None or offset is None or not estimate.valid:
        return "", ""
    range_m, bearing_rad = desired_sightline(offset)
    turned_deg = math.degrees(wrap(estimate.bearing_rad - bearing_rad))
    return f"{estimate.range_m - range_m:+.3f} m", f"{turned_deg:+.1f} deg"


def _mission_time(fleet: Fleet, view: FleetView) -> str:
    times = [
        status.mission_time_s
        for name in fleet.robots
        if (status := view.status(name)) is not None and status.mission_time_s is not None
    ]
    return f", mission {max(times):.1f} of {fleet.mission.duration_s:g} s" if times else ""
