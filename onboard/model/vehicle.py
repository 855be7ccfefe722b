"""One car-like robot: the paper's models (3) and (4) and how their inputs relate.

Three different rates share the letter omega in the paper. Here `fork_rate` is d eta/dt, the rate
of the fork's absolute direction (3); `steering_rate` is d delta/dt, what a steering motor does (4);
`yaw_rate` is d theta/dt, what (29)-(38) mean.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar


class VehicleState(NamedTuple):
    """State of (3): front-wheel midpoint [m], fork direction eta and body heading theta [rad]."""

    x_m: float
    y_m: float
    fork_rad: float
    heading_rad: float


class RearAxleState(NamedTuple):
    """State of (4): rear-axle midpoint [m], body heading theta and steering angle delta [rad]."""

    x_m: float
    y_m: float
    heading_rad: float
    steering_rad: float


class WheelMotion(NamedTuple):
    """What the front wheel does: speed along its own direction [m/s] and steering angle [rad]."""

    speed_mps: float
    steering_rad: float


class AxleMotion(NamedTuple):
    """What the body does: speed of the rear axle [m/s] and yaw rate [rad/s]."""

    speed_mps: float
    yaw_rate_radps: float


class Displacement(NamedTuple):
    """Motion of the front point in the body axes at its start [m], and the body's turn [rad]."""

    forward_m: float
    left_m: float
    turn_rad: float


State = TypeVar("State", VehicleState, RearAxleState)


def front_drive_rates(
    state: VehicleState, speed_mps: float, fork_rate_radps: float, wheelbase_m: float
) -> VehicleState:
    """Time derivative of the state, paper (3): driven and steered front wheel."""
    return VehicleState(
        speed_mps * math.cos(state.fork_rad),
        speed_mps * math.sin(state.fork_rad),
        fork_rate_radps,
        speed_mps * math.sin(state.fork_rad - state.heading_rad) / wheelbase_m,
    )


def rear_drive_rates(
    state: RearAxleState, axle_speed_mps: float, steering_rate_radps: float, wheelbase_m: float
) -> RearAxleState:
    """Time derivative of the state, paper (4); its inputs are the rear axle's speed and d delta/dt.

    Singular where the steering angle is a right angle.
    """
    return RearAxleState(
        axle_speed_mps * math.cos(state.heading_rad),
        axle_speed_mps * math.sin(state.heading_rad),
        axle_speed_mps * math.tan(state.steering_rad) / wheelbase_m,
        steering_rate_radps,
    )


def step_midpoint(rates: Callable[[State], State], state: State, dt_s: float) -> State:
    """One midpoint (second-order Runge-Kutta) step; angles are not wrapped."""
    return _moved(state, rates(_moved(state, rates(state), dt_s / 2)), dt_s)


def step_rk4(rates: Callable[[State], State], state: State, dt_s: float) -> State:
    """One classical fourth-order Runge-Kutta step; angles are not wrapped."""
    k1 = rates(state)
    k2 = rates(_moved(state, k1, dt_s / 2))
    k3 = rates(_moved(state, k2, dt_s / 2))
    k4 = rates(_moved(state, k3, dt_s))
    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
    return _moved(state, type(state)._make(mean), dt_s)


def _moved(state: State, rate: State, dt_s: float) -> State:
    return type(state)._make([x + dt_s * dx for x, dx in zip(state, rate, strict=True)])


def yaw_rate(motion: WheelMotion, wheelbase_m: float) -> float:
    """Yaw rate r = v sin(delta)/d [rad/s], the last row of (3)."""
    return motion.speed_mps * math.sin(motion.steering_rad) / wheelbase_m


def axle_motion(motion: WheelMotion, wheelbase_m: float) -> AxleMotion:
    """Rear-axle speed u = v cos(delta) and yaw rate of a front-wheel motion."""
    return AxleMotion(
        motion.speed_mps * math.cos(motion.steering_rad), yaw_rate(motion, wheelbase_m)
    )


def wheel_motion(motion: AxleMotion, wheelbase_m: float) -> WheelMotion:
    """Front-wheel speed (not negative) and steering angle that give a motion of the rear axle."""
    sideways_mps = wheelbase_m * motion.yaw_rate_radps
    return WheelMotion(
        math.hypot(motion.speed_mps, sideways_mps), math.atan2(sideways_mps, motion.speed_mps)
    )


def fork_rate(steering_rate_radps: float, motion: WheelMotion, wheelbase_m: float) -> float:
    """Input omega = d eta/dt of (3) that goes with a steering motor's rate d delta/dt."""
    return steering_rate_radps + yaw_rate(motion, wheelbase_m)


def steering_rate(fork_rate_radps: float, motion: WheelMotion, wheelbase_m: float) -> float:
    """Steering motor's rate d delta/dt that goes with the input omega = d eta/dt of (3)."""
    return fork_rate_radps - yaw_rate(motion, wheelbase_m)


def displacement(motion: WheelMotion, wheelbase_m: float, dt_s: float) -> Displacement:
    """Motion of the front point over `dt_s` (may be negative) at constant speed and steering.

    Midpoint rule on (3): the path is replaced by a chord in its middle direction.
    """
    turn_rad = yaw_rate(motion, wheelbase_m) * dt_s
    path_m = motion.speed_mps * dt_s
    direction_rad = motion.steering_rad + turn_rad / 2
    return Displacement(
        path_m * math.cos(direction_rad), path_m * math.sin(direction_rad), turn_rad
    )
