"""The last minute of every robot, so that a page that opens late has its plots and trails."""

from collections import deque
from typing import NamedTuple

from groundstation.web.wire import Numbers, Past, RobotDetail, RobotFrame

PERIOD_S = 0.1
EARLY_S = 0.005
"""A sample may come so much before it is due."""
LENGTH = 600
NOTHING: Numbers = [None, None, None, None]


class _Sample(NamedTuple):
    values: Numbers
    place: Numbers
    true_place: Numbers


class History:
    """Samples of all robots, ten per second."""

    def __init__(self, robots: int) -> None:
        self._next_s = float("-inf")
        self._t_s: deque[float] = deque(maxlen=LENGTH)
        self._samples: list[deque[_Sample]] = [deque(maxlen=LENGTH) for _ in range(robots)]

    def add(self, t_s: float, frames: list[RobotFrame], details: list[RobotDetail]) -> None:
        """Keep a sample of every robot where one is due."""
        if t_s < self._next_s - EARLY_S:
            return
        self._next_s = t_s + PERIOD_S
        self._t_s.append(t_s)
        for kept, frame, detail in zip(self._samples, frames, details, strict=True):
            pose, truth = frame.pose or NOTHING, frame.truth or NOTHING
            kept.append(_Sample(detail.values or NOTHING, pose[:2], truth[:2]))

    def past(self) -> list[Past]:
        """Everything that is kept."""
        times = list(self._t_s)
        return [
            Past(
                times,
                [sample.values for sample in kept],
                [sample.place for sample in kept],
                [sample.true_place for sample in kept],
            )
            for kept in self._samples
        ]
