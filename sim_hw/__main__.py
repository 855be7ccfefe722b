"""`echelon-sim`: simulated hardware for the robots of a fleet. Wiring, nothing else."""

import argparse
import contextlib
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import zenoh

from config import topics
from config.can.database import CanDatabase, DatabaseMismatch
from config.fault_script import load_faults
from config.faults import FaultScript
from config.fleet import Fleet
from config.loader import FleetFileError, load_fleet, resolve_fleet
from config.realtime import request_realtime
from config.runtime import expand_channel
from config.zenoh_settings import session_config
from sim_hw.fleet import SimulatedFleet
from sim_hw.live_faults import LiveFaults
from sim_hw.serve import Buses, Publisher, run
from sim_hw.simcan.server import ChannelError, SimCanServer

BAD_INPUT = 2
INTERFACE = "simcan"
LISTEN = "tcp/127.0.0.1:0"
EXAMPLE = "example: echelon-sim --fleet demo --robots r1,r2 --seed 7"


class BadRequest(Exception):
    """What was asked for cannot be simulated; the text says why and what to do."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until SIGTERM or SIGINT; returns the exit code: 0 clean, 2 bad input."""
    options = _parser().parse_args(arguments)
    try:
        fleet = load_fleet(resolve_fleet(options.fleet)).fleet
        names = _chosen(fleet, options.robots)
        script = load_faults(options.faults, names) if options.faults else None
        _simulate(fleet, names, options.seed, options.ground or fleet.ground, script)
    except (FleetFileError, DatabaseMismatch, BadRequest, ChannelError, zenoh.ZError) as error:
        _say(str(error))
        return BAD_INPUT
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="echelon-sim", description="Simulated hardware for a fleet.", epilog=EXAMPLE
    )
    parser.add_argument("--fleet", required=True, help="fleet file, or a shipped fleet's name")
    parser.add_argument("--robots", help="names, separated by commas (default: all of the fleet)")
    parser.add_argument("--seed", type=int, default=0, help="of all noise and errors (default 0)")
    parser.add_argument("--ground", help="ground station's endpoint (default: the fleet file's)")
    parser.add_argument("--faults", type=Path, help="file of scripted faults (docs/faults.md)")
    return parser


def _chosen(fleet: Fleet, wanted: str | None) -> list[str]:
    """Names of the robots to simulate, in the fleet's order. Raises BadRequest."""
    names = list(fleet.robots) if wanted is None else wanted.split(",")
    if unknown := [name for name in names if name not in fleet.robots]:
        raise BadRequest(
            f"no robot {', '.join(unknown)} in fleet {fleet.name}; it has {', '.join(fleet.robots)}"
        )
    for name in names:
        interface = fleet.robots[name].can.interface
        if interface != INTERFACE:
            raise BadRequest(
                f"robot {name} is on CAN interface {interface}, and only {INTERFACE} can be "
                "simulated; change its `can.interface`, or leave it out with --robots"
            )
    return [name for name in fleet.robots if name in names]


def _simulate(
    fleet: Fleet, names: Sequence[str], seed: int, ground: str, script: FaultScript | None
) -> None:
    stop_signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: stop_signals.append(received))
    database = CanDatabase.load()
    settings = zenoh.Config.from_json5(session_config(LISTEN, [ground]))
    with _served(fleet, names) as servers, zenoh.open(settings) as session:
        simulated = SimulatedFleet(fleet, seed, time.monotonic(), database, names)
        buses = Buses(simulated, servers)
        if script is not None:
            simulated.play(script)
        publisher = Publisher(session, fleet.name, simulated.robots)
        live = LiveFaults(session, fleet.name, names, simulated)
        token = session.liveliness().declare_token(topics.liveliness_key(fleet.name, "sim"))
        _say(f"serving {', '.join(names)} of fleet {fleet.name}, seed {seed}")
        refusal = request_realtime(fleet.simulation.realtime_priority)
        if refusal is not None:
            _say(f"no real-time priority: {refusal}")
        lateness = run(buses, publisher, live, lambda: bool(stop_signals), _say)
        token.undeclare()
        _say(f"{lateness}; {buses.dropped} frames lost to clients that did not read")


@contextlib.contextmanager
def _served(fleet: Fleet, names: Sequence[str]) -> Iterator[dict[str, SimCanServer]]:
    """The robots' buses, open; their sockets are removed at the end."""
    with contextlib.ExitStack() as stack:
        yield {
            name: stack.enter_context(SimCanServer(Path(expand_channel(fleet, name))))
            for name in names
        }


def _say(text: str) -> None:
    print(f"echelon-sim: {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
