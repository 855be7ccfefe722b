"""The paper's law (36) as printed, on the rear-axle model (29): what the errata are shown with.

The inputs are the follower's rear-axle speed and yaw rate, applied at once and without limits.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from onboard.model.relative import RelativeRates, RelativeState, rear_axle_rates
from onboard.model.vehicle import AxleMotion

Rates = Callable[[RelativeState, AxleMotion, AxleMotion], RelativeRates]


class Law(NamedTuple):
    """Desired range and bearing, and the gains of (37)."""

    range_m: float
    bearing_rad: float
    range_gain_per_s: float
    bearing_gain_per_s: float

    def command(self, state: RelativeState, leader: AxleMotion) -> AxleMotion:
        """U_2 of (36), with gamma = phi - alpha; raises ZeroDivisionError with the leader abeam."""
        rho, phi, alpha = state
        gamma = phi - alpha
        c1 = self.range_gain_per_s * (self.range_m - rho)
        c2 = self.bearing_gain_per_s * math.remainder(self.bearing_rad - phi, math.tau)
        speed = (leader.speed_mps * math.cos(gamma) - c1) / math.cos(phi)
        turn = (speed * math.sin(phi) - leader.speed_mps * math.sin(gamma)) / rho - c2
        return AxleMotion(speed, turn)


class Moment(NamedTuple):
    """The relative state and what the law commanded there."""

    state: RelativeState
    command: AxleMotion


def follow(
    law: Law, start: RelativeState, leader: Iterable[AxleMotion], dt_s: float
) -> list[Moment]:
    """The corrected (29) under the law, one moment per step of the leader's motion."""
    state, moments = start, []
    for motion in leader:
        command = law.command(state, motion)
        moments.append(Moment(state, command))
        state = predict(state, motion, command, dt_s, rear_axle_rates)
    return moments


def predict(
    state: RelativeState, leader: AxleMotion, own: AxleMotion, dt_s: float, rates: Rates
) -> RelativeState:
    """One midpoint step under both robots' motions; angles are not wrapped."""
    first = rates(state, leader, own)
    middle = RelativeState(*(x + dt_s / 2 * dx for x, dx in zip(state, first, strict=True)))
    second = rates(middle, leader, own)
    return RelativeState(*(x + dt_s * dx for x, dx in zip(state, second, strict=True)))


def printed_rates(state: RelativeState, leader: AxleMotion, own: AxleMotion) -> RelativeRates:
    """(29) as printed, with gamma = phi + alpha."""
    return rear_axle_rates(state._replace(heading_rad=-state.heading_rad), leader, own)
