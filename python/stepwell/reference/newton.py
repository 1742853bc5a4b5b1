"""Newton's method for implicit steps, in a fixed number of passes, all with the Jacobian of the start of the step.

An increment d of the state is sought for which a residual is zero. The first pass is exact for a linear system, and each later
one leaves of the error a share of the order of h², by which the Jacobian changes within the step.
"""

from __future__ import annotations

from collections.abc import Callable

from ..base.arrays import Array, Blocks, Scaled
from . import mass
from .implicit import Implicit

#: How many passes there are.
PASSES = 3


def solved(s: Scaled, t: float, blocks: Blocks, gamma: float, at_zero: Blocks, rates: Callable[[Array, Array], Blocks]) -> Blocks:
    """The increments of both blocks, from h times the rates of the step's start and of any other increment.

    The residual is those rates, less the increment times the mass matrix, if the system has one.
    """
    equations = Implicit(s, t, *blocks)
    dv, dy = equations.solve(gamma, *at_zero)
    for _ in range(1, PASSES):
        rate_v, rate_y = rates(dv, dy)
        more_v, more_y = equations.solve(gamma, rate_v - dv, rate_y - mass.times(s, dy))
        dv, dy = dv + more_v, dy + more_y
    return dv, dy
