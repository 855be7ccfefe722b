"""`echelon doctor`: checks before anything moves, told to people and written to files."""

from datetime import UTC, datetime
from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table

from config.fleet import Fleet
from groundstation.doctor_figure import draw_mission
from groundstation.errors import GroundError
from groundstation.study.mission_check import MissionReport, check_mission

REPORT, PICTURE = "mission.json", "mission.png"


def examine_mission(fleet: Fleet, out: Path | None) -> tuple[MissionReport, Path]:
    """Check the planned mission; write report and picture to `out`, or to a folder under runs/.

    Raises GroundError where the folder cannot be written.
    """
    check = check_mission(fleet)
    folder = out or Path("runs") / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{fleet.name}-doctor"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / REPORT).write_bytes(to_json(check.report))
        draw_mission(fleet, check, folder / PICTURE)
    except OSError as error:
        raise GroundError(f"cannot write to the folder {folder}: {error.strerror}") from error
    return check.report, folder


def to_json(report: MissionReport) -> bytes:
    """One JSON document."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n"


def print_mission(console: Console, report: MissionReport) -> None:
    """Figures per robot, then the findings, then the verdict."""
    table = Table(
        title=f"{report.fleet}: mission of {report.seconds:.1f} s ({report.method})",
        title_justify="left",
    )
    for heading in ("robot", "path", "top speed", "steering", "least seen"):
        table.add_column(heading, justify="left" if heading == "robot" else "right")
    for name, robot in report.robots.items():
        table.add_row(
            name,
            f"{robot.length_m:.1f} m",
            f"{robot.speed_max_mps:.2f} m/s",
            f"{robot.steering_max_rad:.3f} rad",
            str(robot.least_seen),
        )
    console.print(table)
    for name, robot in report.robots.items():
        _line(console, f"{name}: {robot.weakest}")
    for finding in report.findings:
        _line(console, f"- {finding}")
    console.print(f"mission: [bold {'green' if report.ok else 'red'}]{_verdict(report)}[/]")


def _line(console: Console, text: str) -> None:
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def _verdict(report: MissionReport) -> str:
    errors = sum(finding.severity == "error" for finding in report.findings)
    warnings = len(report.findings) - errors
    return f"{'good' if report.ok else 'not good'}, {errors} errors, {warnings} warnings"
