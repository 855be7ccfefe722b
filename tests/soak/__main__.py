"""`python -m tests.soak`: hours of virtual time, then minutes of real processes; no drift allowed.

A run that was interrupted goes on where its file of samples ends.
"""

import argparse
import sys
from pathlib import Path

from tests.soak.fleet import circling
from tests.soak.processes import RealSoak
from tests.soak.report import report
from tests.soak.samples import SampleFile
from tests.soak.virtual import MINUTE_S, VirtualSoak


def main() -> int:
    """Run what is still missing, and judge; returns 0 where nothing drifts."""
    options = _parser().parse_args()
    _virtual(options.out / "virtual.jsonl", options.virtual_hours, options.seed)
    _real(options.out / "real.jsonl", options.real_minutes, options.seed)
    bad = [
        report(SampleFile(options.out / f"{name}.jsonl").read(), name)
        for name in ("virtual", "real")
    ]
    return int(any(bad))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--virtual-hours", type=float, default=2.0)
    parser.add_argument("--real-minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("build/soak"))
    return parser


def _real(path: Path, minutes: float, seed: int) -> None:
    file = SampleFile(path)
    before = file.read()
    from_s = before[-1].t_s if before else 0.0
    if from_s >= minutes * 60.0 - 1.0:
        return
    soak = RealSoak(circling(), seed, before[-1].session % 1000 + 1 if before else 0)
    try:
        while from_s < minutes * 60.0 - 1.0:
            sample = soak.minute(from_s)
            from_s = sample.t_s
            file.append(sample)
            print(f"real {from_s / 60:.1f} min: {dict(soak.operator.done)}", file=sys.stderr)
    finally:
        soak.close()


def _virtual(path: Path, hours: float, seed: int) -> None:
    file = SampleFile(path)
    before = file.read()
    from_s = before[-1].t_s if before else 0.0
    session = before[-1].session + 1 if before else 0
    soak = VirtualSoak(circling(), seed, session, from_s)
    end_s = hours * 3600.0 - 1.0
    while from_s < end_s:
        sample = soak.minute(min(MINUTE_S, hours * 3600.0 - from_s))
        from_s = sample.t_s
        file.append(sample)
        print(f"virtual {from_s / 60:.0f} min: {dict(soak.operator.done)}", file=sys.stderr)
    soak.close()


if __name__ == "__main__":
    sys.exit(main())
