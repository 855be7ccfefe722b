"""How long an emergency stop takes from the operator to the drives' frames on the emulated bus.

`make estop-latency`: real processes, the robots driving; from the publication to the moment at
which the emulated bus takes the first e-stop frame of each drive. Two paths: the session of the
ground station that has started the robots, and a visitor that has just joined, which is what
`echelon estop` is.
"""

import argparse
import contextlib
import json
import os
import queue
import select
import sys
import threading
import time
from collections.abc import Iterator
from typing import Literal

import can

from config.can.database import CanDatabase
from config.fleet import Fleet
from groundstation.endpoints import with_real_port
from groundstation.fleet_link import ANY_LOOPBACK, FleetLink
from tests.processes.bench import Bench, percentile
from tests.soak.fleet import circling

LIMIT_MS = 20.0
ROUNDS = 110
TIMEOUT_S = 3.0
DRIVE_S = 0.4
PAUSE_S = 0.2
"""Setpoints further apart belong to two drives, not to one slow cycle."""
Path = Literal["ground station", "echelon estop"]
PATHS: tuple[Path, ...] = ("ground station", "echelon estop")


class Listener:
    """Hears the buses of all robots: e-stop frames, and the host's heartbeat."""

    def __init__(self, bench: Bench) -> None:
        database = CanDatabase.load()
        self.buses = {
            name: can.Bus(bench.fleet.robots[name].can.channel, "simcan", ignore_config=True)
            for name in bench.robots
        }
        self._estops = {
            name: [
                database.axis(axis.node).estop.can_id
                for axis in (robot.vehicle.steering, robot.vehicle.drive)
            ]
            for name, robot in bench.fleet.robots.items()
        }
        self._setpoint = {
            name: database.axis(robot.vehicle.drive.node).set_input_vel.can_id
            for name, robot in bench.fleet.robots.items()
        }

        self._ended = threading.Event()
        self._heard: queue.SimpleQueue[tuple[str, can.Message]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._hear, name="listener")
        self._thread.start()

    def close(self) -> None:
        """Leave the buses."""
        self._ended.set()
        self._thread.join()
        for bus in self.buses.values():
            bus.shutdown()

    def _hear(self) -> None:
        """Read all the time: a listener that does not loses frames."""
        while not self._ended.is_set():
            select.select(list(self.buses.values()), [], [], 0.05)
            for name, bus in self.buses.items():
                while (message := bus.recv(0)) is not None:
                    if message.arbitration_id in (*self._estops[name], self._setpoint[name]):
                        self._heard.put((name, message))

    def take(self) -> tuple[dict[tuple[str, int], float], list[float]]:
        """First e-stop per robot and drive [wall clock, s], and the intervals of setpoints."""
        first: dict[tuple[str, int], float] = {}
        intervals: list[float] = []
        last_s: dict[str, float] = {}
        while not self._heard.empty():
            name, message = self._heard.get()
            if message.arbitration_id in self._estops[name]:
                first.setdefault((name, message.arbitration_id), message.timestamp)
                continue
            if name in last_s and message.timestamp - last_s[name] < PAUSE_S:
                intervals.append(message.timestamp - last_s[name])
            last_s[name] = message.timestamp
        return first, intervals


class Measurement:
    """Latencies by path, and the robots' own cycle as it was meanwhile, in milliseconds."""

    def __init__(self) -> None:
        self.latencies_ms: dict[Path, list[float]] = {path: [] for path in PATHS}
        self.cycles_ms: list[float] = []


def fixed(fleet: Fleet) -> Fleet:
    """The fleet with a known endpoint for every robot, as on hardware: who joins goes there."""
    robots = {
        name: robot.model_copy(update={"listen": with_real_port(ANY_LOOPBACK)})
        for name, robot in fleet.robots.items()
    }
    return fleet.model_copy(update={"robots": robots})


def measure(rounds: int) -> Measurement:
    """So many emergency stops on each path, two robots with two drives each."""
    found = Measurement()
    with Bench(fixed(circling())) as bench, contextlib.closing(Listener(bench)) as listener:
        for number in range(rounds * len(PATHS)):
            path = PATHS[number % len(PATHS)]
            bench.drive()
            bench.watch(DRIVE_S)
            _, intervals = listener.take()
            found.cycles_ms += [1e3 * each for each in intervals]
            with _operator(bench, path) as link:
                pressed_s = time.time()
                reached = link.estop(TIMEOUT_S)
            assert all(reached.values()), f"not all in ESTOP: {reached}"
            first: dict[tuple[str, int], float] = {}
            wanted = 2 * len(bench.robots)

            def all_heard(first: dict[tuple[str, int], float] = first, n: int = wanted) -> bool:
                first.update({key: t for key, t in listener.take()[0].items() if key not in first})
                return len(first) == n

            bench.wait(all_heard, "an e-stop frame to every drive", TIMEOUT_S)
            found.latencies_ms[path] += [1e3 * (t_s - pressed_s) for t_s in first.values()]
            bench.reset()
    return found


@contextlib.contextmanager
def _operator(bench: Bench, path: Path) -> Iterator[FleetLink]:
    if path == "ground station":
        yield bench.link
        return
    with FleetLink.as_visitor(bench.fleet) as link:
        yield link


def main() -> int:
    """Measure and print; returns 0 where p99 is within the limit on every path."""
    parser = argparse.ArgumentParser(prog="python -m tests.estop_latency", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = measure(options.rounds)
    load = os.getloadavg()[0]
    rows = {path: _figures(values) for path, values in found.latencies_ms.items()}
    if options.json:
        print(json.dumps({"load": load, "limit_ms": LIMIT_MS, "paths": rows}))
    else:
        print(f"{os.cpu_count()} cores, load average {load:.1f}, limit p99 {LIMIT_MS:g} ms")
        for path, row in rows.items():
            print(f"{path:15}", "  ".join(f"{key} {value:.1f}" for key, value in row.items()))
        cycle = percentile(found.cycles_ms, 0.5), percentile(found.cycles_ms, 0.99)
        print(f"setpoints meanwhile: median {cycle[0]:.1f} ms apart, p99 {cycle[1]:.1f} ms")
    return int(any(row["p99"] > LIMIT_MS for row in rows.values()))


def _figures(values_ms: list[float]) -> dict[str, float]:
    shares = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
    figures = {name: percentile(values_ms, share) for name, share in shares.items()}
    return {"samples": float(len(values_ms)), **figures, "max": max(values_ms)}


if __name__ == "__main__":
    sys.exit(main())
