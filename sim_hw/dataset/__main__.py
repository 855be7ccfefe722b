"""`python -m sim_hw.dataset`: one recorded robot's devices on a simulated bus, in real time.

The recording begins when the robot's computer first speaks; until then the devices report a robot
that stands. `echelon dataset --realtime` starts this.
"""

import argparse
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import zenoh

from config import topics
from config.can.database import CanDatabase, DatabaseMismatch
from config.fleet import Fleet
from config.loader import FleetFileError, load_fleet
from config.messages import Truth, encode
from config.realtime import request_realtime
from config.runtime import expand_channel
from config.zenoh_settings import session_config
from sim_hw.dataset.devices import PlaybackRobot
from sim_hw.dataset.mrclam import DataSetError, read_recording
from sim_hw.simcan.server import ChannelError, SimCanServer
from sim_hw.timing import Cycle

BAD_INPUT = 2
PERIOD_S = 0.002
TRUTH_PERIOD_S = 0.05
LISTEN = "tcp/127.0.0.1:0"


def main(arguments: Sequence[str] | None = None) -> int:
    """Play until SIGTERM or SIGINT; returns the exit code: 0 clean, 2 bad input."""
    parser = argparse.ArgumentParser(prog="python -m sim_hw.dataset", description=__doc__)
    parser.add_argument("--fleet", required=True, help="fleet file with the recorded robot")
    parser.add_argument("--data", required=True, type=Path, help="folder of the data set")
    parser.add_argument("--robot", required=True, type=int, help="number in the data set")
    options = parser.parse_args(arguments)
    try:
        _play(load_fleet(options.fleet).fleet, options.data, options.robot)
    except (FleetFileError, DataSetError, DatabaseMismatch, ChannelError, zenoh.ZError) as error:
        print(f"dataset: {error}", file=sys.stderr)
        return BAD_INPUT
    return 0


def _play(fleet: Fleet, data: Path, number: int) -> None:
    name = f"r{number}"
    if name not in fleet.robots:
        raise DataSetError(f"the fleet has no robot {name}; it has {', '.join(fleet.robots)}")
    stop_signals: list[int] = []
    for signal_number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(signal_number, lambda received, _: stop_signals.append(received))
    recording, database = read_recording(data, number), CanDatabase.load()
    settings = zenoh.Config.from_json5(session_config(LISTEN, [fleet.ground]))
    with SimCanServer(Path(expand_channel(fleet, name))) as bus, zenoh.open(settings) as session:
        robot = PlaybackRobot(fleet.robots[name], recording, database, time.monotonic())
        truth = session.declare_publisher(topics.TRUTH.key(fleet.name, name))
        token = session.liveliness().declare_token(topics.liveliness_key(fleet.name, "sim"))
        refusal = request_realtime(fleet.simulation.realtime_priority)
        if refusal is not None:
            print(f"dataset: no real-time priority: {refusal}", file=sys.stderr)
        _run(robot, bus, lambda message: truth.put(encode(message)), name, stop_signals)
        token.undeclare()


def _run(
    robot: PlaybackRobot,
    bus: SimCanServer,
    publish: Callable[[Truth], object],
    name: str,
    stop_signals: list[int],
) -> None:
    """Serve the bus every 2 ms, and at once when the host speaks."""
    truth_cycle, seq = Cycle(time.monotonic(), TRUTH_PERIOD_S), 0
    while not stop_signals:
        select.select(bus.filenos(), [], [], PERIOD_S)
        t_s, wall_s = time.monotonic(), time.time()
        robot.advance(t_s)
        for frame in bus.receive(t_s, wall_s):
            robot.deliver(frame)
        for frame in robot.collect():
            bus.send(frame, wall_s + frame.t_s - t_s)
        if truth_cycle.due(t_s):
            publish(_truth(robot, name, seq, wall_s - t_s))
            seq += 1


def _truth(robot: PlaybackRobot, name: str, seq: int, wall_minus_monotonic_s: float) -> Truth:
    """Motion capture as it is played; `valid` from the recording's start on.

    Its first valid message carries the time of that start.
    """
    truth = robot.truth
    return Truth(
        seq=seq,
        t_ns=round(truth.t_s * 1e9),
        wall_ns=round((truth.t_s + wall_minus_monotonic_s) * 1e9),
        valid=robot.started_s is not None,
        robot=name,
        x_m=truth.x_m,
        y_m=truth.y_m,
        heading_rad=truth.heading_rad,
        steering_rad=truth.steering_rad,
        speed_mps=truth.speed_mps,
    )


if __name__ == "__main__":
    sys.exit(main())
