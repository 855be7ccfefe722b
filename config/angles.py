"""The angle convention of the whole stack: radians, anticlockwise positive, in (-pi, pi]."""

import math


def wrap(angle_rad: float) -> float:
    """Wrap an angle [rad] into (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped
