"""`echelon study`: the paper's section 4 and Monte-Carlo studies of the estimators."""

import sys
from typing import Annotated

import msgspec
import typer

from groundstation.exits import NOT_GOOD, bad_input_told, signals_end_it

Json = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
Seeds = Annotated[int, typer.Option("--seeds", min=1, help="Runs per row, seeds 1 to N.")]

study_app = typer.Typer(
    help="Monte-Carlo studies against theory: the paper's section 4, the estimators' bounds.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@study_app.callback()
def _study() -> None:
    """Keeps `echelon study` a group however many studies there are."""


@study_app.command(epilog="Example: echelon study relative --seeds 50 --markers 1 --no-mutual")
def relative(
    seeds: Seeds = 50,
    markers: Annotated[int, typer.Option(min=1, max=2, help="Seen of each robot.")] = 2,
    mutual: Annotated[bool, typer.Option(help="Whether the leader sees the follower.")] = True,
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of the straight.")] = 60.0,
    json: Json = False,
) -> None:
    """Range of a follower to its leader on a long straight, with odometry scale errors."""
    with bad_input_told(json), signals_end_it():
        from rich.console import Console

        from groundstation.study.relative import Case, print_relative, study_relative

        report = study_relative(Case(markers, mutual, seconds), seeds, Console(stderr=True))
        if json:
            _write_json(report)
        else:
            print_relative(Console(), report)
    raise typer.Exit(0 if report.ok else NOT_GOOD)


@study_app.command(epilog="Example: echelon study direction --seeds 100 --json")
def direction(seeds: Seeds = 100, json: Json = False) -> None:
    """Direction-angle error of the paper's filter and of the default one, paper scenario."""
    with bad_input_told(json), signals_end_it():
        from rich.console import Console

        from groundstation.study.direction import print_direction, study_direction

        report = study_direction(seeds, Console(stderr=True))
        if json:
            _write_json(report)
        else:
            print_direction(Console(), report)
    raise typer.Exit(0 if report.ok else NOT_GOOD)


def _write_json(report: msgspec.Struct) -> None:
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(report), indent=2).decode() + "\n")
