"""Truncated power series in several variables ("jets"), exact over fractions or fast over floats.

A jet holds a function's Taylor coefficients around a base point up to a total degree. Sums,
products and the functions below act on the coefficients, so derivatives of any order come out
without symbols and, over `Fraction`, without rounding.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Generic, TypeVar

Scalar = TypeVar("Scalar", Fraction, float)

# A monomial is one int: three bits for each variable's exponent and the total degree above them,
# so that multiplying monomials is adding ints. Degrees up to 7 fit.
_BITS = 3
_VARIABLES = 5
_DEGREE = _BITS * _VARIABLES
MAX_DEGREE = (1 << _BITS) - 1


class Jet(Generic[Scalar]):
    """Taylor polynomial up to total degree `degree`; coefficients by monomial, zeros left out."""

    __slots__ = ("degree", "terms")

    def __init__(self, degree: int, terms: dict[int, Scalar]) -> None:
        self.degree: int = degree
        self.terms: dict[int, Scalar] = terms

    def __add__(self, other: "Jet[Scalar]") -> "Jet[Scalar]":
        degree = min(self.degree, other.degree)
        terms: dict[int, Scalar] = {m: c for m, c in self.terms.items() if m >> _DEGREE <= degree}
        for monomial, coefficient in other.terms.items():
            if monomial >> _DEGREE <= degree:
                known = terms.get(monomial)
                terms[monomial] = coefficient if known is None else known + coefficient
        return Jet(degree, {m: c for m, c in terms.items() if c != 0})

    def __neg__(self) -> "Jet[Scalar]":
        return Jet(self.degree, {m: -c for m, c in self.terms.items()})

    def __sub__(self, other: "Jet[Scalar]") -> "Jet[Scalar]":
        return self + -other

    def __mul__(self, other: "Jet[Scalar]") -> "Jet[Scalar]":
        degree = min(self.degree, other.degree)
        terms: dict[int, Scalar] = {}
        for left, a in self.terms.items():
            for right, b in other.terms.items():
                monomial = left + right
                if monomial >> _DEGREE <= degree:
                    known = terms.get(monomial)
                    terms[monomial] = a * b if known is None else known + a * b
        return Jet(degree, {m: c for m, c in terms.items() if c != 0})

    def scaled(self, factor: Scalar) -> "Jet[Scalar]":
        """The jet times a number."""
        return Jet(self.degree, {m: c * factor for m, c in self.terms.items()} if factor else {})

    def derivative(self, variable: int) -> "Jet[Scalar]":
        """Partial derivative; one degree less is known of it."""
        shift = _BITS * variable
        step = _monomial(variable)
        terms: dict[int, Scalar] = {}
        for monomial, coefficient in self.terms.items():
            exponent = monomial >> shift & MAX_DEGREE
            if exponent:
                terms[monomial - step] = coefficient * exponent
        return Jet(self.degree - 1, terms)

    def gradient(self, variables: int, zero: Scalar) -> list[Scalar]:
        """First derivatives at the base point; `zero` is the scalar for those that are absent."""
        return [self.terms.get(_monomial(variable), zero) for variable in range(variables)]


@dataclass(frozen=True, slots=True)
class Direction(Generic[Scalar]):
    """An angle by its cosine and sine, so that it can be exact."""

    cos: Scalar
    sin: Scalar

    def plus(self, other: "Direction[Scalar]") -> "Direction[Scalar]":
        """The sum of two angles."""
        return Direction(
            self.cos * other.cos - self.sin * other.sin, self.sin * other.cos + self.cos * other.sin
        )


def half_tangent(t: Fraction) -> Direction[Fraction]:
    """The angle 2 atan(t): every rational t gives a rational cosine and sine."""
    return Direction((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t))


def _monomial(variable: int) -> int:
    return (1 << _DEGREE) + (1 << _BITS * variable)


def constant(value: Scalar, degree: int) -> Jet[Scalar]:
    """A function that does not vary."""
    return Jet(degree, {0: value} if value else {})


def variable(number: int, value: Scalar, degree: int) -> Jet[Scalar]:
    """The coordinate `number`, which is `value` at the base point."""
    jet = constant(value, degree)
    jet.terms[_monomial(number)] = value * 0 + 1
    return jet


def cos_sin(angle: Jet[Scalar], base: Direction[Scalar]) -> tuple[Jet[Scalar], Jet[Scalar]]:
    """Cosine and sine of an angle that is `base` at the base point.

    `angle` is given as the deviation from there: its constant term is 0.
    """
    one = base.cos * 0 + 1
    cos, sin = constant(one, angle.degree), angle
    power, factorial = angle, 1
    for n in range(2, angle.degree + 1):
        power, factorial = power * angle, factorial * n
        term = power.scaled((one if n % 4 < 2 else -one) / factorial)
        if n % 2:
            sin = sin + term
        else:
            cos = cos + term
    return cos.scaled(base.cos) - sin.scaled(base.sin), sin.scaled(base.cos) + cos.scaled(base.sin)


def quotient(numerator: Jet[Scalar], denominator: Jet[Scalar]) -> Jet[Scalar]:
    """Division, by the geometric series around the denominator's value.

    Raises:
        ZeroDivisionError: the denominator is 0 at the base point.
    """
    value = denominator.terms.get(0)
    if value is None:
        raise ZeroDivisionError("the denominator is 0 at the base point")
    one = value / value
    rest = constant(one, denominator.degree) - denominator.scaled(one / value)
    series = power = constant(one, denominator.degree)
    for _ in range(denominator.degree):
        power = power * rest
        series = series + power
    return numerator.scaled(one / value) * series


def direction_of(x: Jet[Scalar], y: Jet[Scalar]) -> Jet[Scalar]:
    """atan2(y, x) less its value at the base point.

    Raises:
        ZeroDivisionError: x and y are both 0 at the base point.
    """
    zero = next(iter((x.terms or y.terms).values()), None)
    if zero is None:
        raise ZeroDivisionError("a point at distance 0 has no direction")
    zero = zero * 0
    x0, y0 = x.terms.get(0, zero), y.terms.get(0, zero)
    across, along = y.scaled(x0) - x.scaled(y0), x.scaled(x0) + y.scaled(y0)
    tangent = quotient(across, along)
    square = tangent * tangent
    angle, power = tangent, tangent
    for n in range(3, tangent.degree + 1, 2):
        power = power * square
        angle = angle + power.scaled((zero + (1 if n % 4 == 1 else -1)) / n)
    return angle
