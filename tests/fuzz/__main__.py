"""`python -m tests.fuzz`: random and mutated frames and payloads into running robots.

Every chunk has a fleet of its own and depends on seed and number only, so that one chunk can be run
again (`--only frames:17`). What is in the result file already is not run again.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import msgspec

from tests.fuzz.chunks import ChunkResult, Kind, run_chunk
from tests.fuzz.session import run_session
from tests.soak.trend import trend

PER_CHUNK: dict[Kind, int] = {"frames": 25_000, "payloads": 10_000}
KINDS: tuple[Kind, ...] = ("frames", "payloads")
MEMORY_LIMIT_MB = 2.0
Wanted = tuple[Kind, int]


def main() -> int:
    """Run what is still missing, and judge; returns 0 where nothing was violated."""
    options = _parser().parse_args()
    if options.only:
        kind, _, number = options.only.partition(":")
        print(run_chunk(kind, options.seed, int(number), PER_CHUNK[kind]))
        return 0
    out: Path = options.out / f"seed-{options.seed}.jsonl"
    out.parent.mkdir(parents=True, exist_ok=True)
    done = _read(out)
    wanted: list[Wanted] = [
        (kind, chunk)
        for kind in KINDS
        for chunk in range(-(-getattr(options, kind) // PER_CHUNK[kind]))
    ]
    process = time.time()
    for number, (kind, chunk) in enumerate(wanted, 1):
        if any((each.kind, each.chunk) == (kind, chunk) for each in done):
            continue
        result = run_chunk(kind, options.seed, chunk, PER_CHUNK[kind])
        result = msgspec.structs.replace(result, session=process)
        done.append(result)
        with out.open("ab") as file:
            file.write(msgspec.json.encode(result) + b"\n")
        print(f"seed {options.seed} {number}/{len(wanted)} {kind} {chunk}", file=sys.stderr)
    heard = run_session(options.seed, options.session)
    return _report(options.seed, done, heard)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--payloads", type=int, default=200_000)
    parser.add_argument("--session", type=int, default=2_000, help="over a real Zenoh session")
    parser.add_argument("--only", help="one chunk, e.g. frames:17, and print its result")
    parser.add_argument("--out", type=Path, default=Path("build/fuzz"))
    return parser


def _read(path: Path) -> list[ChunkResult]:
    if not path.exists():
        return []
    return [msgspec.json.decode(line, type=ChunkResult) for line in path.read_bytes().splitlines()]


def _report(seed: int, results: Iterable[ChunkResult], heard: int) -> int:
    results = list(results)
    print(f"seed {seed}: no exception, no unguarded frame, no robot that moved while it stood")
    for kind in KINDS:
        mine = [each for each in results if each.kind == kind]
        states: Counter[str] = Counter()
        for each in mine:
            states.update(each.by_state)
        print(
            f"{kind}: {states.total()} in {len(mine)} chunks, by state {dict(states)}; "
            f"{sum(each.unreadable for each in mine)} unreadable, "
            f"{sum(each.recoveries for each in mine)} recoveries by the operator, "
            f"robots carried back in {sum(each.carried_back for each in mine)} of them"
        )
        for problem in [text for each in mine for text in each.not_recovered]:
            print(f"  needed a new process: {problem}")
        for text, count in Counter(t for each in mine for t in each.quiet_stops).items():
            print(f"  stopped {count} x by what should not stop it: {text}")
    print(f"real session: {heard} payloads answered or reported, none lost in silence")
    return _memory(results)


def _memory(results: list[ChunkResult]) -> int:
    """Memory over the chunks of each process, the first two of which warm it up."""
    bad = 0
    series: list[Literal["rss_mb", "blocks"]] = ["rss_mb", "blocks"]
    for name in series:
        points = [
            (each.session, float(number), float(getattr(each, name)))
            for session in dict.fromkeys(each.session for each in results)
            for number, each in enumerate(r for r in results if r.session == session)
            if number >= 2
        ]
        found = trend(points)
        if found is None:
            print(f"memory {name}: too few chunks for a slope")
            continue
        print(f"memory {name}: {found.text(len(results), 'chunks')}")
        bad += name == "rss_mb" and found.low * len(results) > MEMORY_LIMIT_MB
    return bad


if __name__ == "__main__":
    sys.exit(main())
