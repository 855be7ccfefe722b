"""Kills recorders at random moments, recovers what they left and prints what is missing.

`python -m tests.recorder_kill --kills 20`. Each recorder is a process of its own that records 1000
messages per second with the recorder and the pump of `echelon record`.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from config.messages import Motion, encode
from config.topics import MOTION
from groundstation.heard import Heard
from groundstation.record_command import pump
from groundstation.recorder import About, Recorder
from groundstation.recording import read_messages
from groundstation.recovery import recover
from tests.groundstation.synthetic import fleet, motion

LIMIT_S = 0.6
RATE_HZ = 1000.0
EARLIEST_S, LATEST_S = 0.7, 2.5
READY = b"recording\n"
KEY = MOTION.key("pair", "r1")


class Killed(NamedTuple):
    """One killed recorder: time from the last recovered message to the kill, and the count."""

    missing_s: float
    recovered: int
    gaps: int


class Clockwork:
    """A message for every millisecond that has passed, stamped with that millisecond."""

    def __init__(self) -> None:
        self.unreadable: list[str] = []
        self._started_ns = time.time_ns()
        self._made = 0

    def poll(self) -> list[Heard]:
        """The messages whose time has come."""
        made: list[Heard] = []
        while (wall_ns := self._started_ns + round(self._made / RATE_HZ * 1e9)) <= time.time_ns():
            message = msgspec.structs.replace(
                motion("r1", "RUNNING", "", 0, 0.0), seq=self._made, t_ns=wall_ns, wall_ns=wall_ns
            )
            made.append(Heard(time.time(), KEY, encode(message), message))
            self._made += 1
        return made


def kill_one(path: Path, after_s: float) -> Killed:
    """Start a recorder, kill it `after_s` after it began to record, recover, and judge."""
    command = [sys.executable, "-m", "tests.recorder_kill", "--record", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as recorder:
        assert recorder.stdout is not None
        assert recorder.stdout.readline() == READY
        time.sleep(after_s)
        killed_ns = time.time_ns()
        recorder.send_signal(signal.SIGKILL)
    recover(path.with_name(path.name + ".active"))
    rows = [
        (each.wall_ns, msgspec.json.decode(each.payload, type=Motion).seq)
        for each in read_messages(path, [KEY])
    ]
    if not rows:
        return Killed(after_s, 0, 0)
    gaps = rows[-1][1] + 1 - len(rows)
    return Killed((killed_ns - rows[-1][0]) * 1e-9, len(rows), gaps)


def main(arguments: Sequence[str] | None = None) -> int:
    """Kill as many as asked for; 0 where nothing more than 0.6 s is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--record", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.record is not None:
        _record(options.record)
        return 0
    moments, found = random.Random(options.seed), []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.kills):
            after_s = moments.uniform(EARLIEST_S, LATEST_S)
            killed = kill_one(Path(folder) / f"{number}.mcap", after_s)
            found.append(killed)
            print(
                f"killed after {after_s:.2f} s: {killed.recovered} messages recovered, "
                f"{killed.gaps} missing in between, {killed.missing_s:.3f} s at the end"
            )
    worst_s = max(each.missing_s for each in found)
    good = worst_s <= LIMIT_S and all(each.gaps == 0 for each in found)
    print(f"worst of {len(found)}: {worst_s:.3f} s missing, limit {LIMIT_S} s")
    return 0 if good else 1


def _record(path: Path) -> None:
    with Recorder(path, fleet(), About(time.time_ns(), "processes", 0)) as recorder:
        print(READY.decode(), end="", flush=True)
        pump(Clockwork(), recorder, None, print)


if __name__ == "__main__":
    sys.exit(main())
