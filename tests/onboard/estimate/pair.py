"""A leader and a follower in the world, with sensors: the tests' own simulation."""

import math
import random
from collections import deque
from dataclasses import dataclass, field

from config.fleet import Point
from onboard.estimate.beliefs import RelativeFilter
from onboard.model.vehicle import WheelMotion

WHEELBASE = 0.25
DT = 0.01
FRONT, REAR = Point(x_m=0.0, y_m=0.0), Point(x_m=-WHEELBASE, y_m=0.0)
STD = 0.05


@dataclass
class Body:
    """A car's front point and heading; moved exactly along its circle."""

    x: float
    y: float
    heading: float

    def move(self, motion: WheelMotion, dt: float) -> None:
        turn = motion.speed_mps * math.sin(motion.steering_rad) / WHEELBASE * dt
        direction = self.heading + motion.steering_rad + turn / 2
        half = turn / 2
        chord = motion.speed_mps * dt * (math.sin(half) / half if half else 1.0)
        self.x += chord * math.cos(direction)
        self.y += chord * math.sin(direction)
        self.heading += turn

    def place(self, point: Point) -> tuple[float, float]:
        c, s = math.cos(self.heading), math.sin(self.heading)
        return self.x + c * point.x_m - s * point.y_m, self.y + s * point.x_m + c * point.y_m

    def bearing(self, target: tuple[float, float]) -> float:
        direction = math.atan2(target[1] - self.y, target[0] - self.x)
        return math.remainder(direction - self.heading, math.tau)


@dataclass
class Pair:
    """Both robots; bearings come `latency` steps late."""

    leader: Body
    own: Body
    random: random.Random
    latency: int = 1
    std: float = STD
    past: deque[tuple[Body, Body]] = field(default_factory=lambda: deque(maxlen=10))

    def move(self, own: WheelMotion, leader: WheelMotion) -> None:
        self.past.append((Body(**vars(self.leader)), Body(**vars(self.own))))
        self.own.move(own, DT)
        self.leader.move(leader, DT)

    def observe(self, f: RelativeFilter) -> list[float]:
        """Feed two marker bearings and two mutual ones; the NIS of each."""
        leader, own = self.past[-self.latency] if self.latency else (self.leader, self.own)
        age = self.latency * DT
        nis = []
        for marker in (FRONT, REAR):
            seen = self._noisy(own.bearing(leader.place(marker)))
            nis.append(f.update_leader_marker(seen, self.std, marker, age).nis)
            back = self._noisy(leader.bearing(own.place(marker)))
            nis.append(f.update_mutual(back, self.std, marker, age).nis)
        return nis

    def truth(self) -> tuple[float, float, float]:
        """Range, bearing and relative heading."""
        rho = math.hypot(self.leader.x - self.own.x, self.leader.y - self.own.y)
        phi = self.own.bearing((self.leader.x, self.leader.y))
        return rho, phi, math.remainder(self.leader.heading - self.own.heading, math.tau)

    def _noisy(self, bearing: float) -> float:
        return math.remainder(bearing + self.random.gauss(0.0, self.std), math.tau)


def make_pair(seed: int, rho: float = 0.45, phi: float = math.pi / 4, alpha: float = 0.0) -> Pair:
    """A follower at the origin, heading 0.3 rad, and its leader."""
    own = Body(0.0, 0.0, 0.3)
    leader = Body(rho * math.cos(0.3 + phi), rho * math.sin(0.3 + phi), 0.3 + alpha)
    return Pair(leader, own, random.Random(seed))
