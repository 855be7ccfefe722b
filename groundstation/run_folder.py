"""The folder that holds everything about one run."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from config.fleet import Fleet
from config.loader import dump_effective
from groundstation import summary
from groundstation.errors import GroundError
from groundstation.summary import Summary
from groundstation.viewer_layout import layout


@dataclass(frozen=True, slots=True)
class RunFolder:
    """Names of the files of a run."""

    path: Path

    @property
    def recording(self) -> Path:
        """The MCAP recording."""
        return self.path / "run.mcap"

    @property
    def fleet(self) -> Path:
        """The effective fleet file."""
        return self.path / "fleet.yaml"

    @property
    def summary(self) -> Path:
        """The judgement."""
        return self.path / "summary.json"

    @property
    def trajectories(self) -> Path:
        """Figure of the paths."""
        return self.path / "trajectories.png"

    @property
    def formation(self) -> Path:
        """Figure of the formation errors."""
        return self.path / "formation.png"

    @property
    def logs(self) -> Path:
        """Output of the processes."""
        return self.path / "logs"

    @property
    def layout(self) -> Path:
        """How viewers of recordings are to show this fleet."""
        return self.path / "viewer-layout.json"

    def write_fleet(self, fleet: Fleet) -> None:
        """Write the effective fleet, every robot complete, and the layout for viewers."""
        self.fleet.write_text(dump_effective(fleet), encoding="utf-8")
        self.layout.write_text(layout(fleet), encoding="utf-8")

    def write_summary(self, judged: Summary) -> None:
        """Write the summary."""
        self.summary.write_bytes(summary.to_json(judged))


def create(fleet: str, lockstep: bool, out: Path | None, now: datetime | None = None) -> RunFolder:
    """Make the folder of a new run: `out`, or one under runs/ named after the time and the fleet.

    Raises GroundError when the folder holds something already or cannot be made.
    """
    moment = now if now is not None else datetime.now(UTC)
    name = f"{moment:%Y%m%dT%H%M%SZ}-{fleet}{'-lockstep' if lockstep else ''}"
    path = out if out is not None else Path("runs") / name
    try:
        if path.is_dir() and any(path.iterdir()):
            raise GroundError(
                f"the run folder {path} is not empty: name another one with --out, or empty it"
            )
        folder = RunFolder(path)
        folder.logs.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GroundError(f"cannot make the run folder {path}: {error.strerror}") from error
    return folder
