"""Kepler's motion over a step, by a fixed number of operations: universal variables (Stumpff; Stiefel and Scheifele 1971).

With s, the time over the distance, h = r₀·s + η·G₂ + ζ·G₃, where Gₙ = sⁿ·cₙ(β·s²), η = y·v, β = 2μ/r₀ − v², ζ = μ − β·r₀. The
left side grows with s, at the rate of the distance, so it has one solution, on orbits of every kind. It is found by three
improvements of fourth order from s = h/r₀. Where they do not suffice the result is NaN: a step that is too long for the orbit.
"""

import math
from typing import Any

import numpy as np

from ..base.arrays import Array, Blocks
from . import bits

#: 1/2!, 1/4!, … and 1/3!, 1/5!, …: of c₂ and c₃ in powers of β·s²/16. The next term is below a rounding up to MOST.
EVEN = tuple(1.0 / math.factorial(n) for n in range(2, 17, 2))
ODD = tuple(1.0 / math.factorial(n) for n in range(3, 18, 2))

#: 1/16, exactly: the argument of the series after two halvings of s.
QUARTERED = 0.0625

#: How many terms of them each improvement takes: what the last one does not need, the first ones need not have.
TERMS = (4, 6, 8)

SIXTH = 1.0 / 6.0

#: The square of the last improvement as a share of s, and of what it bends: its fourth power is then below a rounding.
SMALL = 2.0**-36

#: The largest |β·s²|: of an ellipse the square of the change of the eccentric anomaly, a little more than half a revolution.
MOST = 12.0


def dot(a: Array, b: Array) -> Array:
    """a·b of vectors along the second axis."""
    total = a[:, 0] * b[:, 0]
    for c in range(1, a.shape[1]):
        total = total + a[:, c] * b[:, c]
    return total


def moved(mu: Array, h: Any, v: Array, y: Array) -> Blocks:
    """The changes of v and y of relative motions, shape (orbits, dim, …), under μ, shape (orbits, …), in the time h."""
    r0 = np.sqrt(dot(y, y))
    inverse = 1.0 / r0
    eta = dot(y, v)
    beta = (mu + mu) * inverse - dot(v, v)
    zeta = mu - beta * r0
    s = h * inverse
    for terms in TERMS:
        g0, g1, g2, g3 = _stiefel(beta, s, terms)
        per = 1.0 / ((r0 + eta * g1) + zeta * g2)
        newton = (h - ((r0 * s + eta * g2) + zeta * g3)) * per
        bend = 0.5 * ((eta * g0 + zeta * g1) * per)
        curl = SIXTH * ((zeta * g0 - beta * (eta * g1)) * per)
        if terms < TERMS[-1]:
            nearer = newton / (1.0 + newton * bend)
            s = s + newton / (1.0 + nearer * (bend + nearer * curl))
    change = newton * (1.0 - newton * (bend - newton * ((bend + bend) * bend - curl)))
    square = change * change
    whole, bent, curled = beta * (s * s), change * bend, square * curl
    sound = (
        bits.at_most(whole * whole, MOST * MOST)
        & bits.at_most(square, SMALL * (s * s))
        & bits.at_most(bent * bent, SMALL)
        & bits.at_most(curled * curled, SMALL * SMALL)
    )
    # The functions at s + change: what is left out is the third power of the change.
    half = 0.5 * square
    g3 = (g3 + change * g2) + half * g1
    g2 = (g2 + change * g1) + half * g0
    g1 = (g1 + change * g0) - half * (beta * g1)
    per = 1.0 / ((r0 + eta * g1) + zeta * g2)
    fall = -(mu * g2)
    of_y = bits.where(sound, fall * inverse, np.nan)
    to_y, to_v = h - mu * g3, -(mu * g1) * (inverse * per)

    def along(a: Array, b: Array) -> Array:
        return a[:, np.newaxis] * y + b[:, np.newaxis] * v

    return along(to_v, fall * per), along(np.asarray(of_y), to_y)


def _stiefel(beta: Array, s: Array, terms: int) -> tuple[Array, Array, Array, Array]:
    """G₀ … G₃, by so many terms of their series."""
    square = s * s
    z = QUARTERED * (beta * square)
    c2, c3 = EVEN[terms - 2] - z * EVEN[terms - 1], ODD[terms - 2] - z * ODD[terms - 1]
    for k in range(terms - 3, -1, -1):
        c2, c3 = EVEN[k] - z * c2, ODD[k] - z * c3
    c0, c1 = 1.0 - z * c2, 1.0 - z * c3
    for _ in range(2):  # twice the argument of the sine
        c0, c1, c2, c3 = (c0 + c0) * c0 - 1.0, c0 * c1, 0.5 * (c1 * c1), 0.25 * (c2 + c0 * c3)
    return c0, s * c1, square * c2, (square * s) * c3
