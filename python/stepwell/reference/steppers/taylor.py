"""The Taylor series of the solution, to a fixed order (Jorba and Zou 2005)."""

from functools import reduce

from ...base.arrays import Array, Blocks, Scaled
from ..series import coefficients

#: The order of a step of fixed length.
ORDER = 8


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """The sum of the series at the end of the step, the smallest terms first."""
    terms = coefficients(s, ORDER, t, h, v, y)
    dv, dy = reduce(lambda total, term: (term[0] + total[0], term[1] + total[1]), reversed(terms))
    return v + dv, y + dy
