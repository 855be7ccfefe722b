"""Makes the localiser that a fleet file asks for."""

from config import fleet
from onboard.estimate.localiser import KnownRate, Localiser
from onboard.estimate.localiser_gaussian import GaussianLocaliser
from onboard.estimate.localiser_particle import ParticleLocaliser


def make_localiser(
    robot: fleet.Robot,
    landmarks: dict[int, tuple[float, float]],
    seed: int,
    start_steering_rad: float = 0.0,
    known_rate: KnownRate = "steering",
) -> Localiser:
    """The localiser of kind `robot.localiser.kind`; `seed` is that of the particle filter."""
    settings, wheelbase_m = robot.localiser, robot.vehicle.wheelbase_m
    mounting, start = robot.bearing_sensor.mounting, robot.start
    if settings.kind == "particle":
        return ParticleLocaliser(
            settings, wheelbase_m, mounting, landmarks, start, seed, start_steering_rad, known_rate
        )
    return GaussianLocaliser(
        settings, wheelbase_m, mounting, landmarks, start, start_steering_rad, known_rate
    )
