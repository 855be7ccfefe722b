"""Figures of a soak as JSON lines, one per minute, so that a run can be interrupted and go on."""

from pathlib import Path

import msgspec


class Sample(msgspec.Struct, frozen=True):
    """One minute. `session` counts the processes that the run has had; `figures` by name."""

    session: int
    t_s: float
    figures: dict[str, float]


class SampleFile:
    """Lines of one run. The time of a run that goes on continues after its last line."""

    def __init__(self, path: Path) -> None:
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)

    def read(self) -> list[Sample]:
        """All samples; a line that an interruption has cut off is left out."""
        if not self._path.exists():
            return []
        samples = []
        for line in self._path.read_bytes().splitlines():
            try:
                samples.append(msgspec.json.decode(line, type=Sample))
            except msgspec.DecodeError:
                continue
        return samples

    def append(self, sample: Sample) -> None:
        """Add one line, at once on disk."""
        with self._path.open("ab") as file:
            file.write(msgspec.json.encode(sample) + b"\n")
