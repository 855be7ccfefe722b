"""The faults that an emulated device has right now; `config.faults` says what each kind means.

A device asks its `DeviceFaults` at three seams: whether a cyclic message is due at all (`skips`),
what it measures (`distort`), and which of its frames reach the bus (`pass_on`). Pure: time is
passed in, and what is random comes from the generator given.
"""

import math
from collections import deque
from collections.abc import Callable

from numpy.random import Generator

from config.can.frame import Frame
from config.faults import kind_of
from sim_hw.timing import TOLERANCE_S

Row = tuple[float, ...]
Wrong = Callable[[Row, Row, float], Row]
"""What is measured, what was measured when the fault began, the fault's value -> false values."""


class ActiveFaults:
    """Kinds and values of the faults of one device. `any` is False while it is healthy."""

    def __init__(self, device: str, rng: Generator) -> None:
        self.any = False
        self._device = device
        self._rng = rng
        self._values: dict[str, float] = {}
        self._since_s: dict[str, float] = {}

    def begin(self, kind: str, value: float | None, t_s: float) -> None:
        """Start a fault; the same kind again replaces the former."""
        row = kind_of(self._device, kind)
        self._values[kind] = row.default if value is None else value
        self._since_s[kind] = t_s
        self.any = True

    def end(self, kind: str) -> None:
        """End a fault; one that is not there is no mistake."""
        self._values.pop(kind, None)
        self._since_s.pop(kind, None)
        self.any = bool(self._values)

    def has(self, kind: str) -> bool:
        """Whether the device has this fault."""
        return kind in self._values

    def value(self, kind: str) -> float:
        """The value of a fault that the device has."""
        return self._values[kind]

    def lasts_s(self, kind: str, t_s: float) -> float:
        """For how long the device has had this fault."""
        return t_s - self._since_s[kind]

    @property
    def active(self) -> dict[str, float]:
        """Kinds and values."""
        return dict(self._values)


class DeviceFaults(ActiveFaults):
    """Faults of a drive or a sensor.

    `spans` are the widths of garbage, one per measured value; `wrong` makes the false values.
    """

    def __init__(
        self, device: str, rng: Generator, spans: Row, wrong: Wrong, garbage_by_value: bool = False
    ) -> None:
        super().__init__(device, rng)
        self._spans = spans
        self._wrong = wrong
        self._garbage_by_value = garbage_by_value
        self._held: Row = (0.0,) * len(spans)
        self._onset: Row = self._held
        self._cycles: dict[str, float] = {}
        self._waiting: deque[tuple[float, Frame]] = deque()

    def begin(self, kind: str, value: float | None, t_s: float) -> None:
        """Start a fault; `stuck` holds, and `wrong` starts from, what was measured last."""
        super().begin(kind, value, t_s)
        self._onset = self._held
        if kind == "slow":
            self._cycles.clear()

    def skips(self, message: str) -> bool:
        """Whether a cyclic message that is due now is left out (`slow`)."""
        if "slow" not in self._values:
            return False
        passed = self._cycles.get(message, self._values["slow"]) + 1.0
        skipped = passed < self._values["slow"]
        self._cycles[message] = passed if skipped else passed - self._values["slow"]
        return skipped

    def distort(self, measured: Row) -> Row:
        """What the device takes for its measurement."""
        if not self.any:
            self._held = measured
            return measured
        if self.has("nan"):
            return (math.nan,) * len(measured)
        if self.has("garbage"):
            return self._garbage()
        if self.has("stuck"):
            return self._onset
        self._held = measured
        if self.has("wrong"):
            return self._wrong(measured, self._onset, self._values["wrong"])
        return measured

    def _garbage(self) -> Row:
        width = self._values["garbage"] if self._garbage_by_value else 1.0
        return tuple(float(self._rng.uniform(-span, span)) * width for span in self._spans)

    def pass_on(self, frames: list[Frame], t_s: float) -> list[Frame]:
        """The frames that reach the bus at `t_s`, given those that the device has made."""
        if not self.any and not self._waiting:
            return frames
        if self._silent(t_s):
            self._waiting.clear()
            return []
        late_s = self._values.get("delayed", 0.0)
        self._waiting += [(frame.t_s + late_s, frame) for frame in frames]
        passed = []
        while self._waiting and self._waiting[0][0] <= t_s + TOLERANCE_S:
            due_s, frame = self._waiting.popleft()
            passed.append(frame._replace(t_s=due_s))
        return passed

    @property
    def holds_frames(self) -> bool:
        """True while delayed frames wait for their time."""
        return bool(self._waiting)

    def _silent(self, t_s: float) -> bool:
        if self.has("off") or self.has("mute"):
            return True
        if not self.has("intermittent"):
            return False
        periods = (self.lasts_s("intermittent", t_s) + TOLERANCE_S) / self.value("intermittent")
        return math.floor(periods) % 2 == 0


def first_too_large(unit: float = 1.0) -> Wrong:
    """The first value too large by the fault's value, of which each is `unit` in its own unit."""

    def wrong(measured: Row, _onset: Row, value: float) -> Row:
        return (measured[0] + value * unit, *measured[1:])

    return wrong


def way_and_speed_too_large(measured: Row, onset: Row, value: float) -> Row:
    """Position since the onset, and velocity, too large by a part."""
    position, velocity = measured
    return (
        onset[0] + (position - onset[0]) * (1.0 + value),
        velocity * (1.0 + value),
    )
