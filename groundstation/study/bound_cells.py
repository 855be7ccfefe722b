"""The bound of figure 4, per number of landmarks, along each seed's true path."""

import msgspec
import numpy as np

from groundstation.study.bound import position_variance, riccati
from groundstation.study.leader_cells import (
    COUNTS,
    JUDGED_FROM_S,
    KEEP_EVERY,
    NOISE_PER_SQRT_S,
    START_STD,
    STD_RAD,
    short,
)
from groundstation.study.runner import Job
from groundstation.study.scenario import DT_S, landmark_positions, leader_truth, paper_fleet

BOUND_CELLS = {count: f"bound-{count}" for count in COUNTS}


class BoundResult(msgspec.Struct, frozen=True):
    """Variance of the position [m^2] every 50 ms, and its mean from 0.5 s on."""

    variance_m2: list[float]
    position_mse_m2: float


def run_bound(job: Job) -> BoundResult:
    """One seed with some landmarks."""
    source = paper_fleet()
    robot = next(robot for robot in source.robots.values() if robot.leader is None)
    truth = leader_truth(source, job.seed, NOISE_PER_SQRT_S, START_STD)
    landmarks = landmark_positions(source, int(job.cell.removeprefix("bound-")))
    variance = position_variance(
        riccati(
            truth.states,
            [inputs.speed_mps for inputs in truth.inputs],
            list(landmarks.values()),
            wheelbase_m=robot.vehicle.wheelbase_m,
            dt_s=DT_S,
            process_std=NOISE_PER_SQRT_S * DT_S**0.5,
            bearing_std_rad=STD_RAD,
            start_std=START_STD,
        )
    )
    judged = variance[round(JUDGED_FROM_S / DT_S) - 1 :]
    return BoundResult(short(variance[KEEP_EVERY - 1 :: KEEP_EVERY]), float(np.mean(judged)))
