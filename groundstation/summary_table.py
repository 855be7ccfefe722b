"""The summary of a run as a table for people."""

from rich.console import Console
from rich.table import Table

from config.fleet import Acceptance
from groundstation.summary import Summary


def print_summary(console: Console, judged: Summary, bars: Acceptance) -> None:
    """Verdict, errors against their limits, and the reasons for a failure."""
    passed = judged.verdict == "pass"
    table = Table(
        title=f"{judged.fleet}, {judged.mission.mode}, seed {judged.mission.seed}: "
        f"{judged.mission.seconds_judged:.1f} s judged from {judged.mission.from_s:g} s on",
        title_justify="left",
    )
    for heading in ("what", "value", "limit"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for what, value, limit, unit in judged_rows(judged, bars):
        shown = "none" if value is None else f"{value:.4f} {unit}"
        table.add_row(what, shown, "" if limit is None else f"{limit:g} {unit}")
    console.print(table)
    for reason in judged.why:
        console.print(f"- {reason}", highlight=False, markup=False, soft_wrap=True)
    console.print(f"verdict: [bold {'green' if passed else 'red'}]{judged.verdict}[/]")


def judged_rows(
    judged: Summary, bars: Acceptance
) -> list[tuple[str, float | None, float | None, str]]:
    """What, value, bar (None where it is not judged by it) and unit of every judged quantity."""
    rows: list[tuple[str, float | None, float | None, str]] = []
    for name, error in judged.followers.items():
        by_place = judged.mission.law[name] == "leader_frame"
        seen = (None, None) if by_place else (bars.range_rms_m, bars.bearing_rms_rad)
        rows += [
            (
                f"{name} position error (RMS)",
                error.position_rms_m,
                bars.position_rms_m if by_place else None,
                "m",
            ),
            (f"{name} range error (RMS)", error.range_rms_m, seen[0], "m"),
            (f"{name} bearing error (RMS)", error.bearing_rms_rad, seen[1], "rad"),
        ]
    rows += [
        ("leader's pose estimate (RMS)", judged.leader.position_rmse_m, bars.leader_rmse_m, "m"),
        ("smallest distance", judged.min_distance_m, bars.min_distance_m, "m"),
    ]
    for name, loop in judged.loop.items():
        rows.append((f"{name} loop, 99th percentile", loop.p99_ms, None, "ms"))
    return rows
