"""Errata of the formation law and its settings, (29)-(38) and section 4.1."""

import math

from config.fleet import Point
from groundstation.study.effect import Effect
from groundstation.study.literal_law import Law, follow
from groundstation.study.scenario import DT_S, paper_fleet, planned_inputs
from onboard.control.formation import leader_frame_velocity
from onboard.estimate.beliefs import RelativeBelief
from onboard.model.relative import RelativeState, point_velocity, polar_rates
from onboard.model.vehicle import AxleMotion, WheelMotion, axle_motion

RANGE_M, BEARING_RAD = 0.45, math.pi / 4
PAPER_GAINS, OUR_GAIN = (0.25, 0.10), 4.0
FIVE_QUARTER_PI = -3 * math.pi / 4
WHEELBASE_M = 0.25
STRAIGHT = WheelMotion(4.0, 0.0)
FINE_S = DT_S / 10


def literal_y3() -> Effect:
    """Robot 3 starting at y = +0.8, ahead of the robot that it follows."""
    starts = [_seen((-0.3, y), (-0.1, -0.3)) for y in (0.8, -0.8)]
    law = Law(RANGE_M, BEARING_RAD, *PAPER_GAINS)
    return Effect(
        "literal-y3",
        "section 4.1",
        "y3(0) = +0.8",
        "-0.8",
        "slowest speed that law (36) asks of robot 3 (it must not reverse)",
        "m/s",
        *(
            min(moment.command.speed_mps for moment in follow(law, start, _leader_motion(), DT_S))
            for start in starts
        ),
    )


def five_quarter_pi() -> Effect:
    """Desired bearing 5 pi/4 from the forward axis, started there but for 1 mrad of heading."""
    bearings = (FIVE_QUARTER_PI, BEARING_RAD)
    ends = []
    for bearing in bearings:
        start = RelativeState(RANGE_M, bearing, 1e-3)
        law = Law(RANGE_M, bearing, OUR_GAIN, OUR_GAIN)
        ends.append(
            follow(law, start, [axle_motion(STRAIGHT, WHEELBASE_M)] * 200, DT_S / 2)[-1].state
        )
    return Effect(
        "five-quarter-pi",
        "(36) and section 4.1",
        "phi = 5 pi/4 from the forward axis",
        "+pi/4",
        "relative heading after 1 s straight, from 0.001 rad",
        "rad",
        *(abs(end.heading_rad) for end in ends),
    )


def paper_gains() -> Effect:
    """Share of the first bearing error that is left at the mission's end."""
    start = _seen((-0.1, -0.3), (0.0, 0.0))
    left = []
    for gains in (PAPER_GAINS, (OUR_GAIN, OUR_GAIN)):
        end = follow(Law(RANGE_M, BEARING_RAD, *gains), start, _leader_motion(), DT_S)[-1].state
        share = (end.bearing_rad - BEARING_RAD) / (start.bearing_rad - BEARING_RAD)
        left.append(100 * share)
    return Effect(
        "paper-gains",
        "section 4.1",
        "k1 = 0.25, k2 = 0.10",
        "4 /s",
        "share of robot 2's first bearing error left after 9 s",
        "%",
        *left,
    )


def leader_abeam() -> Effect:
    """Swing from 60 to 120 degrees, past the leader abeam, at 4 m/s straight, in steps of 1 ms."""
    start, goal = RelativeState(RANGE_M, math.pi / 3, 0.0), 2 * math.pi / 3
    law = Law(RANGE_M, goal, 2.0, 2.0)
    motion = [axle_motion(STRAIGHT, WHEELBASE_M)] * 2000
    literal = max(abs(m.command.yaw_rate_radps) for m in follow(law, start, motion, FINE_S))
    return Effect(
        "leader-abeam",
        "(35)",
        "decoupling matrix always nonsingular",
        "leader_frame law",
        "largest yaw rate asked when the leader is passed abeam",
        "rad/s",
        literal,
        _leader_frame_yaw_rate(start, goal),
    )


def _leader_frame_yaw_rate(start: RelativeState, goal_rad: float) -> float:
    """Largest yaw rate of the leader-frame law on the same swing."""
    offset = Point(x_m=-RANGE_M * math.cos(goal_rad), y_m=-RANGE_M * math.sin(goal_rad))
    state, largest = start, 0.0
    for _ in range(2000):
        belief = RelativeBelief(*state, 0.0, ())
        forward, left = leader_frame_velocity(belief, STRAIGHT, WHEELBASE_M, offset, 2.0)
        own = WheelMotion(math.hypot(forward, left), math.atan2(left, forward))
        largest = max(largest, abs(left) / WHEELBASE_M)
        velocity = point_velocity(STRAIGHT, WHEELBASE_M)
        rates = polar_rates(state, velocity, 0.0, own, WHEELBASE_M)
        state = RelativeState(*(x + FINE_S * dx for x, dx in zip(state, rates, strict=True)))
    return largest


def _leader_motion() -> list[AxleMotion]:
    """Rear axle of the leader on the mission, per step."""
    delta, motions = 0.0, []
    for inputs in planned_inputs(paper_fleet().mission, WHEELBASE_M):
        motions.append(axle_motion(WheelMotion(inputs.speed_mps, delta), WHEELBASE_M))
        delta += inputs.steering_rate_radps * DT_S
    return motions


def _seen(follower: tuple[float, float], leader: tuple[float, float]) -> RelativeState:
    """The leader seen from the follower; both start with heading pi/4, as in the paper."""
    dx, dy = leader[0] - follower[0], leader[1] - follower[1]
    bearing = math.remainder(math.atan2(dy, dx) - math.pi / 4, math.tau)
    return RelativeState(math.hypot(dx, dy), bearing, 0.0)
