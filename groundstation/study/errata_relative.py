"""Errata of the relative model (29)-(38), shown on one follower that holds its place exactly.

Law and plant use true values, without noise; only what is predicted or filtered differs.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from config.fleet import Point, Robot
from groundstation.study.effect import Effect
from groundstation.study.literal_law import Rates, predict, printed_rates
from groundstation.study.scenario import DT_S, Car, paper_fleet, planned_inputs, relative_truth
from onboard.control.formation import leader_frame_velocity
from onboard.control.steering import WheelSetpoint
from onboard.estimate.beliefs import RelativeBelief, RelativePrior
from onboard.estimate.factory import make_relative_filter
from onboard.model.relative import RelativeState, rear_axle_rates
from onboard.model.vehicle import AxleMotion, WheelMotion, axle_motion, wheel_motion

GAIN_PER_S = 2.0
JUDGED_FROM_S = 3.0
STD_RAD = 0.05
PREDICTED_S = 1.0


class Moment(NamedTuple):
    """Both cars (the same objects at every moment), and how fast each fork turns in the world."""

    time_s: float
    own: Car
    leader: Car
    own_fork_rate_radps: float
    leader_fork_rate_radps: float


def fork_rate_input() -> Effect:
    """Heading error after a switching of the leader's turn, by what the filter takes for omega."""
    return Effect(
        "fork-rate-input",
        "(29)-(38)",
        "omega of (3), the fork's rate, as yaw rate",
        "yaw rate v sin(delta)/d",
        "largest direction-angle error at the switchings, no noise",
        "rad",
        _peak_heading_error(mixed=True),
        _peak_heading_error(mixed=False),
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
        forks = own.state.fork_rad, leader.state.fork_rad
        leader.apply(inputs)
        own.drive(
            WheelSetpoint(math.atan2(wanted.left_mps, wanted.forward_mps), math.hypot(*wanted))
        )
        yield Moment(
            (step + 1) * DT_S,
            own,
            leader,
            (own.state.fork_rad - forks[0]) / DT_S,
            (leader.state.fork_rad - forks[1]) / DT_S,
        )


def _robots() -> tuple[Robot, Robot]:
    robots = paper_fleet().robots
    return robots["r2"], robots["r1"]


def _peak_heading_error(mixed: bool) -> float:
    """Largest error of the estimated alpha [rad] from `JUDGED_FROM_S` on."""
    me, leads = _robots()
    d, front = me.vehicle.wheelbase_m, me.markers[0]
    truth = relative_truth(Car(me.start, d, 0.0), Car(leads.start, d, 0.0))
    prior = RelativePrior(truth.range_m, 0.1, truth.bearing_rad, 0.05, truth.heading_rad, 0.05)
    estimator = make_relative_filter(me.relative_filter, d, d, prior)
    worst = 0.0
    for time_s, own, leader, own_rate, leader_rate in _moments():
        told = own.motion, leader.motion
        if mixed:
            told = _mixed(own.motion, own_rate, d), _mixed(leader.motion, leader_rate, d)
        estimator.predict(DT_S, *told)
        truth = relative_truth(own, leader)
        estimator.update_leader_marker(truth.bearing_rad, STD_RAD, front, 0.0)
        estimator.update_mutual(leader.bearing_to(own.place(front)), STD_RAD, front, 0.0)
        if time_s >= JUDGED_FROM_S:
            worst = max(worst, abs(estimator.estimate().heading_rad - truth.heading_rad))
    return worst


def _mixed(motion: WheelMotion, fork_rate_radps: float, wheelbase_m: float) -> WheelMotion:
    """The motion that has the fork rate for its yaw rate, at the same rear-axle speed."""
    axle_speed = axle_motion(motion, wheelbase_m).speed_mps
    return wheel_motion(AxleMotion(axle_speed, fork_rate_radps), wheelbase_m)


def _prediction_error(rates: Rates) -> float:
    """Bearing error [rad] of (29), predicted from the first moment with the cars' true motions."""
    d = _robots()[0].vehicle.wheelbase_m
    state, last = RelativeState(1.0, 0.0, 0.0), (WheelMotion(0.0, 0.0), WheelMotion(0.0, 0.0))
    truth = state
    for time_s, own, leader, *_ in _moments():
        truth, motions = _rear_view(own, leader, d), (leader.motion, own.motion)
        if time_s <= DT_S:
            state = truth
        else:
            leads, follows = (_mean(a, b, d) for a, b in zip(last, motions, strict=True))
            state = predict(state, leads, follows, DT_S, rates)
        last = motions
        if time_s >= PREDICTED_S:
            break
    return abs(math.remainder(state.bearing_rad - truth.bearing_rad, math.tau))


def _mean(before: WheelMotion, after: WheelMotion, wheelbase_m: float) -> AxleMotion:
    """The rear axle's motion over a step between two fork angles; the speed holds for the step."""
    steering = (before.steering_rad + after.steering_rad) / 2
    return axle_motion(WheelMotion(after.speed_mps, steering), wheelbase_m)


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
