"""Acceptance of the whole formation in lockstep: every shipped fleet, both laws, many seeds.

`make acceptance` runs it on both cores (about 15 minutes for 20 seeds) and fails when any run
misses a bar. `--json` prints every run's figures.
"""

import argparse
import json
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import Literal, NamedTuple

import msgspec

from config.fleet import Fleet
from config.loader import load_fleet, shipped_fleet_path, shipped_fleets
from config.messages import Status, Truth
from groundstation.evaluate import evaluate
from groundstation.lockstep import run_lockstep
from groundstation.series import gather

Law = Literal["leader_frame", "polar"]
LAWS: tuple[Law, ...] = ("leader_frame", "polar")
POSITION_RMS_M = 0.03
RANGE_RMS_M = 0.03
BEARING_RMS_RAD = 0.06
LEADER_RMSE_M = 0.09
STANDING_MPS = 0.02


class Row(NamedTuple):
    """Worst figures over the followers of one run."""

    fleet: str
    law: Law
    seed: int
    position_rms_m: float
    range_rms_m: float
    bearing_rms_rad: float
    leader_rmse_m: float
    min_distance_m: float
    problems: list[str]


def with_law(fleet: Fleet, law: Law) -> Fleet:
    """The fleet with every follower on this law."""
    robots = {
        name: robot.model_copy(
            update={"formation": robot.formation.model_copy(update={"law": law})}
        )
        for name, robot in fleet.robots.items()
    }
    return fleet.model_copy(update={"robots": robots})


def judge(name: str, law: Law, seed: int) -> Row:
    """One run against the bars of the project."""
    fleet = with_law(load_fleet(shipped_fleet_path(name)).fleet, law)
    messages: list[tuple[str, bytes]] = []
    run_lockstep(fleet, seed, lambda key, body, _: messages.append((key, body)))
    summary = evaluate(fleet, gather(messages), mode="lockstep", seed=seed, recording="")
    followers = summary.followers.values()
    row = Row(
        name,
        law,
        seed,
        max(follower.position_rms_m or 9.0 for follower in followers),
        max(follower.range_rms_m or 9.0 for follower in followers),
        max(follower.bearing_rms_rad or 9.0 for follower in followers),
        summary.leader.position_rmse_m or 9.0,
        summary.min_distance_m or 0.0,
        [],
    )
    faults = (fault.reason for fault in summary.faults)
    return row._replace(problems=[*_missed(row), *faults, *_unclean(messages)])


def _unclean(messages: list[tuple[str, bytes]]) -> Iterable[str]:
    """Frames that were blocked or lost, and robots that do not stand in the end, by truth."""
    for body in {key: body for key, body in messages if key.endswith("/status")}.values():
        status = msgspec.json.decode(body, type=Status)
        bus = status.bus
        if status.blocked_frames or bus.send_failures or bus.error_frames:
            yield (
                f"{status.robot}: {status.blocked_frames} frames blocked, {bus.send_failures} not "
                f"sent, {bus.error_frames} in error"
            )
    for body in {key: body for key, body in messages if key.startswith("truth/")}.values():
        truth = msgspec.json.decode(body, type=Truth)
        if abs(truth.speed_mps) > STANDING_MPS:
            yield f"{truth.robot}: {truth.speed_mps:.3f} m/s in the end"


def _missed(row: Row) -> Iterable[str]:
    bars = [("leader_rmse_m", LEADER_RMSE_M)]
    if row.law == "leader_frame":
        bars.append(("position_rms_m", POSITION_RMS_M))
    else:
        bars += [("range_rms_m", RANGE_RMS_M), ("bearing_rms_rad", BEARING_RMS_RAD)]
    for figure, bar in bars:
        if not getattr(row, figure) <= bar:
            yield f"{figure} {getattr(row, figure):.4f}, limit {bar}"


def main() -> int:
    """Run them all; returns 0 when every run meets every bar."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--fleets", nargs="+", default=shipped_fleets())
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    jobs = list(product(options.fleets, LAWS, range(1, options.seeds + 1)))
    with ProcessPoolExecutor(max_workers=2) as pool:
        rows = []
        for row in pool.map(judge, *zip(*jobs, strict=True)):
            rows.append(row)
            done = f"{len(rows)}/{len(jobs)}"
            print(f"{done} {row.fleet} {row.law} {row.seed} {row.problems}", file=sys.stderr)
    if options.json:
        print(json.dumps([row._asdict() for row in rows]))
    else:
        _print_table(rows)
    return 1 if any(row.problems for row in rows) else 0


def _print_table(rows: list[Row]) -> None:
    print(f"{'fleet':10}{'law':14}{'runs':>5}{'failed':>7}", end="")
    print("   median/worst of: position m, range m, bearing rad, leader m, nearest m")
    for fleet, law in dict.fromkeys((row.fleet, row.law) for row in rows):
        runs = [row for row in rows if (row.fleet, row.law) == (fleet, law)]
        failed = sum(bool(row.problems) for row in runs)
        print(f"{fleet:10}{law:14}{len(runs):5}{failed:7}", end="   ")
        for column, worst in ((3, max), (4, max), (5, max), (6, max), (7, min)):
            values = sorted(float(run[column]) for run in runs)  # type: ignore[arg-type]
            print(f"{values[len(values) // 2]:.4f}/{worst(values):.4f}", end="  ")
        print()


if __name__ == "__main__":
    sys.exit(main())
