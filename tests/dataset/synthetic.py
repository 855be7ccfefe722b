"""A small data set with known errors, in the files of MRCLAM: a unicycle among landmarks."""

import math
import random
from dataclasses import dataclass
from pathlib import Path

PERIOD_S = 0.02
RESPONSE_S = 0.2
EPOCH_S = 1_248_000_000.0
FOV_HALF_RAD = 0.6
LANDMARKS = {
    6: (0.0, 4.0),
    7: (3.0, 3.0),
    8: (4.5, 0.0),
    9: (3.0, -3.0),
    10: (0.0, -4.0),
    11: (-3.0, -3.0),
    12: (-4.5, 0.0),
    13: (-3.0, 3.0),
}
BARCODES = {1: 5, 2: 14} | {subject: 10 * subject + 1 for subject in LANDMARKS}


@dataclass(frozen=True, slots=True)
class Truth:
    """How the recorded robot errs. Scales are commanded over true; it responds after 0.2 s and
    loses a share of its speed per rad/s that it turns."""

    seconds: float = 40.0
    speed_scale: float = 1.05
    rate_scale: float = 0.95
    bearing_std_rad: float = 0.01
    bearing_bias_rad: float = 0.005
    turn_loss: float = 0.8
    seed: int = 1


class Unicycle:
    """Drives legs of 4 s: straight on, then a turn, now left, now right, some on the spot."""

    def __init__(self) -> None:
        self.x_m, self.y_m, self.heading_rad = 1.0, -1.0, 0.5

    @staticmethod
    def command(t_s: float) -> tuple[float, float]:
        """Forward and angular velocity."""
        leg = int(t_s / 4.0)
        if leg % 2 == 0:
            return 0.08, 0.1 if leg % 4 else -0.1
        return (0.0, 0.4) if leg % 4 == 1 else (0.05, -0.3)

    def step(self, t_s: float, turn_loss: float) -> None:
        """Move for one period."""
        speed, rate = self.command(t_s - RESPONSE_S) if t_s >= RESPONSE_S else (0.0, 0.0)
        speed *= 1.0 - turn_loss * abs(rate)
        middle = self.heading_rad + 0.5 * PERIOD_S * rate
        self.x_m += PERIOD_S * speed * math.cos(middle)
        self.y_m += PERIOD_S * speed * math.sin(middle)
        self.heading_rad += PERIOD_S * rate

    def bearing(self, place: tuple[float, float]) -> float:
        """Bearing to a point, wrapped."""
        angle = math.atan2(place[1] - self.y_m, place[0] - self.x_m) - self.heading_rad
        return math.remainder(angle, math.tau)


def write_data_set(folder: Path, truth: Truth | None = None, range_m: float = 1.0) -> None:
    """All files of a set with one robot; every range is `range_m`."""
    truth = truth or Truth()
    rng = random.Random(truth.seed)
    robot = Unicycle()
    odometry, measurements, poses = [], [], []
    for step in range(round(truth.seconds / PERIOD_S)):
        t_s = step * PERIOD_S
        stamp = f"{EPOCH_S + t_s:.3f}"
        speed, rate = robot.command(t_s)
        odometry.append(f"{stamp}\t{speed * truth.speed_scale:.5f}\t{rate * truth.rate_scale:.5f}")
        poses.append(f"{stamp}\t{robot.x_m:.6f}\t{robot.y_m:.6f}\t{_wrapped(robot):.6f}")
        if step % 10 == 5:
            for subject, place in LANDMARKS.items():
                bearing = robot.bearing(place)
                if abs(bearing) < FOV_HALF_RAD:
                    bearing += truth.bearing_bias_rad + rng.gauss(0.0, truth.bearing_std_rad)
                    barcode = BARCODES[subject]
                    measurements.append(f"{stamp}\t{barcode}\t{range_m:.3f}\t{bearing:.4f}")
        robot.step(t_s, truth.turn_loss)
    _write(folder / "Robot1_Odometry.dat", odometry)
    _write(folder / "Robot1_Measurement.dat", measurements)
    _write(folder / "Robot1_Groundtruth.dat", poses)
    _write(folder / "Barcodes.dat", [f"{s}\t{b}" for s, b in BARCODES.items()])
    _write(
        folder / "Landmark_Groundtruth.dat",
        [f"{s}\t{x:.4f}\t{y:.4f}\t0.0001\t0.0001" for s, (x, y) in LANDMARKS.items()],
    )


def _wrapped(robot: Unicycle) -> float:
    return math.remainder(robot.heading_rad, math.tau)


def _write(path: Path, lines: list[str]) -> None:
    path.write_text("\n".join(["# made by a test", *lines, ""]), encoding="utf-8")
