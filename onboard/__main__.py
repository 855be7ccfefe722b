"""`echelon-onboard`: one robot. Wiring and the loop, nothing else."""

import argparse
import contextlib
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from config.can.database import CanDatabase, DatabaseMismatch
from config.fleet import Fleet
from config.loader import FleetFileError, expand_channel, load_fleet, resolve_fleet
from config.realtime import request_realtime
from config.runtime import expand_placeholders
from onboard.canbus.black_box import BlackBox
from onboard.canbus.port import BusUnavailable, CanPort
from onboard.link import Link, LinkUnavailable
from onboard.loop import run
from onboard.robot import Robot
from onboard.step_record import StepRecorder
from onboard.timing import LoopStatistics

BAD_INPUT = 2
EXAMPLE = "example: echelon-onboard --fleet hardware.yaml --robot r2"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one robot until SIGTERM or SIGINT; returns the process's exit code."""
    options = _parser().parse_args(arguments)
    try:
        _drive(options.fleet, options.robot, options.seed)
    except (FleetFileError, DatabaseMismatch, BusUnavailable, LinkUnavailable) as error:
        print(f"echelon-onboard: {error}", file=sys.stderr)
        return BAD_INPUT
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="echelon-onboard", description="One robot of a fleet.", epilog=EXAMPLE
    )
    parser.add_argument("--fleet", required=True, help="fleet file, or a shipped fleet's name")
    parser.add_argument("--robot", required=True, help="this robot's name in the fleet file")
    parser.add_argument("--seed", type=int, default=0, help="of the particle filter (default 0)")
    return parser


def _drive(fleet_name: str, name: str, seed: int) -> None:
    fleet = load_fleet(resolve_fleet(fleet_name)).fleet
    if name not in fleet.robots:
        known = ", ".join(fleet.robots)
        raise FleetFileError(f"{fleet_name}: no robot {name!r}; the fleet has {known}")
    settings = fleet.robots[name]
    can, channel = settings.can, expand_channel(fleet, name)
    robot = Robot(fleet, name, CanDatabase.load(), seed)
    record = StepRecorder(fleet, name, seed)
    stop_signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: stop_signals.append(received))
    with (
        _black_box(fleet, name) as black_box,
        contextlib.closing(CanPort.open(can.interface, channel, can.bitrate, black_box)) as port,
        Link(fleet, name) as link,
    ):
        refusal = request_realtime(settings.loop.realtime_priority)
        statistics = LoopStatistics(realtime=refusal is None)
        if refusal is not None:
            print(f"{name}: no real-time priority: {refusal}", file=sys.stderr)
        print(f"{name}: up on {can.interface} {channel}", file=sys.stderr)
        period_s = 1.0 / settings.loop.rate_hz
        run(robot, port, link, period_s, statistics, black_box, record, lambda: bool(stop_signals))
        health = statistics.health
        print(
            f"{name}: {health.cycles} cycles, {health.overruns} overruns, "
            f"wake-up lateness p99 {health.late_p99_ms:.2f} ms",
            file=sys.stderr,
        )


@contextlib.contextmanager
def _black_box(fleet: Fleet, name: str) -> Iterator[BlackBox | None]:
    """The log of all frames, where the fleet file names a folder for it."""
    settings = fleet.robots[name].black_box
    if settings.folder is None:
        yield None
        return
    folder = Path(expand_placeholders(settings.folder, fleet, name))
    try:
        box = BlackBox(folder, name, settings.file_mb, settings.files)
    except OSError as error:
        raise FleetFileError(f"black_box.folder {folder}: cannot be written: {error}") from error
    with contextlib.closing(box):
        yield box


if __name__ == "__main__":
    sys.exit(main())
