"""The last minute of every robot, so that a page that opens late has its plots and trails."""

from collections import deque

from groundstation.web.wire import Numbers, Past, RobotFrame

PERIOD_S = 0.1
LENGTH = 600
NOTHING: Numbers = [None, None, None, None]


class History:
    """Samples of all robots, ten per second."""

    def __init__(self, robots: int) -> None:
        self._next_s = float("-inf")
        self._t_s: deque[float] = deque(maxlen=LENGTH)
        self._frames: list[deque[RobotFrame]] = [deque(maxlen=LENGTH) for _ in range(robots)]

    def add(self, t_s: float, robots: list[RobotFrame]) -> None:
        """Keep a frame where one is due."""
        if t_s < self._next_s:
            return
        self._next_s = t_s + PERIOD_S
        self._t_s.append(t_s)
        for kept, frame in zip(self._frames, robots, strict=True):
            kept.append(frame)

    def past(self) -> list[Past]:
        """Everything that is kept."""
        times = list(self._t_s)
        return [
            Past(
                times,
                [frame.values or NOTHING for frame in kept],
                [(frame.pose or NOTHING)[:2] for frame in kept],
                [(frame.truth or NOTHING)[:2] for frame in kept],
            )
            for kept in self._frames
        ]
