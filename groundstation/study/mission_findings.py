"""What a check of a planned mission finds, and how findings are put together."""

from collections.abc import Sequence
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

Severity = Literal["error", "warning"]


class MissionFinding(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that is wrong or weak, on a stretch of mission time; `advice` says what to do.

    `value` is the worst on that stretch (None is unbounded), in `unit`, and `limit` what is asked.
    """

    severity: Severity
    robot: str
    check: str
    from_s: float
    to_s: float
    value: float | None
    limit: float
    unit: str
    text: str
    advice: str

    def __str__(self) -> str:
        value = "unbounded" if self.value is None else f"{self.value:.3g} {self.unit}".rstrip()
        limit = f"{self.limit:.3g} {self.unit}".rstrip()
        return (
            f"{self.severity}: {self.robot}, {self.from_s:.1f} to {self.to_s:.1f} s: {self.text}: "
            f"{value}, limit {limit}; {self.advice}"
        )


def stretches(bad: NDArray[np.bool_] | Sequence[bool]) -> list[slice]:
    """The runs of True."""
    edges = np.diff(np.concatenate(([False], np.asarray(bad, dtype=bool), [False])).astype(np.int8))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [slice(int(a), int(b)) for a, b in zip(starts, ends, strict=True)]
