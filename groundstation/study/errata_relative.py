"""Errata of the relative model (29)-(38), shown on one follower that holds its place exactly.

Law and plant use true values, without noise; only what is predicted or filtered differs.
"""

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

from config.fleet import PaperFilter, Point, RelativeFilter, Robot
from groundstation.study.effect import Effect
from groundstation.study.literal_law import Rates, predict, printed_rates
from groundstation.study.scenario import DT_S, Car, paper_fleet, planned_inputs, relative_truth
from onboard.control.formation import leader_frame_velocity
from onboard.control.steering import WheelSetpoint
from onboard.estimate.beliefs import RelativeBelief, RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.model.relative import RelativeState, rear_axle_rates
from onboard.model.vehicle import WheelMotion, axle_motion

GAIN_PER_S = 2.0
JUDGED_FROM_S, JUDGED_TO_S = 3.0, 5.0
KNOWN_START_VARIANCE = 1e-4
"""In place of the paper's P = 1.13, whose start-up errors would cover the switchings'."""
STD_RAD = 0.05
PREDICTED_S = 1.0


class Moment(NamedTuple):
    """Both cars after a step (the same objects at every moment), and their motions during it."""

    time_s: float
    own: Car
    leader: Car
    own_motion: WheelMotion
    leader_motion: WheelMotion


def fork_rate_input() -> Effect:
    """Heading error after a switching of the leader's turn, by what the filter takes for omega."""
    return Effect(
        "fork-rate-input",
        "(29)-(38)",
        "omega of (3), the fork's rate, as yaw rate of the paper's filter",
        "yaw rate v sin(delta)/d",
        "largest direction-angle error at the first switching, no noise",
        "rad",
        _peak_heading_error("fork"),
        _peak_heading_error("body"),
    )


def gamma_sign() -> Effect:
    """(29) with gamma = phi + alpha, as a prediction of robot 2's view over the first second."""
    return Effect(
        "gamma-sign",
        "(29), (30)",
        "gamma = phi + alpha",
        "phi - alpha",
        "error of the predicted bearing after 1 s of turning",
        "rad",
        _prediction_error(printed_rates),
        _prediction_error(rear_axle_rates),
    )


def _moments() -> Iterator[Moment]:
    """Leader and robot 2 of the fleet `paper` on the mission, from the start at 4 m/s."""
    me, leads = _robots()
    d = me.vehicle.wheelbase_m
    own, leader = Car(me.start, d, 0.0), Car(leads.start, d, 0.0)
    assert me.offset is not None, "robot 2 is a follower"
    plan = planned_inputs(paper_fleet().mission, d)
    own.speed_mps = leader.speed_mps = plan[0].speed_mps
    for step, inputs in enumerate(plan):
        belief = RelativeBelief(*relative_truth(own, leader), 0.0, ())
        wanted = leader_frame_velocity(belief, leader.motion, d, me.offset, GAIN_PER_S)
        before = own.motion.steering_rad, leader.motion.steering_rad
        leader.apply(inputs)
        own.drive(
            WheelSetpoint(math.atan2(wanted.left_mps, wanted.forward_mps), math.hypot(*wanted))
        )
        yield Moment(
            (step + 1) * DT_S, own, leader, _during(own, before[0]), _during(leader, before[1])
        )


def _during(car: Car, steering_before_rad: float) -> WheelMotion:
    """The speed holds for a step; of the fork's angles at its two ends, the mean."""
    return WheelMotion(car.speed_mps, (steering_before_rad + car.motion.steering_rad) / 2)


def _robots() -> tuple[Robot, Robot]:
    robots = paper_fleet().robots
    return robots["r2"], robots["r1"]


def _peak_heading_error(yaw_rate: Literal["body", "fork"]) -> float:
    """Largest error of alpha [rad] in the paper's own filter about the switching at 4 s."""
    me, leads = _robots()
    d, front = me.vehicle.wheelbase_m, me.markers[0]
    truth = relative_truth(Car(me.start, d, 0.0), Car(leads.start, d, 0.0))
    prior = RelativePrior(truth.range_m, 0.1, truth.bearing_rad, 0.05, truth.heading_rad, 0.05)
    settings = RelativeFilter(
        kind="paper", paper=PaperFilter(start_variance=KNOWN_START_VARIANCE, yaw_rate=yaw_rate)
    )
    estimator = make_relative_filter(settings, d, d, prior)
    worst = 0.0
    for time_s, own, leader, own_motion, leader_motion in _moments():
        estimator.predict(DT_S, own_motion, leader_motion)
        truth = relative_truth(own, leader)
        estimator.update_leader_marker(truth.bearing_rad, STD_RAD, front, 0.0)
        estimator.update_mutual(leader.bearing_to(own.place(front)), STD_RAD, front, 0.0)
        if time_s > JUDGED_TO_S:
            break
        if time_s >= JUDGED_FROM_S:
            worst = max(worst, abs(estimator.estimate().heading_rad - truth.heading_rad))
    return worst


def _prediction_error(rates: Rates) -> float:
    """Bearing error [rad] of (29), predicted from the first moment with the cars' true motions."""
    d = _robots()[0].vehicle.wheelbase_m
    moments = _moments()
    first = next(moments)
    state = truth = _rear_view(first.own, first.leader, d)
    for time_s, own, leader, own_motion, leader_motion in moments:
        state = predict(
            state, axle_motion(leader_motion, d), axle_motion(own_motion, d), DT_S, rates
        )
        truth = _rear_view(own, leader, d)
        if time_s >= PREDICTED_S:
            break
    return abs(math.remainder(state.bearing_rad - truth.bearing_rad, math.tau))


def _rear_view(own: Car, leader: Car, wheelbase_m: float) -> RelativeState:
    """The leader's rear-axle point seen from the follower's."""
    rear = Point(x_m=-wheelbase_m, y_m=0.0)
    (x, y), (to_x, to_y) = own.place(rear), leader.place(rear)
    direction = math.atan2(to_y - y, to_x - x)
    own_heading, heading = own.state.heading_rad, leader.state.heading_rad
    return RelativeState(
        math.hypot(to_x - x, to_y - y),
        math.remainder(direction - own_heading, math.tau),
        heading - own_heading,
    )
