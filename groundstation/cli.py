"""`echelon`: the operator's command line. Reports go to standard output, the rest to stderr."""

import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from groundstation.exits import NOT_GOOD, bad_input_told, signals_end_it
from groundstation.recording_cli import add_commands
from groundstation.study.cli import study_app

if TYPE_CHECKING:
    from rich.console import Console

    from config.fleet import Fleet
    from groundstation.fleet_commands import CommandName, CommandReport, StatusReport

app = typer.Typer(
    help="Formation driving of car-like robots: run, watch and command a fleet.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(study_app, name="study")
add_commands(app)

FleetName = Annotated[
    str, typer.Option("--fleet", metavar="FLEET", help="Shipped fleet (demo, paper, ...) or file.")
]
Ground = Annotated[
    str | None,
    typer.Option(
        "--ground", metavar="ENDPOINT", help="Instead of the fleet's own, e.g. tcp/127.0.0.1:7448."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]


def main() -> None:
    """Console script."""
    app()


@app.callback(invoke_without_command=True)
def _root(
    show_version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if show_version:
        typer.echo(f"echelon {version('echelon')}")
        raise typer.Exit


@app.command(epilog="Example: echelon demo --fleet paper --seed 3 --out runs/first")
def demo(
    fleet: FleetName = "demo",
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="One process, virtual time, reproducible.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of all noise.")] = 1,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results; default: one under runs/.")
    ] = None,
    faults: Annotated[
        Path | None, typer.Option(help="Scripted faults of the simulated hardware (YAML).")
    ] = None,
    ground: Ground = None,
    json: Json = False,
) -> None:
    """Run a whole fleet on simulated hardware, record it and judge it."""
    with bad_input_told(json), signals_end_it():
        from groundstation.demo import Options, run_demo
        from groundstation.summary import to_json
        from groundstation.summary_table import print_summary

        console = _stderr()
        loaded = _load(fleet, ground)
        folder, judged = run_demo(Options(loaded, seed, lockstep, out, console, faults))
        if json:
            sys.stdout.write(to_json(judged).decode())
        else:
            from rich.console import Console

            print_summary(Console(), judged, loaded.mission.acceptance)
            typer.echo(f"results: {folder.path}")
    raise typer.Exit(0 if judged.verdict == "pass" else NOT_GOOD)


@app.command(epilog="Example: echelon dataset ../shared/data/mrclam6 --robot all --json")
def dataset(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of a MRCLAM data set, plain or .xz.")
    ],
    robot: Annotated[str, typer.Option(metavar="N|all", help="Which robot's recording.")] = "all",
    start: Annotated[
        str,
        typer.Option(metavar="known|unknown", help="Whether the robot is told where it starts."),
    ] = "known",
    follow: Annotated[
        str | None,
        typer.Option(metavar="F:L", help="Also let robot F estimate where robot L is, e.g. 2:1."),
    ] = None,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Real processes in real time, not lockstep.")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(min=1.0, help="Play only so much of each recording.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the pictures; default: one under runs/.")
    ] = None,
    json: Json = False,
) -> None:
    """Play real robots' recordings, bearings only, to onboard robots; judge by motion capture."""
    with bad_input_told(json), signals_end_it():
        from groundstation.dataset import Options, run_dataset
        from groundstation.dataset_fleet import start_kind
        from groundstation.dataset_report import print_report, to_json

        console = _stderr()

        def say(text: str) -> None:
            console.print(text, highlight=False, markup=False, soft_wrap=True)

        def progress(name: str, played_s: float) -> None:
            if console.is_terminal:
                console.print(f"{name}: {played_s:.0f} s played", end="\r", highlight=False)

        report = run_dataset(
            Options(folder, robot, start_kind(start), follow, realtime, seconds, out, say, progress)
        )
        if json:
            sys.stdout.write(to_json(report))
        else:
            from rich.console import Console

            print_report(Console(), report)
            typer.echo(f"results: {report.results}")
    raise typer.Exit(0 if report.verdict == "pass" else NOT_GOOD)


@app.command(epilog="Example: echelon doctor --mission --fleet demo --out runs/check")
def doctor(
    mission: Annotated[
        bool, typer.Option("--mission", help="Examine the planned mission of the fleet file.")
    ] = False,
    fleet: FleetName = "demo",
    out: Annotated[
        Path | None, typer.Option(help="Folder for map and report; default: one under runs/.")
    ] = None,
    json: Json = False,
) -> None:
    """Examine a mission before it starts: what will be seen, and whether it can be driven."""
    with bad_input_told(json):
        from groundstation.errors import GroundError

        if not mission:
            raise GroundError("nothing to examine: say --mission")
        from groundstation.doctor import examine_mission, print_mission, to_json

        report, folder = examine_mission(_load(fleet, None), out)
        if json:
            sys.stdout.write(to_json(report).decode())
        else:
            from rich.console import Console

            print_mission(Console(), report)
            typer.echo(f"map and report: {folder}")
    raise typer.Exit(0 if report.ok else NOT_GOOD)


@app.command(epilog="Example: echelon status --fleet demo --json")
def status(fleet: FleetName = "demo", ground: Ground = None, json: Json = False) -> None:
    """Show what every robot of a running fleet says of itself."""
    with bad_input_told(json):
        from groundstation import fleet_commands

        report = fleet_commands.status(_load(fleet, ground))
        _write(report, json)
    raise typer.Exit(0 if report.ok else NOT_GOOD)


