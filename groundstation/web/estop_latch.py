"""An emergency stop given on the page: repeated until every robot has confirmed it. Pure."""

from collections.abc import Callable, Iterable

CONFIRMED = "ESTOP"


class EstopLatch:
    """Latched from `press` on. It ends when every robot has confirmed it and one was reset since,
    or when it is withdrawn from robots that do not answer.
    """

    def __init__(self, robots: Iterable[str]) -> None:
        self._robots = list(robots)
        self.by = ""
        self.since_s = 0.0
        self.active = False
        self.repeating = False
        self._confirmed: set[str] = set()

    def press(self, operator: str, now_s: float) -> None:
        """The operator has pressed it; every robot has to confirm it anew."""
        if not self.active:
            self.by, self.since_s = operator, now_s
        self.active = self.repeating = True
        self._confirmed = set()

    def withdraw(self) -> None:
        """No longer repeat it. Robots stay in ESTOP until they are reset."""
        self.active = self.repeating = False

    @property
    def confirmed(self) -> list[str]:
        """Robots that have been in ESTOP since."""
        return [name for name in self._robots if name in self._confirmed]

    @property
    def missing(self) -> list[str]:
        """Robots that have not confirmed it: stop them by hand."""
        return [name for name in self._robots if name not in self._confirmed]

    def look(self, state: Callable[[str], str]) -> None:
        """Judge by the robots' present states."""
        if not self.active:
            return
        states = {name: state(name) for name in self._robots}
        self._confirmed |= {name for name, now in states.items() if now == CONFIRMED}
        self.repeating = bool(self.missing)
        if not self.repeating and any(now != CONFIRMED for now in states.values()):
            self.active = False
