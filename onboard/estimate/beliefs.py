"""What the estimators say, and what the relative filters have in common."""

import math
from typing import NamedTuple, Protocol

from config.fleet import Point
from onboard.model.vehicle import WheelMotion


class PoseBelief(NamedTuple):
    """Mean of a robot's state (3) and its 4 x 4 covariance, row by row (x, y, eta, theta)."""

    x_m: float
    y_m: float
    fork_rad: float
    heading_rad: float
    covariance: tuple[float, ...]
    effective_particles: float | None = None


class RelativeBelief(NamedTuple):
    """Mean of the leader's relative state and its 4 x 4 covariance, row by row.

    Order: range [m], bearing [rad], relative heading alpha [rad], speed scale epsilon; the
    leader's true speed is (1 + epsilon) times the speed that it reports.
    """

    range_m: float
    bearing_rad: float
    heading_rad: float
    speed_scale: float
    covariance: tuple[float, ...]

    @property
    def range_std_m(self) -> float:
        """Standard deviation of the range [m]."""
        return math.sqrt(self.covariance[0])


class RelativePrior(NamedTuple):
    """What a follower believes of its leader before the first bearing."""

    range_m: float
    range_std_m: float
    bearing_rad: float
    bearing_std_rad: float
    heading_rad: float
    heading_std_rad: float


class Innovation(NamedTuple):
    """What one bearing did: measured minus predicted, its square normalised by its variance.

    `accepted` is False where the gate refused the bearing or the filter has no use for it.
    """

    residual_rad: float
    nis: float
    accepted: bool


class RelativeFilter(Protocol):
    """A follower's filter on its leader; kinds `ukf` and `reference` give the same numbers."""

    rejected: int
    rejected_in_a_row: int

    @property
    def range_told(self) -> bool:
        """Whether anything makes the range observable at present."""

    def predict(self, dt_s: float, own: WheelMotion, leader: WheelMotion) -> None:
        """Advance by `dt_s` with the measured own motion and the leader's reported one."""

    def update_leader_marker(
        self, bearing_rad: float, std_rad: float, marker: Point, age_s: float
    ) -> Innovation:
        """Use a bearing (own body frame, captured `age_s` ago) to a marker of the leader."""

    def update_mutual(
        self, bearing_rad: float, std_rad: float, own_marker: Point, age_s: float
    ) -> Innovation:
        """Use a bearing that the leader took, in its body frame, to one of the own markers."""

    def estimate(self) -> RelativeBelief:
        """The present belief."""
