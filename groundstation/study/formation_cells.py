"""Figure 5's runs on the core alone: the fleet `paper`, one relative filter, one seed."""

from typing import NamedTuple

import msgspec
import numpy as np

from config.fleet import Fleet
from groundstation.formation_error import desired_sightline
from groundstation.study.formation import FormationRun, drive_formation
from groundstation.study.leader_cells import KEEP_EVERY, short
from groundstation.study.runner import Job
from groundstation.study.scenario import DT_S, Floats, paper_fleet, wrapped

FILTERS = {"paper": "paper", "ours": "ukf"}
ODOMETRY = {"exact": 0.0, "scaled": 0.01}
NAMES = {"paper": "the paper's filter", "ours": "our filter"}
DESCRIBED = {"exact": "exact", "scaled": "scaled by 1 %"}


class FormationCell(NamedTuple):
    """Which relative filter, and whether the odometry has its scale error."""

    filter: str
    odometry: str

    @property
    def name(self) -> str:
        """The cell's name in a store, such as formation-ours-scaled."""
        return f"formation-{self.filter}-{self.odometry}"

    @property
    def described(self) -> str:
        """The cell in words."""
        return f"{NAMES[self.filter]}, odometry {DESCRIBED[self.odometry]}"

    @classmethod
    def parse(cls, name: str) -> "FormationCell":
        """The cell of that name."""
        _, kind, odometry = name.split("-")
        return cls(kind, odometry)


FORMATION_CELLS = tuple(FormationCell(kind, odometry) for kind in FILTERS for odometry in ODOMETRY)


class FollowerResult(msgspec.Struct, frozen=True):
    """Errors every 50 ms, estimate minus truth, and means of squares over the judged time.

    `place`, `range` and `bearing` are the formation's errors, `est_*` the estimate's; `nees` has 3
    states, `nis` is per bearing. `heading_max_rad` is the largest error of the estimated alpha.
    """

    bearing_error_rad: list[float]
    heading_error_rad: list[float]
    place_mse_m2: float
    range_mse_m2: float
    bearing_mse_rad2: float
    est_range_mse_m2: float
    est_bearing_mse_rad2: float
    est_heading_mse_rad2: float
    heading_max_rad: float
    nees: float
    nis: float


class FormationResult(msgspec.Struct, frozen=True):
    """Both followers."""

    followers: dict[str, FollowerResult]


def fleet_of(cell: FormationCell) -> Fleet:
    """The fleet `paper` with the cell's filter and odometry."""
    source = paper_fleet()
    kind = {"kind": FILTERS[cell.filter]}
    robots = {
        name: robot.model_copy(
            update={"relative_filter": robot.relative_filter.model_copy(update=kind)}
        )
        for name, robot in source.robots.items()
    }
    error = {"odometry_scale_error": ODOMETRY[cell.odometry]}
    simulation = source.simulation.model_copy(update=error)
    return source.model_copy(update={"robots": robots, "simulation": simulation})


def run_formation(job: Job) -> FormationResult:
    """One seed of one cell."""
    source = fleet_of(FormationCell.parse(job.cell))
    run = drive_formation(source, job.seed)
    return FormationResult({name: _judged(source, run, name) for name in run.seen})


def _judged(source: Fleet, run: FormationRun, name: str) -> FollowerResult:
    offset = source.robots[name].offset
    assert offset is not None, "a follower has a place"
    truth = np.array([each.truth for each in run.seen[name]])
    errors = np.array([each.estimate for each in run.seen[name]]) - truth
    errors[:, 1:] = wrapped(errors[:, 1:])
    wanted = truth[:, :2] - desired_sightline(offset)
    wanted[:, 1] = wrapped(wanted[:, 1])
    late = np.arange(1, len(truth) + 1) * DT_S >= source.mission.acceptance.from_s
    kept = slice(KEEP_EVERY - 1, None, KEEP_EVERY)

    def mse(values: Floats) -> float:
        return float(np.mean(values[late] ** 2))

    return FollowerResult(
        bearing_error_rad=short(errors[kept, 1]),
        heading_error_rad=short(errors[kept, 2]),
        place_mse_m2=mse(run.column(name, lambda each: each.offset_error_m)),
        range_mse_m2=mse(wanted[:, 0]),
        bearing_mse_rad2=mse(wanted[:, 1]),
        est_range_mse_m2=mse(errors[:, 0]),
        est_bearing_mse_rad2=mse(errors[:, 1]),
        est_heading_mse_rad2=mse(errors[:, 2]),
        heading_max_rad=float(np.max(np.abs(errors[late, 2]))),
        nees=float(np.mean(run.column(name, lambda each: each.nees)[late])),
        nis=float(np.mean(run.column(name, lambda each: each.nis)[late])),
    )
