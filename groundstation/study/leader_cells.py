"""Figure 4's runs on the core alone: one localiser, some landmarks, one seed.

All cells of a seed share the same true path, and a landmark's bearings have the same noise in each,
so the cells differ in nothing but filter and landmarks. Bearings are the fork's, as in (5).
"""

import math
from typing import NamedTuple

import msgspec
import numpy as np

from config import fleet
from groundstation.study.runner import Job
from groundstation.study.scenario import (
    DT_S,
    Floats,
    Truth,
    landmark_positions,
    leader_truth,
    measured_bearings,
    paper_fleet,
    true_bearings,
    wrapped,
)
from onboard.estimate.beliefs import PoseBelief
from onboard.estimate.localiser import LandmarkBearing, Localiser
from onboard.estimate.localiser_factory import make_localiser

COUNTS = (0, 1, 2, 3, 4)
FILTERS = {"paper": "the paper's filter, 500 particles", "ours": "our default, a Gaussian filter"}
KINDS = {"paper": "particle", "ours": "gaussian"}
STD_RAD = 0.05
NOISE_PER_SQRT_S, START_STD = 0.05, 0.05
KEEP_EVERY = 5
JUDGED_FROM_S = 0.5
STATES = 4
DIGITS = 6


class LeaderCell(NamedTuple):
    """Which filter and how many landmarks."""

    filter: str
    landmarks: int

    @property
    def name(self) -> str:
        """The cell's name in a store, such as leader-paper-2."""
        return f"leader-{self.filter}-{self.landmarks}"

    @classmethod
    def parse(cls, name: str) -> "LeaderCell":
        """The cell of that name."""
        _, kind, count = name.split("-")
        return cls(kind, int(count))


class LeaderResult(msgspec.Struct, frozen=True):
    """Errors every 50 ms, estimate minus truth, and means from 0.5 s on.

    `bearing_rad` is the RMS over the landmarks of the predicted bearing's error; `nees` has 4
    states, `nis` is per bearing (1 where the filter is honest); both empty of landmarks are None.
    """

    x_m: list[float]
    y_m: list[float]
    heading_rad: list[float]
    bearing_rad: list[float]
    position_mse_m2: float
    heading_mse_rad2: float
    nees: float
    nis: float | None


def run_leader(job: Job) -> LeaderResult:
    """One seed of one cell."""
    cell = LeaderCell.parse(job.cell)
    source = paper_fleet()
    landmarks = landmark_positions(source, cell.landmarks)
    truth = leader_truth(source, job.seed, NOISE_PER_SQRT_S, START_STD)
    true = true_bearings(truth.states[1:], list(landmarks.values()), "fork")
    measured = measured_bearings(true, job.seed, STD_RAD)
    localiser = _make(cell.filter, source, landmarks, job.seed)
    return _judged(_run(localiser, landmarks, truth, measured), truth, true, landmarks)


def _make(
    kind: str, source: fleet.Fleet, landmarks: dict[int, tuple[float, float]], seed: int
) -> Localiser:
    """A localiser with the paper's input and sensor, and without what the paper has not."""
    robot = next(robot for robot in source.robots.values() if robot.leader is None)
    settings = robot.localiser.model_copy(update={"kind": KINDS[kind], "encoder_std_rad": 0.0})
    sensor = robot.bearing_sensor.model_copy(update={"mounting": "fork"})
    changed = robot.model_copy(update={"localiser": settings, "bearing_sensor": sensor})
    return make_localiser(changed, landmarks, seed, known_rate="fork")


class _Sampled(NamedTuple):
    """Per kept step (rows): index of the state, belief, and NIS of the bearings then."""

    steps: list[int]
    beliefs: list[PoseBelief]
    nis: list[float]


