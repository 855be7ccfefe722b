"""What both robots did lately, so that a late bearing is met where they were at its capture."""

from collections import deque
from math import cos, sin
from typing import NamedTuple

from onboard.estimate.relative_model import Carry, carry
from onboard.model.vehicle import Displacement, WheelMotion

KEPT_S = 0.5
"""Motions older than this are forgotten; the oldest kept one stands in for them."""

_STILL = WheelMotion(0.0, 0.0)


class Spell(NamedTuple):
    """The motions that one prediction advanced with."""

    dt_s: float
    own: WheelMotion
    leader: WheelMotion


class MotionHistory:
    """Recorded inputs of a relative filter, newest last."""

    def __init__(self, own_wheelbase_m: float, leader_wheelbase_m: float) -> None:
        self._wheelbases_m = own_wheelbase_m, leader_wheelbase_m
        self._spells: deque[Spell] = deque()
        self._kept_s = 0.0
        self._newest = Spell(0.0, _STILL, _STILL)

    def advance(self, dt_s: float, own: WheelMotion, leader: WheelMotion) -> Carry:
        """Record the motions of the next `dt_s` and return the displacements over it."""
        spells = self._spells
        self._newest = Spell(dt_s, own, leader)
        spells.append(self._newest)
        self._kept_s += dt_s
        while len(spells) > 1 and self._kept_s - spells[0].dt_s >= KEPT_S:
            self._kept_s -= spells.popleft().dt_s
        return carry(own, leader, *self._wheelbases_m, dt_s)

    def back(self, age_s: float) -> Carry:
        """Displacements from now to `age_s` ago, each in its body's axes of now.

        The speed scale multiplies a displacement as a whole: turns within it that the scale error
        would change are of second order.
        """
        newest = self._newest
        if age_s <= newest.dt_s or len(self._spells) < 2:
            return carry(newest.own, newest.leader, *self._wheelbases_m, -age_s)
        total = carry(newest.own, newest.leader, *self._wheelbases_m, -newest.dt_s)
        left_s = age_s - newest.dt_s
        oldest = self._spells[0]
        for spell in list(self._spells)[-2::-1]:
            step_s = left_s if spell is oldest else min(left_s, spell.dt_s)
            step = carry(spell.own, spell.leader, *self._wheelbases_m, -step_s)
            total = Carry(_joined(total.own, step.own), _joined(total.leader, step.leader))
            left_s -= step_s
            if left_s <= 0.0:
                break
        return total


def _joined(first: Displacement, second: Displacement) -> Displacement:
    """First one motion, then another that is given in the axes where the first one ends."""
    c, s = cos(first.turn_rad), sin(first.turn_rad)
    return Displacement(
        first.forward_m + c * second.forward_m - s * second.left_m,
        first.left_m + s * second.forward_m + c * second.left_m,
        first.turn_rad + second.turn_rad,
    )
