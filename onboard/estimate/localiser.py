"""What every localiser takes in and says; the kinds are made by `localiser_factory`.

State (3): front-wheel midpoint (x, y), fork direction eta and body heading theta in the landmarks'
frame. Bearings are in the body frame where the sensor is mounted on the body and in the fork frame
where it is mounted on the fork: the raw reading plus the mounting yaw.
"""

from collections.abc import Sequence
from enum import Enum
from typing import Literal, NamedTuple, Protocol

from onboard.estimate.beliefs import PoseBelief

KnownRate = Literal["steering", "fork"]
"""Which turning rate `predict` is given: d delta/dt of a steering motor, or omega = d eta/dt."""

Mounting = Literal["body", "fork"]

STANDING_MPS = 0.002
"""Below this speed a robot counts as standing."""

STANDING_NOISE = 0.1
"""Factor on the process noise of a standing robot, whose fork no bearing can see."""


class LandmarkBearing(NamedTuple):
    """A bearing [rad] to a landmark, captured `age_s` before the last prediction's end."""

    landmark_id: int
    bearing_rad: float
    std_rad: float
    age_s: float


class UpdateOutcome(Enum):
    """What became of a batch of bearings."""

    UPDATED = "the belief was updated"
    RESAMPLED = "the weights were updated and the particles resampled"
    NO_BEARINGS = "no bearing belongs to a known landmark"
    DIVERGED = "the belief agrees with no bearing: bearings not used"
    SEARCHING = "no pose yet: bearings kept for the search"


class UpdateResult(NamedTuple):
    """Outcome, ids in the batch that are not on the map, and the effective number of particles."""

    outcome: UpdateOutcome
    unknown_ids: tuple[int, ...]
    effective_particles: float | None = None


class Trust(NamedTuple):
    """Whether the pose may be driven on, and what speaks for or against it.

    `since_s` is the localiser's own time, that of all predictions, at which trust began. `reason`
    is empty for a trusted pose. `lost` says that a pose was trusted before and is not any more.
    `hypotheses` counts the poses that the bearings leave possible, 0 where there is none yet.
    """

    trusted: bool
    reason: str
    since_s: float | None
    lost: bool
    hypotheses: int
    rejected: int
    nis_median: float | None
    bias_rad: float


class Localiser(Protocol):
    """A robot's filter on its own pose."""

    @property
    def time_s(self) -> float:
        """Sum of all prediction steps [s]."""

    def predict(self, dt_s: float, speed_mps: float, rate_radps: float) -> None:
        """Advance by `dt_s` with front-wheel speed and the known turning rate."""

    def measure_steering(self, steering_rad: float) -> None:
        """Use the steering encoder's angle delta = eta - theta at the present instant."""

    def update(self, bearings: Sequence[LandmarkBearing]) -> UpdateResult:
        """Use bearings (5) to landmarks, each at its capture time."""

    def estimate(self) -> PoseBelief | None:
        """The present belief, None while there is none."""

    def trust(self) -> Trust:
        """Whether that belief may be driven on."""

    def particles(self, count: int) -> list[tuple[float, float]]:
        """Places [m] of `count` particles drawn by their weights; none without particles."""
