"""Local observability of (10)-(28) by Lie-derivative rank, with the corrections of the errata.

State (x, y, eta, theta) of (3); every measurement h and its Lie derivatives along the vector
fields that the inputs allow must separate neighbouring states: the rank of their gradients is the
number of directions that can be told apart.

Errata. (20)-(23) mix the fork and the body convention and differentiate a row that was scaled by
R^2, which adds terms that are not there; "higher orders depend on lower ones" is false (a body
sensor and one landmark need order 2). Here nothing is scaled before it is differentiated, and
which rate is the known input is said: the fork's in the world, d eta/dt, as in (3), or the
steering motor's, d delta/dt, as on hardware. With the latter theta shows in fork bearings alone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Generic, NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.model.jets import Direction, Jet, Scalar, constant, cos_sin, direction_of, variable
from onboard.model.vehicle import VehicleState

MAX_ORDER = 3

Field = tuple[Jet[Scalar], ...]
"""A vector field: one component per state variable."""


class KnownRate(Enum):
    """Which rate of the fork is the known input."""

    FORK = "d eta/dt"
    STEERING = "d delta/dt"


class Mounting(Enum):
    """What the bearing sensor turns with."""

    FORK = "fork"
    BODY = "body"


class Sensing(NamedTuple):
    """What a robot measures besides its inputs."""

    mounting: Mounting
    known_rate: KnownRate
    encoder: bool


class Excitation(NamedTuple):
    """The inputs (speed, rate) that may be driven; every pair gives one vector field.

    Words over all fields are taken, so pairs that span the inputs stand for "any input at all".
    """

    inputs: tuple[tuple[int, int], ...]


MOVING = Excitation(((1, 0), (0, 1)))
"""Any speed and any rate: the observability of the robot, not of one drive."""

STANDING = Excitation(((0, 1),))
"""The fork may turn, the robot stands."""


def steady(speed: int, rate: int) -> Excitation:
    """One drive with constant inputs."""
    return Excitation(((speed, rate),))


class BasePose(NamedTuple, Generic[Scalar]):
    """State (3) with its angles by cosine and sine: exact over fractions."""

    x: Scalar
    y: Scalar
    fork: Direction[Scalar]
    heading: Direction[Scalar]


def base_pose(state: VehicleState) -> BasePose[float]:
    """An arbitrary state, for the path in floats."""
    return BasePose(state.x_m, state.y_m, _direction(state.fork_rad), _direction(state.heading_rad))


def _direction(angle_rad: float) -> Direction[float]:
    return Direction(float(np.cos(angle_rad)), float(np.sin(angle_rad)))


@dataclass(frozen=True, slots=True)
class System(Generic[Scalar]):
    """Measurements and vector fields as jets around one state."""

    measurements: list[Jet[Scalar]]
    fields: list[Field[Scalar]]
    zero: Scalar

    def rows(self, order: int) -> Iterator[list[list[Scalar]]]:
        """Gradients of the Lie derivatives of order 0, 1 ... `order`, each when it is asked for."""
        variables = len(self.fields[0])
        level = self.measurements
        yield [jet.gradient(variables, self.zero) for jet in level]
        for _ in range(order):
            level = [lie_derivative(jet, field) for jet in level for field in self.fields]
            yield [jet.gradient(variables, self.zero) for jet in level]


def lie_derivative(function: Jet[Scalar], field: Field[Scalar]) -> Jet[Scalar]:
    """L_f h = sum of dh/dx_i f_i, (13)."""
    terms = [function.derivative(i) * component for i, component in enumerate(field)]
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def landmark_system(
    sensing: Sensing,
    pose: BasePose[Scalar],
    wheelbase: Scalar,
    landmarks: Sequence[tuple[Scalar, Scalar]],
    excitation: Excitation,
    order: int = MAX_ORDER,
) -> System[Scalar]:
    """One robot among landmarks: bearings (5), the encoder's angle, and the fields of (3).

    Raises:
        ZeroDivisionError: a landmark is at the front-wheel midpoint.
    """
    zero, degree = wheelbase * 0, order + 1
    x, y = variable(0, pose.x, degree), variable(1, pose.y, degree)
    fork, heading = variable(2, zero, degree), variable(3, zero, degree)
    axis = fork if sensing.mounting is Mounting.FORK else heading
    measurements = [
        direction_of(constant(mark_x, degree) - x, constant(mark_y, degree) - y) - axis
        for mark_x, mark_y in landmarks
    ]
    if sensing.encoder:
        measurements.append(fork - heading)
    cos_fork, sin_fork = cos_sin(fork, pose.fork)
    _, sin_steering = cos_sin(fork - heading, _between(pose))
    yaw = sin_steering.scaled((zero + 1) / wheelbase)
    nothing, one = constant(zero, degree), constant(zero + 1, degree)
    fork_turn = yaw if sensing.known_rate is KnownRate.STEERING else nothing
    drive: Field[Scalar] = (cos_fork, sin_fork, fork_turn, yaw)
    turn: Field[Scalar] = (nothing, nothing, one, nothing)
    fields = [_mixed(drive, zero + v, turn, zero + w) for v, w in excitation.inputs]
    return System(measurements, fields, zero)


def _between(pose: BasePose[Scalar]) -> Direction[Scalar]:
    return pose.fork.plus(Direction(pose.heading.cos, -pose.heading.sin))


def _mixed(drive: Field[Scalar], v: Scalar, turn: Field[Scalar], w: Scalar) -> Field[Scalar]:
    return tuple(a.scaled(v) + b.scaled(w) for a, b in zip(drive, turn, strict=True))


def ranks(system: System[Fraction], order: int = MAX_ORDER) -> tuple[int, ...]:
    """Exact rank with Lie derivatives up to order 0, 1 ... `order`."""
    echelon: dict[int, list[Fraction]] = {}
    result: list[int] = []
    for level in system.rows(order):
        for row in level:
            _absorb(echelon, row)
        result.append(len(echelon))
        if len(echelon) == len(system.fields[0]):
            break
    return tuple(result + result[-1:] * (order + 1 - len(result)))


def rank(system: System[Fraction], order: int = MAX_ORDER) -> int:
    """Exact rank with all Lie derivatives up to `order`."""
    return ranks(system, order)[-1]


def lowest_order(system: System[Fraction], order: int = MAX_ORDER) -> int:
    """The least order that gives the rank which all up to `order` give."""
    found = ranks(system, order)
    return found.index(found[-1])


def unobservable(system: System[Fraction], order: int = MAX_ORDER) -> list[list[Fraction]]:
    """Basis of the directions that no Lie derivative up to `order` sees; empty at full rank."""
    echelon: dict[int, list[Fraction]] = {}
    for level in system.rows(order):
        for row in level:
            _absorb(echelon, row)
    variables = len(system.fields[0])
    basis = []
    for free in (i for i in range(variables) if i not in echelon):
        vector = [Fraction(int(i == free)) for i in range(variables)]
        for pivot in sorted(echelon, reverse=True):
            vector[pivot] = -sum(
                (echelon[pivot][i] * vector[i] for i in range(pivot + 1, variables)), Fraction(0)
            )
        basis.append(vector)
    return basis


def _absorb(echelon: dict[int, list[Fraction]], row: list[Fraction]) -> None:
    """Gaussian elimination, one row at a time; pivot rows are kept by column, with pivot 1."""
    for column in range(len(row)):
        if row[column] == 0:
            continue
        pivot = echelon.get(column)
        if pivot is None:
            echelon[column] = [value / row[column] for value in row]
            return
        factor = row[column]
        row = [value - factor * p for value, p in zip(row, pivot, strict=True)]


def singular_values(
    system: System[float], scales: Sequence[float], order: int = MAX_ORDER
) -> NDArray[np.float64]:
    """Singular values of the gradients, largest first, for states that are not exact.

    `scales` are the units in which each state variable counts (a length for positions, 1 for
    angles). Every row is scaled to length 1, which no rank depends on.
    """
    rows = np.array([row for level in system.rows(order) for row in level]) * np.asarray(scales)
    lengths = np.linalg.norm(rows, axis=1)
    kept = rows[lengths > 0] / lengths[lengths > 0, None]
    if not len(kept):
        return np.zeros(rows.shape[1])
    values = np.linalg.svd(kept, compute_uv=False)
    return np.pad(values, (0, rows.shape[1] - len(values)))


class BodyMotion(NamedTuple, Generic[Scalar]):
    """Velocity (a, b) of a robot's front point in its own body axes; it turns at b/d."""

    forward: Scalar
    left: Scalar


