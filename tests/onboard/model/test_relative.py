"""Leader-follower kinematics against numeric differentiation of two vehicles in the world."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from config.angles import wrap
from onboard.model.relative import (
    RelativeState,
    cartesian_rates,
    heading_from_mutual,
    marker_bearing,
    mutual_bearing,
    point_velocity,
    polar_rates,
    range_from_axis_marker,
    rear_axle_rates,
    transverse_speed,
)
from onboard.model.vehicle import WheelMotion, axle_motion, yaw_rate

LEADER_WHEELBASE, OWN_WHEELBASE = 0.3, 0.25
H = 1e-5


@dataclass(frozen=True)
class Car:
    """A front point and heading in the world, moving on its circle: test's own geometry."""

    x: float
    y: float
    heading: float
    speed: float
    steering: float
    wheelbase: float

    def after(self, t: float) -> "Car":
        turn = self.speed * math.sin(self.steering) / self.wheelbase
        x, y, steps = self.x, self.y, 20
        for i in range(steps):
            direction = self.heading + self.steering + turn * t * (i + 0.5) / steps
            x += self.speed * t / steps * math.cos(direction)
            y += self.speed * t / steps * math.sin(direction)
        heading = self.heading + turn * t
        return Car(x, y, heading, self.speed, self.steering, self.wheelbase)

    def point(self, px: float, py: float) -> complex:
        return complex(self.x, self.y) + complex(px, py) * complex(
            math.cos(self.heading), math.sin(self.heading)
        )

    @property
    def motion(self) -> WheelMotion:
        return WheelMotion(self.speed, self.steering)


def seen(own: Car, own_point: complex, target: complex) -> tuple[float, float]:
    line = target - own_point
    return abs(line), wrap(math.atan2(line.imag, line.real) - own.heading)


def state_of(leader: Car, own: Car, px: float = 0.0, py: float = 0.0) -> RelativeState:
    rho, phi = seen(own, own.point(0, 0), leader.point(px, py))
    return RelativeState(rho, phi, wrap(leader.heading - own.heading))


def rate_of(value: Callable[[float], float], angle: bool = False) -> float:
    difference = value(H) - value(-H)
    return (wrap(difference) if angle else difference) / (2 * H)


def cars(wheelbase: float) -> st.SearchStrategy[Car]:
    return st.builds(
        Car,
        st.floats(-1, 1),
        st.floats(-1, 1),
        st.floats(-3, 3),
        st.floats(0, 4),
        st.floats(-1.2, 1.2),
        st.just(wheelbase),
    )


leaders, followers = cars(LEADER_WHEELBASE), cars(OWN_WHEELBASE)
coordinates = st.floats(-0.4, 0.4)


@given(leader=leaders, own=followers, px=coordinates, py=coordinates)
def test_polar_rates_are_the_derivatives_of_the_geometry(
    leader: Car, own: Car, px: float, py: float
) -> None:
    state = state_of(leader, own, px, py)
    assume(state.range_m > 0.1)
    rates = polar_rates(
        state,
        point_velocity(leader.motion, LEADER_WHEELBASE, px, py),
        yaw_rate(leader.motion, LEADER_WHEELBASE),
        own.motion,
        OWN_WHEELBASE,
    )

    def at(t: float) -> RelativeState:
        return state_of(leader.after(t), own.after(t), px, py)

    assert rates.range_mps == pytest.approx(rate_of(lambda t: at(t).range_m), abs=1e-4)
    assert rates.bearing_radps == pytest.approx(
        rate_of(lambda t: at(t).bearing_rad, angle=True), abs=1e-3
    )
    assert rates.heading_radps == pytest.approx(
        rate_of(lambda t: at(t).heading_rad, angle=True), abs=1e-4
    )


@given(leader=leaders, own=followers)
def test_cartesian_rates_are_the_derivatives_of_the_geometry(leader: Car, own: Car) -> None:
    def at(t: float) -> tuple[float, float]:
        state = state_of(leader.after(t), own.after(t))
        return (
            state.range_m * math.cos(state.bearing_rad),
            state.range_m * math.sin(state.bearing_rad),
        )

    rates = cartesian_rates(
        *at(0.0),
        wrap(leader.heading - own.heading),
        point_velocity(leader.motion, LEADER_WHEELBASE),
        yaw_rate(leader.motion, LEADER_WHEELBASE),
        own.motion,
        OWN_WHEELBASE,
    )
    assert rates.x_mps == pytest.approx(rate_of(lambda t: at(t)[0]), abs=1e-4)
    assert rates.y_mps == pytest.approx(rate_of(lambda t: at(t)[1]), abs=1e-4)


@given(leader=leaders, own=followers)
def test_the_corrected_paper_model_holds_between_rear_axles(leader: Car, own: Car) -> None:
    def at(t: float) -> tuple[float, float]:
        moved_leader, moved = leader.after(t), own.after(t)
        return seen(moved, moved.point(-OWN_WHEELBASE, 0), moved_leader.point(-LEADER_WHEELBASE, 0))

    rho, phi = at(0.0)
    assume(rho > 0.1)
    rates = rear_axle_rates(
        RelativeState(rho, phi, wrap(leader.heading - own.heading)),
        axle_motion(leader.motion, LEADER_WHEELBASE),
        axle_motion(own.motion, OWN_WHEELBASE),
    )
    assert rates.range_mps == pytest.approx(rate_of(lambda t: at(t)[0]), abs=1e-4)
    assert rates.bearing_radps == pytest.approx(rate_of(lambda t: at(t)[1], angle=True), abs=1e-3)


@given(leader=leaders, own=followers, mx=coordinates, my=coordinates)
def test_marker_bearings_are_those_of_the_geometry(
    leader: Car, own: Car, mx: float, my: float
) -> None:
    state = state_of(leader, own)
    range_m, expected = seen(own, own.point(0, 0), leader.point(mx, my))
    assume(range_m > 1e-3)
    assert wrap(marker_bearing(state, mx, my) - expected) == pytest.approx(0.0, abs=1e-9)
    range_m, expected = seen(leader, leader.point(0, 0), own.point(mx, my))
    assume(range_m > 1e-3)
    assert wrap(mutual_bearing(state, mx, my) - expected) == pytest.approx(0.0, abs=1e-9)


@given(phi=st.floats(-3.1, 3.1), alpha=st.floats(-3.1, 3.1))
def test_mutual_bearings_give_the_relative_heading(phi: float, alpha: float) -> None:
    state = RelativeState(0.5, phi, alpha)
    recovered = heading_from_mutual(phi, mutual_bearing(state))
    assert wrap(recovered - alpha) == pytest.approx(0.0, abs=1e-9)


def test_range_follows_from_a_second_marker_once_the_heading_is_known() -> None:
    state = RelativeState(0.45, 0.7, 0.2)
    behind = marker_bearing(state, -0.25, 0.0)
    assert range_from_axis_marker(0.7, behind, 0.2, 0.25) == pytest.approx(0.45)


@given(leader=leaders, own=followers)
def test_transverse_speed_is_how_the_line_of_sight_turns_in_the_world(
    leader: Car, own: Car
) -> None:
    def direction(t: float) -> float:
        line = leader.after(t).point(0, 0) - own.after(t).point(0, 0)
        return math.atan2(line.imag, line.real)

    state = state_of(leader, own)
    assume(state.range_m > 0.1)
    q = transverse_speed(state, leader.motion, own.motion, LEADER_WHEELBASE)
    turning = rate_of(direction, angle=True)
    assert -q / state.range_m == pytest.approx(turning, abs=1e-3)
