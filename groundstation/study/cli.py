"""`echelon study`: the paper's section 4 and Monte-Carlo studies of the estimators."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from groundstation.exits import NOT_GOOD, bad_input_told, signals_end_it

Json = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
Seeds = Annotated[int, typer.Option("--seeds", min=1, help="Runs per row, seeds 1 to N.")]


class FigureName(StrEnum):
    """A figure of the paper's section 4."""

    FIGURE4 = "figure4"
    FIGURE5 = "figure5"


study_app = typer.Typer(
    help="Monte-Carlo studies against theory: the paper's section 4 (`echelon study paper`), the "
    "estimators' bounds.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@study_app.callback()
def _study() -> None:
    """Keeps `echelon study` a group however many studies there are."""


@study_app.command(epilog="Example: echelon study localiser --seeds 100 --landmarks 2 3 4 --json")
def localiser(
    seeds: Seeds = 100,
    kind: Annotated[str, typer.Option(metavar="gaussian|particle", help="Of localiser.")] = (
        "gaussian"
    ),
    landmarks: Annotated[
        list[int] | None,
        typer.Option(min=0, max=4, metavar="N ...", help="How many of them; default: 2 3 4."),
    ] = None,
    more: Annotated[list[int] | None, typer.Argument(min=0, max=4, hidden=True)] = None,
    json: Json = False,
) -> None:
    """Position error of a localiser on the paper's scenario against the bound. Core alone."""
    with bad_input_told(json), signals_end_it(kept="nothing is left behind"):
        from rich.console import Console

        from groundstation.study.localiser import kind_of, print_localiser, study_localiser

        counts = sorted({*(landmarks or ()), *(more or ())}) or [2, 3, 4]
        report = study_localiser(kind_of(kind), counts, seeds, Console(stderr=True))
        if json:
            _write_json(report)
        else:
            print_localiser(Console(), report)
    raise typer.Exit(0 if report.ok else NOT_GOOD)


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


@study_app.command(epilog="Example: echelon study paper --seeds 100 --out runs/paper --resume")
def paper(
    seeds: Seeds = 100,
    out: Annotated[Path, typer.Option(help="Folder for results, figures and tables.")] = Path(
        "runs/study-paper"
    ),
    only: Annotated[
        FigureName | None, typer.Option(help="One of the two figures; default: both.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the results in the folder.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; default: one per core.")
    ] = None,
    json: Json = False,
) -> None:
    """Section 4 of the paper: figures 4 and 5 as PNG and PDF, and a table with the bounds."""
    with bad_input_told(json), signals_end_it(kept="finished runs are kept, go on with --resume"):
        from rich.console import Console

        from groundstation.study.paper_study import Options, run_paper
        from groundstation.study.table import to_json, to_markdown

        console = Console(stderr=True)
        table = run_paper(Options(seeds, out, only, resume, console, workers))
        typer.echo(to_json(table).decode() if json else to_markdown(table), nl=not json)
        if not json:
            typer.echo(f"results: {out}")


@study_app.command(epilog="Example: echelon study errata --literal-y3 --euler")
def errata(
    literal_y3: Annotated[bool, typer.Option("--literal-y3", help="y3(0) = +0.8.")] = False,
    fork_rate_input: Annotated[
        bool, typer.Option("--fork-rate-input", help="omega of (3) as the yaw rate of (29).")
    ] = False,
    euler: Annotated[bool, typer.Option("--euler", help="Forward Euler.")] = False,
    five_quarter_pi: Annotated[
        bool, typer.Option("--five-quarter-pi", help="phi = 5 pi/4 from the forward axis.")
    ] = False,
    paper_gains: Annotated[
        bool, typer.Option("--paper-gains", help="k1 = 0.25, k2 = 0.10.")
    ] = False,
    json: Json = False,
) -> None:
    """What each erratum of the paper does, in one number against the corrected version.

    Without options all experiments run, also those that have no option. Core alone, under a minute.
    """
    chosen = {
        "literal-y3": literal_y3,
        "fork-rate-input": fork_rate_input,
        "euler": euler,
        "five-quarter-pi": five_quarter_pi,
        "paper-gains": paper_gains,
    }
    with bad_input_told(json), signals_end_it(kept="nothing is left behind"):
        from groundstation.study.errata import EXPERIMENTS, ErrataReport, effects

        names = [name for name, wanted in chosen.items() if wanted] or list(EXPERIMENTS)
        found = []
        for effect in effects(names):
            found.append(effect)
            if not json:
                typer.echo(effect.line())
        if json:
            _write_json(ErrataReport("core alone", {each.name: each for each in found}))


def _write_json(report: msgspec.Struct) -> None:
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(report), indent=2).decode() + "\n")