class Pairing(NamedTuple, Generic[Scalar]):
    """A leader at (x, y) in its follower's body axes, turned by alpha against the follower.

    `markers` are those of the leader that the follower sees, in the leader's body axes. `mutual`
    says that the leader sees the follower's front point, `heading_known` that alpha is measured.
    """

    x: Scalar
    y: Scalar
    heading: Direction[Scalar]
    markers: Sequence[tuple[Scalar, Scalar]]
    mutual: bool = False
    heading_known: bool = False


def relative_system(
    pairing: Pairing[Scalar],
    leader: BodyMotion[Scalar],
    own: BodyMotion[Scalar],
    wheelbase: Scalar,
    with_scale: bool = False,
    order: int = MAX_ORDER,
) -> System[Scalar]:
    """A leader seen from its follower under constant inputs, in place of (29)-(30).

    State (x, y, alpha), the leader's front point in the follower's body axes, and with
    `with_scale` the leader's speed scale epsilon. The rank is that of (rho, phi, alpha).

    Raises:
        ZeroDivisionError: a marker is at the follower's front point.
    """
    zero, degree = wheelbase * 0, order + 1
    x, y = variable(0, pairing.x, degree), variable(1, pairing.y, degree)
    alpha = variable(2, zero, degree)
    one = constant(zero + 1, degree)
    factor = one + variable(3, zero, degree) if with_scale else one
    cos, sin = cos_sin(alpha, pairing.heading)
    measurements = [
        direction_of(
            x + cos.scaled(mark_x) - sin.scaled(mark_y), y + sin.scaled(mark_x) + cos.scaled(mark_y)
        )
        for mark_x, mark_y in pairing.markers
    ]
    if pairing.mutual:
        measurements.append(direction_of(x, y) - alpha)
    if pairing.heading_known:
        measurements.append(alpha)
    yaw, own_yaw = leader.left / wheelbase, own.left / wheelbase
    ahead = cos.scaled(leader.forward) - sin.scaled(leader.left)
    aside = sin.scaled(leader.forward) + cos.scaled(leader.left)
    field: Field[Scalar] = (
        factor * ahead - one.scaled(own.forward) + y.scaled(own_yaw),
        factor * aside - one.scaled(own.left) - x.scaled(own_yaw),
        factor.scaled(yaw) - one.scaled(own_yaw),
    )
    still: Field[Scalar] = (constant(zero, degree),) if with_scale else ()
    return System(measurements, [field + still], zero)
