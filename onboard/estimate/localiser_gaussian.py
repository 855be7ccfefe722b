"""The default localiser: a Gaussian filter that can start from nothing and notices when it is lost.

SEARCHING gathers bearings until they tell one pose. CHECKING runs a filter from there and sees
whether further bearings fit and the search, which goes on, finds the same pose again. TRUSTED is
what a known start begins with. When most bearings do not fit any more the pose is lost, as after
the robot was carried elsewhere, and the search begins anew.
"""

from collections.abc import Mapping, Sequence
from enum import Enum

import numpy as np

from config import fleet
from onboard.estimate.beliefs import PoseBelief
from onboard.estimate.consistency import Consistency
from onboard.estimate.localiser import (
    KnownRate,
    LandmarkBearing,
    Mounting,
    Trust,
    UpdateOutcome,
    UpdateResult,
)
from onboard.estimate.localiser_ekf import PoseFilter
from onboard.estimate.localiser_motion import Input
from onboard.estimate.pose_search import PoseSearch

CHECKED_BEARINGS = 12
"""A pose found from nothing is trusted after so many bearings that fit ..."""

CHECKED_SHARE = 0.8
"""... and when no more than the rest do not; with more misfits than fits it is dropped."""

CONFIRMATIONS = 3
"""So often must the window tell the same pose again, half a second and more apart."""

TRUSTED_HEADING_STD_RAD = 0.2


class Stage(Enum):
    """How far the localiser is."""

    SEARCHING = "searching"
    CHECKING = "checking"
    TRUSTED = "trusted"