@app.command(epilog="Example: echelon monitor --fleet demo --port 8081")
def monitor(
    fleet: FleetName = "demo",
    host: Annotated[
        str,
        typer.Option(help="Address to serve on; any but loopback needs the printed token."),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes a free one.")] = 8080,
    token: Annotated[
        str | None, typer.Option(help="Needed to command; default: made where needed.")
    ] = None,
    ground: Ground = None,
) -> None:
    """Serve the live page of a fleet: map, health, plots, events, commands."""
    with bad_input_told(False), signals_end_it("the page is closed, the robots go on"):
        from groundstation.web.monitor import monitor as serve
        from groundstation.web.server import Listen

        serve(_load(fleet, ground), Listen(host, port, token), lambda text: typer.echo(text))


@app.command(epilog="Example: echelon formation wide --fleet demo")
def formation(
    name: Annotated[str, typer.Argument(help="One of those in the fleet file, or default.")],
    fleet: FleetName = "demo",
    ground: Ground = None,
    json: Json = False,
) -> None:
    """Change to another formation of the fleet file, while driving too."""
    _command("formation", fleet, ground, json, formation=name)


@app.command(epilog="Example: echelon arm --fleet demo")
def arm(
    fleet: FleetName = "demo",
    override: Annotated[
        list[str] | None,
        typer.Option(metavar="CHECK", help="Leave a check aside, where the fleet file allows it."),
    ] = None,
    ground: Ground = None,
    json: Json = False,
) -> None:
    """Arm every robot of a running fleet."""
    _command("arm", fleet, ground, json, override or ())


@app.command(epilog="Example: echelon start --fleet demo")
def start(fleet: FleetName = "demo", ground: Ground = None, json: Json = False) -> None:
    """Start the mission: followers first, then the leader."""
    _command("start", fleet, ground, json)


@app.command(epilog="Example: echelon stop --fleet demo")
def stop(fleet: FleetName = "demo", ground: Ground = None, json: Json = False) -> None:
    """Bring every robot to a controlled stop."""
    _command("stop", fleet, ground, json)


@app.command(epilog="Example: echelon reset --fleet demo")
def reset(fleet: FleetName = "demo", ground: Ground = None, json: Json = False) -> None:
    """Clear the faults and emergency stops of every robot whose cause is gone."""
    _command("reset", fleet, ground, json)


@app.command("at-start", epilog="Example: echelon at-start --fleet demo")
def at_start(fleet: FleetName = "demo", ground: Ground = None, json: Json = False) -> None:
    """Tell every robot that it was carried back to its start: its estimate begins anew there."""
    _command("at_start", fleet, ground, json)


@app.command(epilog="Example: echelon estop --fleet demo")
def estop(fleet: FleetName = "demo", ground: Ground = None, json: Json = False) -> None:
    """Emergency stop: repeated until every robot reports it."""
    with bad_input_told(json):
        from groundstation import fleet_commands

        report = fleet_commands.estop(_load(fleet, ground))
        _write(report, json)
    raise typer.Exit(0 if report.ok else NOT_GOOD)


@app.command(epilog="Example: echelon fault r2 bearing stuck --for 2s")
def fault(
    robot: Annotated[str, typer.Argument(help="Name of a simulated robot.")],
    device: Annotated[str, typer.Argument(help="steering, drive, encoder, bearing or bus.")],
    kind: Annotated[str, typer.Argument(help="What befalls it (docs/faults.md); ok ends all.")],
    for_: Annotated[
        str | None, typer.Option("--for", metavar="TIME", help="2s, 500ms; default: for ever.")
    ] = None,
    value: Annotated[float | None, typer.Option(help="How much; default: the kind's own.")] = None,
    fleet: FleetName = "demo",
    ground: Ground = None,
    json: Json = False,
) -> None:
    """Inject a fault into the simulated hardware of a running fleet."""
    with bad_input_told(json):
        from config.faults import Fault
        from groundstation import fault_command

        for_s = None if for_ is None else fault_command.seconds(for_)
        wanted = Fault(robot=robot, device=device, kind=kind, for_s=for_s, value=value)
        report = fault_command.inject(_load(fleet, ground), wanted)
        typer.echo(fault_command.to_json(report) if json else fault_command.to_text(report))
    raise typer.Exit(0 if report.ok else NOT_GOOD)


def _command(
    name: "CommandName",
    fleet: str,
    ground: str | None,
    json: bool,
    override: Sequence[str] = (),
    formation: str = "",
) -> None:
    with bad_input_told(json):
        from groundstation import fleet_commands

        report = fleet_commands.command(_load(fleet, ground), name, override, formation)
        _write(report, json)
    raise typer.Exit(0 if report.ok else NOT_GOOD)


def _load(name: str, ground: str | None) -> "Fleet":
    from config.loader import load_fleet, resolve_fleet, warnings
    from groundstation.endpoints import host_and_port

    fleet = load_fleet(resolve_fleet(name)).fleet
    for text in warnings(fleet):
        typer.echo(f"warning: {text}", err=True)
    if ground is None:
        return fleet
    host_and_port(ground)
    return fleet.model_copy(update={"ground": ground})


def _stderr() -> "Console":
    from rich.console import Console

    return Console(stderr=True)


def _write(report: "CommandReport | StatusReport", json: bool) -> None:
    from groundstation import fleet_commands

    typer.echo(fleet_commands.to_json(report) if json else fleet_commands.to_text(report))
