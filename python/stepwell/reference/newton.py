"""Newton's method for implicit steps, in a fixed number of passes, all with the Jacobian of the start of the step.

An increment d of the state is sought for which a residual is zero. The first pass is exact for a linear system, and each later
one leaves of the error a share of the order of h², by which the Jacobian changes within the step.
"""

from __future__ import annotations

from collections.abc import Callable

from ..base.arrays import Array, Blocks
from .implicit import Implicit

#: How many passes there are.
PASSES = 3


def solved(equations: Implicit, gamma: float, at_zero: Blocks, residual: Callable[[Array, Array], Blocks]) -> Blocks:
    """The increments of both blocks, from the residual at zero and that at any other increment: h times the rates, less it."""
    dv, dy = equations.solve(gamma, *at_zero)
    for _ in range(1, PASSES):
        more_v, more_y = equations.solve(gamma, *residual(dv, dy))
        dv, dy = dv + more_v, dy + more_y
    return dv, dy
