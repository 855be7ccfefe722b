"""One chunk of fuzz: a fresh fleet, one state, so many frames or payloads from one seed."""

import gc
import resource
import sys
import time
from pathlib import Path
from typing import Literal

import msgspec

from tests.fuzz.arena import Arena
from tests.fuzz.payloads import PayloadFuzzer, is_quiet

Kind = Literal["frames", "payloads"]
STATES = ("STANDBY", "ARMED", "RUNNING")
TARGETS = ("r2", "r1")
PER_CYCLE = 250
HOSTILE_SHARE = 0.05
HOSTILE_CYCLES = 2
AFTERMATH_S = 0.5
"""What a hostile burst has brought about shows within this time, not in the quiet after it."""
PAYLOADS_PER_CYCLE = 40
TOPICS = ("motion",) * 12 + ("command",) * 5 + ("ground",) * 3
HOSTILE_PAYLOADS_SHARE = 0.04
ESTOP_SHARE = 0.1
PAGE_MB = resource.getpagesize() / 2**20


class ChunkResult(msgspec.Struct, frozen=True):
    """What a chunk did. `by_state` counts inputs, `stops` the reasons for which it stopped."""

    kind: str
    chunk: int
    target: str
    wanted: str
    by_state: dict[str, int]
    unreadable: int
    recoveries: int
    carried_back: int
    not_recovered: list[str]
    quiet_stops: list[str]
    rss_mb: float
    blocks: int
    cpu_s: float
    session: float = 0.0


def run_chunk(kind: Kind, seed: int, chunk: int, count: int) -> ChunkResult:
    """Run one chunk. Raises whatever the robot raises, and Violation."""
    started_s = time.process_time()
    wanted = STATES[chunk % len(STATES)]
    target = TARGETS[chunk // len(STATES) % len(TARGETS)] if kind == "frames" else "r2"
    arena = Arena(target, seed * 1000 + chunk)
    run = _Chunk(arena, kind, wanted, count)
    try:
        run.run()
    finally:
        arena.close()
    unreadable = arena.counts.pop("unreadable", 0)
    carried_back = arena.counts.pop("carried back", 0)
    gc.collect()
    return ChunkResult(
        kind,
        chunk,
        target,
        wanted,
        dict(arena.counts),
        unreadable,
        run.recoveries,
        carried_back,
        run.not_recovered,
        run.quiet_stops,
        int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB,
        sys.getallocatedblocks(),
        time.process_time() - started_s,
    )


class _Chunk:
    """Attacks until so many inputs are used up; in between the operator restores the state."""

    def __init__(self, arena: Arena, kind: Kind, wanted: str, count: int) -> None:
        self._arena, self._kind, self._wanted, self._left = arena, kind, wanted, count
        self.recoveries = 0
        self.not_recovered: list[str] = []
        self.quiet_stops: list[str] = []
        lockstep = arena.lockstep
        leader = lockstep.fleet.robots["r1"]
        marker = lockstep.fleet.robots["r2"].markers[0].id
        assert leader.leader is None
        self._payloads = PayloadFuzzer(arena.rng, "r1", marker, "r2")

    def run(self) -> None:
        """Use up all inputs, then leave a robot that can be used again."""
        self._restore()
        while self._left > 0:
            if self._arena.state != self._wanted:
                self._restore()
            if self._kind == "payloads":
                self._send_payloads()
            else:
                self._send_frames()
        self._wanted = "STANDBY"
        self._restore()

    def _send_frames(self) -> None:
        arena, hostile = self._arena, self._arena.rng.random() < HOSTILE_SHARE
        count = min(PER_CYCLE, self._left)
        if self._wanted == "STANDBY" or hostile:
            for _ in range(HOSTILE_CYCLES):
                arena.attack_bus(count, quiet=False)
                self._left -= count
            if hostile:
                arena.run_for(AFTERMATH_S)
            return
        arena.attack_bus(count, quiet=True)
        self._left -= count
        if arena.state != self._wanted:
            status = arena.lockstep.statuses[arena.target]
            self.quiet_stops.append(status.reason)

    def _send_payloads(self) -> None:
        arena, fuzzer = self._arena, self._payloads
        quiet = self._wanted != "STANDBY" and arena.rng.random() > HOSTILE_PAYLOADS_SHARE
        count = min(PAYLOADS_PER_CYCLE, self._left)
        made: list[tuple[str, bytes]] = []
        while len(made) < count:
            topic = TOPICS[int(arena.rng.integers(len(TOPICS)))]
            payload = fuzzer.one(topic, arena.lockstep.now_s, arena.wall_s)
            if not quiet or is_quiet(topic, payload):
                made.append((topic, payload))
        if not quiet and arena.rng.random() < ESTOP_SHARE:
            made[0] = ("estop", fuzzer.one("estop", arena.lockstep.now_s, arena.wall_s))
        arena.attack_link(made)
        self._left -= count
        if not quiet and self._wanted != "STANDBY":
            arena.run_for(AFTERMATH_S)
        if quiet and arena.state != self._wanted:
            self.quiet_stops.append(arena.lockstep.statuses[arena.target].reason)

    def _restore(self) -> None:
        """The operator's way back; where there is none, the robot's program is started anew."""
        self.recoveries += 1
        if self._arena.reach(self._wanted):
            return
        statuses = self._arena.lockstep.statuses
        lacking = {name: status.not_ready or status.reason for name, status in statuses.items()}
        self.not_recovered.append(f"{self._wanted}: {lacking}")
        self._left = 0
