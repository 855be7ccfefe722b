"""How a command ends: exit codes, bad input told in one message, signals that end a run."""

import contextlib
import signal
from collections.abc import Iterator

import typer

from groundstation.errors import GroundError

NOT_GOOD, UNUSABLE, INTERRUPTED, TERMINATED = 1, 2, 130, 143


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP came: ends a run as Ctrl-C does."""


@contextlib.contextmanager
def bad_input_told(json: bool) -> Iterator[None]:
    """Say what is wrong in one message and end with code 2, instead of a traceback."""
    from config.loader import FleetFileError

    try:
        yield
    except (GroundError, FleetFileError) as error:
        typer.echo(f"echelon: {error}", err=True)
        if json:
            import msgspec

            typer.echo(msgspec.json.encode({"error": str(error)}).decode())
        raise typer.Exit(UNUSABLE) from error


@contextlib.contextmanager
def signals_end_it(
    kept: str = "everything is stopped, the recording is kept",
) -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block as Ctrl-C does; exit with the usual codes.

    `kept` tells what is left.
    SIGINT ends it too where a shell that put the command in the background had it ignored.
    """

    def terminate(number: int, _frame: object) -> None:
        raise Terminated(signal.Signals(number).name)

    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, terminate) for number in numbers}
    before[signal.SIGINT] = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    except Terminated as error:
        typer.echo(f"echelon: {error}: {kept}", err=True)
        raise typer.Exit(TERMINATED) from error
    except KeyboardInterrupt as error:
        typer.echo(f"echelon: interrupted: {kept}", err=True)
        raise typer.Exit(INTERRUPTED) from error
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
