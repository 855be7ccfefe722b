"""Commands about recordings: record, recover, replay, report."""

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from groundstation.exits import NOT_GOOD, bad_input_told, signals_end_it

Json = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
Recording = Annotated[Path, typer.Argument(metavar="RUN.MCAP", help="A recording.")]
RECORD_EXAMPLE = "Example: echelon record --fleet hardware.yaml --out today.mcap"
RECOVER_EXAMPLE = "Example: echelon recover runs/first/run.mcap.active"
REPLAY_EXAMPLE = "Example: echelon replay --check runs/first/run.mcap"
REPORT_EXAMPLE = "Example: echelon report runs/first/run.mcap"


def record(
    fleet: Annotated[
        str, typer.Option("--fleet", metavar="FLEET", help="Shipped fleet or file.")
    ] = "demo",
    out: Annotated[
        Path | None, typer.Option(help="The recording; default: named after time and fleet.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="End after so long; default: on Ctrl-C.")
    ] = None,
    part_mb: Annotated[float, typer.Option(min=0.1, help="Begin a new file at this size.")] = 1000,
    keep_free_mb: Annotated[
        float, typer.Option(min=0.0, help="Leave this much of the disk free.")
    ] = 200,
    ground: Annotated[
        str | None, typer.Option("--ground", metavar="ENDPOINT", help="Instead of the fleet's own.")
    ] = None,
) -> None:
    """Record a running fleet: every message, every CAN frame, everything a replay needs."""
    with bad_input_told(False), signals_end_it("the recording is kept"):
        from config.loader import load_fleet, resolve_fleet
        from groundstation import record_command
        from groundstation.endpoints import host_and_port
        from groundstation.recorder import Limits
        from groundstation.recovery import save_left_behind

        def say(text: str) -> None:
            typer.echo(text, err=True)

        loaded = load_fleet(resolve_fleet(fleet)).fleet
        if ground is not None:
            host_and_port(ground)
            loaded = loaded.model_copy(update={"ground": ground})
        path = out or Path(f"{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}-{loaded.name}.mcap")
        for text in save_left_behind(path.parent):
            say(text)
        say(f"recording to {path}.active until it is ended")
        limits = Limits(part_mb, keep_free_mb)
        options = record_command.Options(loaded, path, seconds, limits, say)
        count = record_command.record(options)
        say(f"{count} messages in {path}")


def recover(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Unfinished or damaged recording.")],
    json: Json = False,
) -> None:
    """Make a whole recording of what is readable in an unfinished or damaged one."""
    with bad_input_told(json):
        import msgspec

        from groundstation import recovery

        recovered = recovery.recover(path)
        typer.echo(msgspec.json.encode(recovered).decode() if json else str(recovered))


def replay(
    path: Recording,
    check: Annotated[
        bool,
        typer.Option("--check", help="Run the recorded inputs through the onboard code again."),
    ] = False,
    host: Annotated[str, typer.Option(help="Address to serve the page on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes a free one.")] = 8080,
    json: Json = False,
) -> None:
    """Play a recording on the page; with --check, run it again and compare bit for bit."""
    with bad_input_told(json), signals_end_it("the recording is as it was"):
        if not check:
            from groundstation.replay_page import show
            from groundstation.web.server import Listen

            show(path, Listen(host, port), lambda text: typer.echo(text, err=True))
            return
        from groundstation import replay_check

        def progress(robot: str, step: int) -> None:
            if sys.stderr.isatty():
                typer.echo(f"{robot}: step {step}\r", err=True, nl=False)

        report = replay_check.check(path, progress)
        typer.echo(replay_check.to_json(report) if json else replay_check.to_text(report))
    raise typer.Exit(0 if report.ok else NOT_GOOD)


def report(
    paths: Annotated[
        list[Path], typer.Argument(metavar="RUN.MCAP [OTHER.MCAP]", help="One or two recordings.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for report.html and report.pdf; default: beside.")
    ] = None,
    json: Json = False,
) -> None:
    """Write one HTML file and a PDF about a run, or about two beside each other."""
    with bad_input_told(json), signals_end_it("the report is not complete"):
        import msgspec

        from groundstation.report import write_report

        written = write_report(paths, out)
        if json:
            typer.echo(msgspec.json.encode(written).decode())
        else:
            for run in written.runs:
                typer.echo(f"{run.recording}: {run.verdict}")
                for why in run.why:
                    typer.echo(f"- {why}")
            typer.echo(f"report: {written.html}, {written.pdf}")
    raise typer.Exit(0 if all(run.verdict == "pass" for run in written.runs) else NOT_GOOD)


def add_commands(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.command(epilog=RECORD_EXAMPLE)(record)
    app.command(epilog=RECOVER_EXAMPLE)(recover)
    app.command(epilog=REPLAY_EXAMPLE)(replay)
    app.command(epilog=REPORT_EXAMPLE)(report)