class GaussianLocaliser:
    """See the module; no clock: `time_s` is the sum of the prediction steps."""

    def __init__(
        self,
        settings: fleet.Localiser,
        wheelbase_m: float,
        mounting: Mounting,
        landmarks: Mapping[int, tuple[float, float]],
        start: fleet.Pose,
        start_steering_rad: float = 0.0,
        known_rate: KnownRate = "steering",
    ) -> None:
        """`landmarks` maps ids to (x, y) [m]; `start` counts where settings say it is known."""
        self.time_s = 0.0
        self._settings = settings
        self._car = (settings, wheelbase_m, mounting, dict(landmarks), known_rate)
        self._landmarks = dict(landmarks)
        self._steering_rad = start_steering_rad
        self._rejected = 0
        self._fitted = self._misfitted = 0
        self._confirmed = 0
        self._lost_because: str | None = None
        self._since_s: float | None = None
        self._consistency = Consistency()
        self._filter: PoseFilter | None = None
        self._search: PoseSearch | None = None
        if settings.start == "known":
            self._stage = Stage.TRUSTED
            self._since_s = 0.0
            std = (settings.start_std_m, settings.start_std_m, settings.start_std_rad)
            pose = (start.x_m, start.y_m, start.heading_rad + start_steering_rad)
            self._filter = PoseFilter.around(*self._car, pose, np.diag(std), start_steering_rad)
        else:
            self._begin_search()

    def predict(self, dt_s: float, speed_mps: float, rate_radps: float) -> None:
        """Advance by `dt_s` with front-wheel speed and d delta/dt (or d eta/dt, as made)."""
        self.time_s += dt_s
        given = Input(dt_s, speed_mps, rate_radps)
        if self._filter is not None:
            self._filter.predict(given)
            self._steering_rad = self._filter.steering_rad
        if self._search is not None:
            self._search.predict(given)

    def measure_steering(self, steering_rad: float) -> None:
        """The steering encoder's angle now."""
        if self._filter is not None:
            self._filter.measure_steering(steering_rad)
        if self._search is not None:
            self._search.measure_steering(steering_rad)
        self._steering_rad = steering_rad

    def update(self, bearings: Sequence[LandmarkBearing]) -> UpdateResult:
        """Use bearings (5) to landmarks, each at its capture time."""
        known = [seen for seen in bearings if seen.landmark_id in self._landmarks]
        unknown = tuple(b.landmark_id for b in bearings if b.landmark_id not in self._landmarks)
        if not known:
            return UpdateResult(UpdateOutcome.NO_BEARINGS, unknown)
        if self._search is not None:
            for seen in known:
                self._search.add(seen)
            if self._search.due():
                self._look_for_pose(self._search)
        if self._filter is None:
            return UpdateResult(UpdateOutcome.SEARCHING, unknown)
        fitted = self._use(self._filter, known)
        if self._stage is Stage.CHECKING:
            self._check(self._filter)
        elif self._consistency.lost:
            self._lose()
        outcome = UpdateOutcome.UPDATED if fitted else UpdateOutcome.DIVERGED
        return UpdateResult(outcome, unknown)

    def estimate(self) -> PoseBelief | None:
        """The present belief; None while searching."""
        return None if self._filter is None else self._filter.estimate()

    def particles(self, count: int) -> list[tuple[float, float]]:
        """This filter has none."""
        return []

    def trust(self) -> Trust:
        """Trusted from a known start on, or from when a found pose has been confirmed."""
        trusted = self._stage is Stage.TRUSTED
        return Trust(
            trusted=trusted,
            reason="" if trusted else self._reason(),
            since_s=self._since_s if trusted else None,
            lost=self._lost_because is not None,
            hypotheses=1 if self._search is None else self._search.hypotheses,
            rejected=self._rejected,
            nis_median=self._consistency.nis_median,
            bias_rad=0.0 if self._filter is None else self._filter.bias_rad,
        )

    def _reason(self) -> str:
        assert self._search is not None, "only a search or a check is not trusted"
        if self._filter is None:
            told = self._search.reason
        else:
            told = (
                f"pose found, being checked: {self._fitted} bearings fit, "
                f"{self._misfitted} do not, {CHECKED_BEARINGS} that fit needed; told again "
                f"{self._confirmed} times, {CONFIRMATIONS} needed; position deviation "
                f"{self._filter.position_std_m:.2f} m, limit {self._settings.trusted_std_m:.2f} m"
            )
        return told if self._lost_because is None else f"{self._lost_because}; {told}"

    def _use(self, pose: PoseFilter, known: list[LandmarkBearing]) -> int:
        """Feed bearings to the filter; returns how many the gate let through."""
        fitted = 0
        for seen in known:
            innovation = pose.update(seen)
            fitted += innovation.accepted
            self._consistency.observe(seen.landmark_id, innovation.nis)
        self._consistency.judge(self.time_s)
        self._fitted += fitted
        self._misfitted += len(known) - fitted
        self._rejected += len(known) - fitted
        return fitted

    def _look_for_pose(self, search: PoseSearch) -> None:
        """Check the pose that the window tells, which is the better one the longer the window."""
        found = search.solve()
        if found is None:
            return
        pose = self._filter
        if pose is not None and found.agrees(pose.pose, pose.position_std_m):
            self._confirmed += 1
        else:
            self._stage, self._confirmed = Stage.CHECKING, 0
            self._fitted = self._misfitted = 0
            self._consistency = Consistency()
        self._filter = PoseFilter.around(*self._car, *found)

    def _check(self, pose: PoseFilter) -> None:
        """Trust the found pose, drop it, or look on."""
        seen = self._fitted + self._misfitted
        if seen < CHECKED_BEARINGS:
            return
        if self._misfitted > self._fitted:
            self._filter, self._stage = None, Stage.SEARCHING
        elif (
            self._confirmed >= CONFIRMATIONS
            and self._fitted >= CHECKED_SHARE * seen
            and pose.position_std_m <= self._settings.trusted_std_m
            and pose.heading_std_rad <= TRUSTED_HEADING_STD_RAD
        ):
            self._stage, self._search = Stage.TRUSTED, None
            self._since_s, self._lost_because = self.time_s, None

    def _lose(self) -> None:
        self._lost_because = (
            f"pose lost at {self.time_s:.1f} s: {self._consistency.high_share}; was the robot "
            "carried away, or are landmarks elsewhere than on the map? Carry it to its start and "
            "give `echelon at-start`, or drive it by hand until it finds its pose"
        )
        self._filter, self._since_s = None, None
        self._begin_search()

    def _begin_search(self) -> None:
        self._stage = Stage.SEARCHING
        self._search = PoseSearch(*self._car, self._steering_rad)
