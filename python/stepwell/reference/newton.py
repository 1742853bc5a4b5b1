"""Newton's method for implicit steps, in a fixed number of passes, all with the Jacobian of the start of the step.

An increment d of the state is sought for which a residual is zero. The first pass is exact for a linear system, and each later
one leaves of the error a share of the order of h², by which the Jacobian changes within the step. Where that share is above 1, as
in a stiff rope that turns, passes lead away: the increment of the first one is kept, which no stiffness makes large.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.arrays import Array, Blocks, Scaled
from . import bits, mass
from .implicit import Implicit

#: How many passes there are.
PASSES = 3

#: The last correction is at most this share of the first, or the increment of the first pass is kept.
CONVERGES = 0.25


def solved(s: Scaled, t: float, blocks: Blocks, gamma: float, at_zero: Blocks, rates: Callable[[Array, Array], Blocks]) -> Blocks:
    """The increments of both blocks, from h times the rates of the step's start and of any other increment.

    The residual is those rates, less the increment times the mass matrix, if the system has one.
    """
    equations = Implicit(s, t, *blocks)
    first = last = dv, dy = equations.solve(gamma, *at_zero)
    for _ in range(1, PASSES):
        rate_v, rate_y = rates(dv, dy)
        last = equations.solve(gamma, rate_v - dv, rate_y - mass.times(s, dy))
        dv, dy = dv + last[0], dy + last[1]
    with np.errstate(over="ignore", invalid="ignore"):
        shorter, longest = equations.square(*last), equations.square(*(CONVERGES * each for each in first))
        if type(shorter).__le__ is vars(object)["__le__"]:
            return dv, dy  # polynomials, which have no order; the equations are linear then, and only the first pass changes them
        converges = bits.at_most(shorter, longest)
    return bits.where(converges, dv, first[0]), bits.where(converges, dy, first[1])
