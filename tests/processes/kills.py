"""`python -m tests.processes.kills`: signals to real processes at random times, judged on truth.

Every round has its own fleet and its own seed, so that it can be run again (`--round 7`). A killed,
ended or hanging process of the bench is followed by what an operator does: stop who still drives.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from config.fleet import Fleet, Segment
from config.loader import load_fleet, shipped_fleet_path
from tests.processes.bench import Bench
from tests.processes.running import demo, processes_with, write_fleet

ROUNDS = 30
TARGETS = ("r1", "r2", "sim", "demo")
SIGNALS = (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM)
STOPPED_S = 5.0
SILENCE_S = 0.2
"""Until a missing message counts, or a drive's watchdog ends."""
STOP_S = 1.0
"""A stop takes no longer; but nothing brakes a wheel that was let go, which coasts."""
COASTING_MPS2 = 1.5
"""Of the emulated wheel: from more than 1.5 m/s it coasts for more than STOP_S."""
SLACK_S = 0.15
WATCH_S = 2.0
COMMAND_BOUND_S = 1.5
EXIT_CODES = {
    signal.SIGKILL: (-signal.SIGKILL,),
    signal.SIGTERM: (128 + signal.SIGTERM,),
    signal.SIGSTOP: (1, 128 + signal.SIGTERM),
}
"""Of a demo. One that was blind for 5 s may go on, or stop the robots and call the run failed."""
QUIET_S = 1.5
"""Nothing may start to move for so long afterwards."""
END_LIMIT_S = 20.0
ATTEMPTS = 3
NEVER_DROVE = "never drove"
"""A demo ends at the first stall of a busy machine, even before it has begun to drive."""
AT_REST = ("STANDBY", "FAULT", "ESTOP")


class Round(NamedTuple):
    """One round: who gets which signal, after how long a drive."""

    number: int
    target: str
    signal: signal.Signals
    after_s: float


class Outcome(NamedTuple):
    """What happened: how long robots went on moving [s], what they said, what was wrong."""

    round: Round
    stopped_s: dict[str, float]
    reasons: dict[str, str]
    problems: list[str]


