"""Bearings that come late and in any order count for when they were taken."""

import math
import random
from collections.abc import Callable
from typing import NamedTuple

import pytest

from config.fleet import Point
from config.fleet import RelativeFilter as Settings
from onboard.estimate.beliefs import RelativeBelief, RelativeFilter, RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.estimate.motion_history import MotionHistory
from onboard.model.vehicle import Displacement, WheelMotion
from tests.onboard.estimate.pair import DT, FRONT, REAR, WHEELBASE, Body, Pair, make_pair

STD = 0.02
MAX_LATE_STEPS = 15
PRIOR = RelativePrior(0.45, 0.1, math.pi / 4, 0.1, 0.0, 0.1)


def weaving(step: int) -> tuple[WheelMotion, WheelMotion]:
    """Own and leader's motion: both turn hard and change speed within the ages tested."""
    phase = step * DT * math.tau / 0.4
    own = WheelMotion(2.0 + 0.8 * math.sin(phase), 0.3 * math.cos(phase))
    return own, WheelMotion(2.0 + 0.5 * math.cos(phase), -0.3 * math.sin(phase))


@pytest.mark.parametrize("age_ms", [0, 10, 25, 70, 150])
def test_recorded_motions_lead_back_to_where_the_robots_were(age_ms: int) -> None:
    """Against poses moved along exact circles; chords of 10 ms differ from them by micrometres."""
    history = MotionHistory(WHEELBASE, WHEELBASE)
    own, leader = Body(1.0, -2.0, 0.4), Body(0.0, 0.0, 2.0)
    fine, past = 10, [(Body(**vars(own)), Body(**vars(leader)))]
    for step in range(60):
        motions = weaving(step)
        history.advance(DT, *motions)
        for _ in range(fine):
            own.move(motions[0], DT / fine)
            leader.move(motions[1], DT / fine)
            past.append((Body(**vars(own)), Body(**vars(leader))))
    was_own, was_leader = past[-1 - round(age_ms / 1000 / DT * fine)]
    back = history.back(age_ms / 1000)
    for now, was, displacement in ((own, was_own, back.own), (leader, was_leader, back.leader)):
        assert reached(now, displacement) == pytest.approx((was.x, was.y, was.heading), abs=1e-4)


def reached(body: Body, by: Displacement) -> tuple[float, float, float]:
    place = body.place(Point(x_m=by.forward_m, y_m=by.left_m))
    return (*place, body.heading + by.turn_rad)


def test_beyond_the_record_the_oldest_motion_stands_in() -> None:
    history = MotionHistory(WHEELBASE, WHEELBASE)
    straight = WheelMotion(1.0, 0.0)
    for _ in range(10):
        history.advance(DT, straight, straight)
    assert history.back(3.0).own.forward_m == pytest.approx(-3.0)
    for _ in range(1000):
        history.advance(DT, straight, straight)
    assert history.back(0.2).own.forward_m == pytest.approx(-0.2)


class Bearing(NamedTuple):
    """One measurement: when it was taken, when it arrives, and what it says."""

    taken: int
    arrives: int
    mutual: bool
    marker: Point
    value: float


def measured(pair: Pair, step: int, late: Callable[[], int], noise: random.Random) -> list[Bearing]:
    leader, own = pair.leader, pair.own
    found = []
    for marker in (FRONT, REAR):
        for mutual in (False, True):
            true = (
                leader.bearing(own.place(marker)) if mutual else own.bearing(leader.place(marker))
            )
            value = math.remainder(true + noise.gauss(0.0, STD), math.tau)
            found.append(Bearing(step, step + late(), mutual, marker, value))
    return found


def run(late: Callable[[], int], told_age: bool = True) -> tuple[RelativeBelief, float]:
    """Three seconds of weaving, then a last stretch in which everything arrives.

    Returns the belief and the RMS of its bearing's error over the drive.
    """
    pair, noise = make_pair(seed=1), random.Random(7)
    f: RelativeFilter = make_relative_filter(Settings(), WHEELBASE, WHEELBASE, PRIOR)
    pending: list[Bearing] = []
    squares = []
    for step in range(300 + MAX_LATE_STEPS):
        own, leader = weaving(step)
        pair.move(own, leader)
        f.predict(DT, own, leader)
        if step < 300:
            pending += measured(pair, step, late, noise)
        for each in [b for b in pending if b.arrives == step]:
            age_s = (step - each.taken) * DT if told_age else 0.0
            update = f.update_mutual if each.mutual else f.update_leader_marker
            update(each.value, STD, each.marker, age_s)
        pending = [b for b in pending if b.arrives > step]
        _, phi, _ = pair.truth()
        squares.append(math.remainder(f.estimate().bearing_rad - phi, math.tau) ** 2)
    return f.estimate(), math.sqrt(sum(squares[100:]) / len(squares[100:]))


def test_a_shuffled_late_stream_gives_nearly_the_estimate_of_the_punctual_one() -> None:
    shuffle = random.Random(3)
    punctual, punctual_rms = run(lambda: 0)
    late, late_rms = run(lambda: shuffle.randint(0, MAX_LATE_STEPS))
    assert late.range_m == pytest.approx(punctual.range_m, abs=punctual.range_std_m)
    for i, name in ((1, "bearing_rad"), (2, "heading_rad")):
        std = math.sqrt(punctual.covariance[5 * i])
        assert getattr(late, name) == pytest.approx(getattr(punctual, name), abs=1.5 * std)
    assert late_rms < 2 * punctual_rms


def test_without_their_ages_the_same_bearings_mislead() -> None:
    shuffle = random.Random(3)
    _, told = run(lambda: shuffle.randint(0, MAX_LATE_STEPS))
    _, untold = run(lambda: shuffle.randint(0, MAX_LATE_STEPS), told_age=False)
    assert untold > 3 * told