def _run(
    localiser: Localiser,
    landmarks: dict[int, tuple[float, float]],
    truth: Truth,
    measured: Floats,
) -> _Sampled:
    sampled = _Sampled([], [], [])
    for step, (inputs, row) in enumerate(zip(truth.inputs, measured, strict=True), start=1):
        localiser.predict(DT_S, inputs.speed_mps, inputs.fork_rate_radps)
        keep = step % KEEP_EVERY == 0
        if keep and landmarks:
            sampled.nis.append(_nis(_belief(localiser), landmarks, row))
        if landmarks:
            bearings = zip(landmarks, row.tolist(), strict=True)
            localiser.update([LandmarkBearing(m, b, STD_RAD, 0.0) for m, b in bearings])
        if keep:
            sampled.steps.append(step)
            sampled.beliefs.append(_belief(localiser))
    return sampled


def _belief(localiser: Localiser) -> PoseBelief:
    belief = localiser.estimate()
    assert belief is not None, "the start is known"
    return belief


def _nis(belief: PoseBelief, landmarks: dict[int, tuple[float, float]], row: Floats) -> float:
    """Normalised innovation squared per bearing, with the measurement linearised at the mean."""
    marks = np.array(list(landmarks.values()))
    predicted = _bearings_of(belief, landmarks)
    dx, dy = belief.x_m - marks[:, 0], belief.y_m - marks[:, 1]
    square = dx**2 + dy**2
    jacobian = np.column_stack(
        [-dy / square, dx / square, -np.ones(len(marks)), np.zeros(len(marks))]
    )
    covariance = np.reshape(belief.covariance, (STATES, STATES))
    spread = jacobian @ covariance @ jacobian.T + STD_RAD**2 * np.eye(len(marks))
    innovation = wrapped(row - predicted)
    return float(innovation @ np.linalg.solve(spread, innovation)) / len(marks)


def _bearings_of(belief: PoseBelief, landmarks: dict[int, tuple[float, float]]) -> Floats:
    state = np.array([[belief.x_m, belief.y_m, belief.fork_rad, belief.heading_rad]])
    return true_bearings(state, list(landmarks.values()), "fork").reshape(-1)


def _judged(
    sampled: _Sampled, truth: Truth, true: Floats, landmarks: dict[int, tuple[float, float]]
) -> LeaderResult:
    means = np.array([belief[:STATES] for belief in sampled.beliefs])
    errors = means - truth.states[sampled.steps]
    errors[:, 2:] = wrapped(errors[:, 2:])
    covariances = np.array([belief.covariance for belief in sampled.beliefs])
    solved = np.linalg.solve(covariances.reshape(-1, STATES, STATES), errors[:, :, None])
    nees = np.einsum("ij,ij->i", errors, solved[:, :, 0])
    judged = np.array(sampled.steps) * DT_S >= JUDGED_FROM_S
    predicted = np.array([_bearings_of(belief, landmarks) for belief in sampled.beliefs])
    bearing = wrapped(predicted - true[np.array(sampled.steps) - 1])
    return LeaderResult(
        short(errors[:, 0]),
        short(errors[:, 1]),
        short(errors[:, 3]),
        short(np.sqrt(np.mean(bearing**2, axis=1))) if landmarks else [],
        float(np.mean(errors[judged, 0] ** 2 + errors[judged, 1] ** 2)),
        float(np.mean(errors[judged, 3] ** 2)),
        float(np.mean(nees[judged])),
        float(np.mean(np.array(sampled.nis)[judged])) if landmarks else None,
    )


def short(values: Floats) -> list[float]:
    """Six digits are plenty for a figure and keep the store small."""
    return [float(f"{value:.{DIGITS}g}") for value in values.tolist()]


def kept_times_s() -> Floats:
    """Mission times of the kept errors."""
    steps = round(paper_fleet().mission.duration_s / DT_S)
    kept = steps // KEEP_EVERY
    return np.linspace(KEEP_EVERY * DT_S, kept * KEEP_EVERY * DT_S, kept)


def rms(means_of_squares: list[float]) -> float:
    """Root of the mean over seeds."""
    return math.sqrt(sum(means_of_squares) / len(means_of_squares))