def plan(seed: int, number: int) -> Round:
    """The round of this number: all pairs in turn, times at random."""
    rng = np.random.default_rng([seed, number])
    target = TARGETS[number % len(TARGETS)]
    kind = SIGNALS[number // len(TARGETS) % len(SIGNALS)]
    return Round(number, target, kind, round(float(rng.uniform(0.3, 4.0)), 2))


def circle() -> Fleet:
    """The demo fleet on a circle that outlasts every round."""
    fleet = load_fleet(shipped_fleet_path("demo")).fleet
    segment = Segment(duration_s=600.0, speed_mps=1.0, fork_rate_radps=-0.2618)
    return fleet.model_copy(
        update={"mission": fleet.mission.model_copy(update={"segments": [segment]})}
    )


def run_round(planned: Round) -> Outcome:
    """Run one round."""
    if planned.target != "demo":
        return _run_bench(planned)
    for _ in range(ATTEMPTS):
        outcome = _run_demo(planned)
        if NEVER_DROVE not in outcome.problems:
            break
    return outcome


def _run_bench(planned: Round) -> Outcome:
    problems: list[str] = []
    with Bench(circle()) as bench:
        for _ in range(ATTEMPTS):
            bench.drive()
            bench.watch(planned.after_s)
            if bench.all_in("RUNNING"):
                break
            bench.reset()
        if not bench.all_in("RUNNING"):
            return Outcome(planned, {}, bench.told(), [NEVER_DROVE])
        limits_s = {
            name: SILENCE_S + max(STOP_S, abs(track[-1][1]) / COASTING_MPS2 + SLACK_S)
            for name, track in bench.truth.items()
        }
        pid = bench.pid(planned.target)
        bench.poll()
        struck_s = time.monotonic()
        os.kill(pid, planned.signal)
        stopped_s, expected = _wait_for_rest(bench, planned, struck_s)
        if planned.signal is signal.SIGSTOP:
            bench.watch(max(0.0, struck_s + STOPPED_S - time.monotonic()))
            os.kill(pid, signal.SIGCONT)
            bench.watch(1.0)
        limits_s |= {name: STOP_S for name in bench.robots if name not in expected}
        problems += _judge(bench, planned, limits_s, stopped_s)
        reasons = bench.told()
        path = str(bench.path)
        began_s = time.monotonic()
    if time.monotonic() - began_s > END_LIMIT_S:
        problems.append("ending the processes took too long")
    problems += _left(path)
    return Outcome(planned, stopped_s, reasons, problems)


def _wait_for_rest(
    bench: Bench, planned: Round, struck_s: float
) -> tuple[dict[str, float], list[str]]:
    """Let the robots stop that must, then stop the others; returns how long each moved."""
    names = ["r1", "r2", "r3"]
    expected = names if planned.target == "sim" else names[names.index(planned.target) :]
    bench.watch(WATCH_S)
    stopped_s = {name: bench.moving_until_s(name, struck_s) for name in expected}
    for name in [name for name in names if name not in expected]:
        ordered_s = time.monotonic()
        bench.command(name, "stop")
        bench.watch(COMMAND_BOUND_S)
        stopped_s[name] = bench.moving_until_s(name, ordered_s)
    return stopped_s, expected


def _judge(
    bench: Bench, planned: Round, limits_s: dict[str, float], stopped_s: dict[str, float]
) -> list[str]:
    """Stood in time, said why, stays where it is, and obeys nobody without reset and arming."""
    problems = [
        f"{name} moved for {moved_s:.2f} s, limit {limits_s[name]:.2f} s"
        for name, moved_s in stopped_s.items()
        if moved_s > limits_s[name]
    ]
    dead = planned.target if planned.signal is not signal.SIGSTOP else None
    for name in (name for name in bench.robots if name != dead):
        status = bench.status(name)
        if status is None or status.state not in AT_REST:
            problems.append(f"{name} is {bench.state(name)!r}, not at rest")
        elif not status.reason or status.reason.startswith("start by"):
            problems.append(f"{name} gives no reason")
        elif bench.command(name, "start").accepted:
            problems.append(f"{name} starts again without being armed")
    quiet_from_s = time.monotonic()
    bench.watch(QUIET_S)
    problems += [
        f"{name} moves again" for name in bench.robots if bench.moving_until_s(name, quiet_from_s)
    ]
    return problems


def _run_demo(planned: Round) -> Outcome:
    """The ground station itself: its robots stop with it, or do not even notice."""
    problems: list[str] = []
    with tempfile.TemporaryDirectory(prefix="ech-") as folder:
        fleet, out = write_fleet(Path(folder), circle()), Path(folder) / "run"
        with demo(fleet, out) as running:
            deadline_s = time.monotonic() + 60.0
            while running.mission_time_s() < planned.after_s:
                if time.monotonic() > deadline_s or running.process.poll() is not None:
                    told = f"exit code {running.process.poll()}"
                    return Outcome(planned, {}, {"demo": told}, [NEVER_DROVE])
                time.sleep(0.01)
            running.process.send_signal(planned.signal)
            if planned.signal is signal.SIGSTOP:
                time.sleep(STOPPED_S)
                running.process.send_signal(signal.SIGCONT)
                told_s = running.mission_time_s()
                while running.mission_time_s() <= told_s and running.process.poll() is None:
                    time.sleep(0.01)
                running.process.send_signal(signal.SIGTERM)
            code = running.process.wait(END_LIMIT_S)
            codes = EXIT_CODES[planned.signal]
            if code not in codes:
                problems.append(f"exit code {code}, expected one of {codes}")
            reasons = {"demo": f"exit code {code}"}
            problems += _left(str(out))
    return Outcome(planned, {}, reasons, problems)


def _left(path: str) -> list[str]:
    """Processes that outlive their fleet."""
    deadline_s = time.monotonic() + 3.0
    while (left := processes_with(path)) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    return [f"still running: {left}"] if left else []


def main() -> int:
    """Run the rounds; returns 0 where nothing was wrong in any."""
    parser = argparse.ArgumentParser(prog="python -m tests.processes.kills", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--round", type=int, help="only this one")
    options = parser.parse_args()
    numbers = range(options.rounds) if options.round is None else [options.round]
    bad = 0
    for number in numbers:
        planned = plan(options.seed, number)
        outcome = run_round(planned)
        moved = ", ".join(f"{name} {s:.2f} s" for name, s in outcome.stopped_s.items())
        print(
            f"seed {options.seed} round {number}: {planned.signal.name} to {planned.target} after "
            f"{planned.after_s:.2f} s: moved on {moved or '-'}; {outcome.reasons}; "
            f"{outcome.problems or 'good'}",
            flush=True,
        )
        bad += bool(outcome.problems)
    print(f"{len(numbers)} rounds, {bad} with problems")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
