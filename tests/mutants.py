"""`python -m tests.mutants`: break the safety code on purpose; the tests must notice every time.

Every mutant is one replacement in one file, made in a scratch copy of the packages, in which the
tests named run. A mutant whose text is not found exactly once fails loudly: the code has moved on.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
PACKAGES = ("config", "onboard", "sim_hw", "groundstation", "tests")
LIMIT_S = 600.0

GUARD = "onboard/safety/transmit_guard.py"
WINDOW = "onboard/safety/window_limit.py"
BUDGET = "onboard/safety/rate_budget.py"
FAILSAFE = "onboard/safety/failsafe.py"
TRIGGERS = "onboard/safety/triggers.py"
STATES = "onboard/safety/states.py"
SUPERVISION = "onboard/supervision.py"
ODRIVE = "onboard/canbus/drive/odrive.py"
PROTECTION = "onboard/canbus/protection.py"

T_GUARD = (
    "tests/onboard/safety/test_transmit_guard.py",
    "tests/onboard/safety/test_window_limit.py",
)
T_FAILSAFE = ("tests/onboard/safety/test_failsafe.py",)
T_STATES = ("tests/onboard/safety/test_states.py",)
T_ODRIVE = ("tests/onboard/canbus/test_odrive.py",)
T_HIL = ("tests/hil/test_detection.py", "tests/hil/test_stops.py")


class Mutant(NamedTuple):
    """`old` becomes `new` in `file`, which breaks what `breaks` says; `tests` must fail."""

    breaks: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


MUTANTS: tuple[Mutant, ...] = (
    Mutant(
        "speed limit doubled",
        GUARD,
        "> limits.speed_mps * SPEED_SLACK",
        "> 2 * limits.speed_mps * SPEED_SLACK",
        T_GUARD,
    ),
    Mutant(
        "speed gate open without leave",
        GUARD,
        '        if not self.motion_allowed:\n            return _not_allowed(f"speed',
        '        if False:\n            return _not_allowed(f"speed',
        T_GUARD,
    ),
    Mutant(
        "speed window removed",
        GUARD,
        "if not self._speeds.covers(abs(speed_mps), now_s):",
        "if False:",
        T_GUARD,
    ),
    Mutant(
        "steering window removed",
        GUARD,
        "if not self._angles.covers(angle_rad, now_s):",
        "if False:",
        T_GUARD,
    ),
    Mutant(
        "acceleration limit removed",
        GUARD,
        "if not self._faster.covers(up_mps):",
        "if False:",
        T_GUARD,
    ),
    Mutant(
        "deceleration limit removed",
        GUARD,
        "if not self._slower.covers(down_mps):",
        "if False:",
        T_GUARD,
    ),
    Mutant(
        "steering limit removed",
        GUARD,
        "if abs(angle_rad) > limits.steering_rad + STEERING_SLACK_RAD:",
        "if False:",
        T_GUARD,
    ),
    Mutant(
        "whitelist accepts remote frames",
        GUARD,
        "if codec is None or frame.remote:",
        "if codec is None:",
        T_GUARD,
    ),
    Mutant(
        "frames of one identifier not spaced",
        GUARD,
        "not 0 <= apart_s < MIN_SPACING_S",
        "True",
        T_GUARD,
    ),
    Mutant(
        "not-a-number setpoints pass",
        GUARD,
        "if not all(math.isfinite(number) for number in (value, *feed_forward)):",
        "if False:",
        T_GUARD,
    ),
    Mutant("window keeps one value only", WINDOW, "return all(", "return any(", T_GUARD),
    Mutant("window four times as long", WINDOW, "WINDOW_S = 0.25", "WINDOW_S = 1.0", T_GUARD),
    Mutant("rate budget never used up", BUDGET, "self._level - change", "self._level", T_GUARD),
    Mutant(
        "failsafe: milder verdict wins",
        FAILSAFE,
        "if verdict.action > worst.action:",
        "if verdict.action < worst.action or worst is NOTHING:",
        T_FAILSAFE,
    ),
    Mutant(
        "failsafe: lasting rows act at once",
        FAILSAFE,
        "            stood_s -= reaction.after_s\n",
        "            pass\n",
        T_FAILSAFE,
    ),
    Mutant(
        "failsafe: button needs power",
        FAILSAFE,
        "        worst = _estop(seen) or NOTHING\n        if not powered:",
        "        worst = (_estop(seen) if powered else None) or NOTHING\n        if not powered:",
        T_FAILSAFE,
    ),
    Mutant(
        "loop overrun allowed twice as long",
        TRIGGERS,
        "    if seen.loop_late_s <= limit_s:",
        "    if seen.loop_late_s <= 2 * limit_s:",
        T_FAILSAFE,
    ),
    Mutant(
        "leader's silence allowed twice as long",
        TRIGGERS,
        'return silence(name, "message", seen.leader.age_s, table.leader_stale.after_s)',
        'return silence(name, "message", seen.leader.age_s, 2 * table.leader_stale.after_s)',
        T_FAILSAFE,
    ),
    Mutant(
        "bus-passive not noticed",
        TRIGGERS,
        "passive = seen.bus_state is BusState.PASSIVE",
        "passive = False",
        T_FAILSAFE,
    ),
    Mutant(
        "a tripped watchdog does not latch",
        TRIGGERS,
        "_watchdog, fault=True)",
        "_watchdog)",
        T_FAILSAFE,
    ),
    Mutant(
        "reset out of FAULT never blocked",
        STATES,
        "_RESET = {Event.RESET: Rule(State.STANDBY, guarded=True)}",
        "_RESET = {Event.RESET: Rule(State.STANDBY)}",
        T_STATES,
    ),
    Mutant(
        "two landmarks outvote two that contradict",
        "onboard/estimate/consistency.py",
        "ENOUGH_AGREE = 3",
        "ENOUGH_AGREE = 2",
        ("tests/onboard/estimate/test_consistency.py",),
    ),
    Mutant(
        "an estimate begins anew while driving",
        SUPERVISION,
        "if self.state is not State.STANDBY:",
        "if self.state is State.ESTOP:",
        T_HIL,
    ),
    Mutant("a fault's stop ends in STANDBY", STATES, ", after_fault=State.FAULT)", ")", T_STATES),
    Mutant(
        "e-stop ignored in FAULT",
        STATES,
        "State.FAULT: {Event.ESTOP: Rule(State.ESTOP), **_RESET}",
        "State.FAULT: {**_RESET}",
        T_STATES,
    ),
    Mutant(
        "stop overdue after twice the time",
        SUPERVISION,
        "STOP_SLACK_S = 2.0",
        "STOP_SLACK_S = 4.0",
        T_HIL,
    ),
    Mutant(
        "e-stop does not reach the drives",
        SUPERVISION,
        "            self._hardware.estop()\n",
        "            pass\n",
        T_HIL,
    ),
    Mutant(
        "e-stop acted on one cycle late",
        SUPERVISION,
        "        self._watch(at, seen)\n        replies",
        '        seen, self._seen = getattr(self, "_seen", seen), seen\n'
        "        self._watch(at, seen)\n        replies",
        T_HIL,
    ),
    Mutant(
        "reset while the e-stop is still sent",
        SUPERVISION,
        "ESTOP_HOLD_S = 0.5",
        "ESTOP_HOLD_S = 0",
        T_HIL,
    ),
    Mutant(
        "e-stop frame sent once",
        ODRIVE,
        "ESTOP_FRAMES = 3",
        "ESTOP_FRAMES = 1",
        T_ODRIVE,
    ),
    Mutant(
        "drive that left closed loop not noticed",
        ODRIVE,
        "elif self._state is MotorState.ACTIVE and not in_closed_loop:",
        "elif False:",
        T_ODRIVE,
    ),
    Mutant(
        "wrong CRC accepted",
        PROTECTION,
        "or not e2e.crc_ok(data, self._id_list)",
        "",
        ("tests/onboard/canbus/test_protection.py",),
    ),
    Mutant(
        "black box may hold the loop up for 0.2 s",
        "onboard/canbus/black_box.py",
        "self._batches.put_nowait(batch)",
        "self._batches.put(batch, timeout=0.2)",
        ("tests/onboard/canbus/test_black_box.py",),
    ),
    Mutant(
        "unreadable e-stop ignored",
        "onboard/link.py",
        "        if len(self._unreadable) > known:",
        "        if False:",
        ("tests/fuzz/test_fuzz.py",),
    ),
    Mutant(
        "message from the future believed",
        "onboard/follower.py",
        "if age_s < -limit_s:",
        "if False:",
        ("tests/onboard/test_leader_messages.py",),
    ),
)


class Stale(Exception):
    """A mutant that does not fit the code any more."""


def apply(mutant: Mutant, root: Path) -> None:
    """Make the replacement. Raises Stale where the old text is not there exactly once."""
    path = root / mutant.file
    text = path.read_text()
    if (count := text.count(mutant.old)) != 1:
        raise Stale(f"{mutant.breaks}: found {count} x in {mutant.file}: {mutant.old!r}")
    path.write_text(text.replace(mutant.old, mutant.new))


def killed_by(mutant: Mutant) -> str | None:
    """The first test that notices the mutant, or None where it survives."""
    with tempfile.TemporaryDirectory(prefix="ech-") as folder:
        root = copied(Path(folder))
        apply(mutant, root)
        tests = [name for name in mutant.tests if (root / name).exists()]
        ended = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests],
            cwd=root,
            env=os.environ | {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if ended.returncode == 1 and failed:
        return failed[0].split(" - ")[0].removeprefix("FAILED ").rpartition("::")[2]
    if ended.returncode == 0:
        return None
    raise Stale(f"{mutant.breaks}: pytest ended with {ended.returncode}:\n{ended.stdout[-2000:]}")


def copied(folder: Path) -> Path:
    """The packages without caches, in this folder."""
    for name in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def main() -> int:
    """Run all, print the list with its kills; returns 0 where none survives."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--only", help="words of one mutant's description")
    options = parser.parse_args()
    chosen = [mutant for mutant in MUTANTS if not options.only or options.only in mutant.breaks]
    survivors = 0
    for number, mutant in enumerate(chosen, 1):
        killer = killed_by(mutant)
        survivors += killer is None
        told = f"killed by {killer}" if killer else "SURVIVES"
        print(f"{number:2}/{len(chosen)} {mutant.breaks} ({mutant.file}): {told}", flush=True)
    print(f"{len(chosen)} mutants, {len(chosen) - survivors} killed, {survivors} survive")
    return int(survivors > 0)


if __name__ == "__main__":
    sys.exit(main())
