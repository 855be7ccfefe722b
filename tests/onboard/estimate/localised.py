"""A robot among landmarks, with odometry, encoder and bearings: the localiser tests' own world."""

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from config.fleet import Localiser, Pose
from onboard.estimate.beliefs import PoseBelief
from onboard.estimate.localiser import LandmarkBearing
from onboard.estimate.localiser_gaussian import GaussianLocaliser
from onboard.model.vehicle import WheelMotion
from tests.onboard.estimate.pair import STD, WHEELBASE, Body

DT = 0.02
SQUARE = {1: (4.0, 3.0), 2: (-4.0, 4.0), 3: (-3.0, -4.0), 4: (5.0, -3.0)}
Landmarks = Mapping[int, tuple[float, float]]
Noise = tuple[float, float]


@dataclass
class Robot:
    """The truth and its sensors. `noise` is the plant's, of position and heading per sqrt(s)."""

    landmarks: Landmarks
    rng: np.random.Generator
    body: Body
    mounting: Literal["body", "fork"] = "body"
    std: float = STD
    bias: float = 0.0
    speed_scale: float = 1.0
    noise: Noise = (0.0, 0.0)
    outliers: float = 0.0
    range_m: float = math.inf
    steering: float = 0.0
    time_s: float = 0.0
    past: deque[tuple[Body, float]] = field(default_factory=lambda: deque(maxlen=100))

    def move(self, localiser: GaussianLocaliser, speed: float, rate: float) -> None:
        """One step of DT, told to the localiser as odometry and encoder tell it."""
        self.past.append((Body(**vars(self.body)), self.steering))
        new = self.steering + rate * DT
        self.body.move(WheelMotion(speed, (self.steering + new) / 2), DT)
        self.steering = new
        self.time_s += DT
        if speed or rate:
            place, turn = (each * math.sqrt(DT) for each in self.noise)
            self.body.x += self.rng.normal(0.0, place)
            self.body.y += self.rng.normal(0.0, place)
            self.body.heading += self.rng.normal(0.0, turn)
        localiser.predict(DT, speed * self.speed_scale, rate)
        localiser.measure_steering(self.steering + self.rng.normal(0.0, 0.001))

    def look(self, late_steps: int = 0, only: Sequence[int] | None = None) -> list[LandmarkBearing]:
        """Bearings to all (or `only` some) landmarks within range, taken `late_steps` ago."""
        late_steps = min(late_steps, len(self.past))
        body, steering = self.past[-late_steps] if late_steps else (self.body, self.steering)
        axis = steering if self.mounting == "fork" else 0.0
        seen = []
        for number in self.landmarks if only is None else only:
            place = self.landmarks[number]
            bearing = body.bearing(place) - axis + self.bias + self.rng.normal(0.0, self.std)
            if self.rng.random() < self.outliers:
                bearing = self.rng.uniform(-math.pi, math.pi)
            if math.dist((body.x, body.y), place) < self.range_m:
                wrapped = math.remainder(bearing, math.tau)
                seen.append(LandmarkBearing(number, wrapped, self.std, late_steps * DT))
        return seen

    def error_m(self, belief: PoseBelief) -> float:
        """Distance between the belief's mean and the truth."""
        return math.hypot(belief.x_m - self.body.x, belief.y_m - self.body.y)

    def sigmas(self, belief: PoseBelief) -> float:
        """Mahalanobis distance of the position error."""
        covariance = np.reshape(belief.covariance, (4, 4))[:2, :2]
        off = np.array([belief.x_m - self.body.x, belief.y_m - self.body.y])
        return math.sqrt(float(off @ np.linalg.solve(covariance, off)))

    def nees(self, belief: PoseBelief) -> float:
        """Of the four states."""
        off = np.array([
            belief.x_m - self.body.x,
            belief.y_m - self.body.y,
            math.remainder(belief.fork_rad - self.body.heading - self.steering, math.tau),
            math.remainder(belief.heading_rad - self.body.heading, math.tau),
        ])  # fmt: skip
        return float(off @ np.linalg.solve(np.reshape(belief.covariance, (4, 4)), off))


def lost_robot(seed: int, landmarks: Landmarks) -> Robot:
    """Somewhere within 3 m of the middle, in any direction, 1 % off in its odometry."""
    rng = np.random.default_rng(seed)
    x, y, heading = rng.uniform((-3.0, -3.0, -math.pi), (3.0, 3.0, math.pi)).tolist()
    return Robot(landmarks, rng, Body(x, y, heading), speed_scale=1.01)


def localiser_of(robot: Robot, **settings: object) -> GaussianLocaliser:
    """Ours, told the robot's steering angle and, with `start="known"`, where it stands."""
    body = robot.body
    return GaussianLocaliser(
        Localiser.model_validate(settings),
        WHEELBASE,
        robot.mounting,
        robot.landmarks,
        Pose(x_m=body.x, y_m=body.y, heading_rad=math.remainder(body.heading, math.tau)),
        robot.steering,
    )


def wander(robot: Robot, speed: float, phase: float = 0.0) -> float:
    """Steering rate of a robot that swings its fork by half a radian either way."""
    if not speed:
        return 0.0
    wanted = 0.5 * math.sin(0.8 * robot.time_s + phase)
    return max(-1.5, min(1.5, 3.0 * (wanted - robot.steering)))


def drive(
    robot: Robot,
    localiser: GaussianLocaliser,
    seconds: float,
    speed: float = 0.5,
    only: Sequence[int] | None = None,
    late_steps: int = 0,
) -> Iterator[PoseBelief | None]:
    """Drive (or, with speed 0, stand) and look around; the belief after each step."""
    for _ in range(round(seconds / DT)):
        robot.move(localiser, speed, wander(robot, speed))
        localiser.update(robot.look(late_steps, only))
        yield localiser.estimate()


def covariance_of(belief: PoseBelief) -> NDArray[np.float64]:
    """The covariance as a matrix."""
    return np.reshape(belief.covariance, (4, 4))
