"""What a soak says: sums of what was counted, and for every figure whether it drifts."""

from collections.abc import Sequence

from tests.soak.samples import Sample
from tests.soak.trend import Trend, trend

WARM_UP_S = 120.0
MEMORY_LIMIT_MB = 2.0
SHARE_LIMIT = 0.1
COUNTED = frozenset(
    {"starts", "stops", "resets", "faults", "estop", "stop", "pause", "clock", "carried back"}
    | {
        "carried from afar",
        "reopened",
        "arm refused",
        "start refused",
        "moving_at_rest",
        "restarts",
    }
)
"""What the operator did and what must be 0; everything else is a level that may not drift."""
NOT_JUDGED = frozenset({"driving_share", "nearest_m"})
STUCK_MINUTES = 3
"""A fleet that does not drive for so many minutes cannot be recovered by its operator."""


def limit_of(name: str, mean: float) -> float:
    """How much a figure may grow over the whole run."""
    return MEMORY_LIMIT_MB if name.endswith("rss_mb") else max(SHARE_LIMIT * abs(mean), 1.0)


def verdict(found: Trend, duration_s: float, limit: float) -> str:
    """`flat`: within the limit with 95 % confidence. `DRIFT`: beyond it. `open`: too much noise."""
    low, high = found.low * duration_s, found.high * duration_s
    if low > limit or high < -limit:
        return "DRIFT"
    return "flat" if -limit <= low and high <= limit else "open"


def report(samples: Sequence[Sample], what: str) -> bool:
    """Print the report of a run; returns whether anything drifts or moved while it stood."""
    if not samples:
        print(f"{what}: nothing was run")
        return False
    sessions = {sample.session for sample in samples}
    print(f"{what}: {samples[-1].t_s / 60:.0f} minutes in {len(sessions)} session(s)")
    names = list(dict.fromkeys(name for sample in samples for name in sample.figures))
    sums = {name: sum(s.figures.get(name, 0.0) for s in samples) for name in names}
    print("  " + ", ".join(f"{name} {sums[name]:.0f}" for name in names if name in COUNTED))
    if "nearest_m" in sums:
        print(f"  nearest {min(s.figures['nearest_m'] for s in samples):.3f} m")
    bad = sums.get("moving_at_rest", 0.0) > 0
    if (stuck := longest_stand(samples)) >= STUCK_MINUTES:
        print(f"  did not drive for {stuck} minutes, limit {STUCK_MINUTES}")
        bad = True
    for name in names:
        if name not in COUNTED and name not in NOT_JUDGED:
            bad = _line(samples, name) or bad
    return bad


def longest_stand(samples: Sequence[Sample]) -> int:
    """The most samples in a row in which the fleet did not drive at all."""
    longest = stand = 0
    for sample in samples:
        stand = stand + 1 if sample.figures.get("driving_share") == 0.0 else 0
        longest = max(longest, stand)
    return longest


def _line(samples: Sequence[Sample], name: str) -> bool:
    began = {s.session: s.t_s for s in reversed(samples)}
    points = [
        (float(s.session), s.t_s, s.figures[name])
        for s in samples
        if name in s.figures and s.t_s - began[s.session] >= WARM_UP_S
    ]
    found = trend(points)
    if found is None:
        print(f"  {name:22} too few samples")
        return False
    duration_s = samples[-1].t_s
    said = verdict(found, duration_s, limit_of(name, found.mean))
    print(f"  {name:22} {said:6}{found.text(duration_s, 's')}")
    return said == "DRIFT"
