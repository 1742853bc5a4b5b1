"""What the tests of stability have in common."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import stepwell as sw

from support.looped import looped
from support.truths import DOP853_TAIL

METHODS = [m.name for m in sw.methods()]
EPS = float(np.finfo(float).eps)
LIMITS = {
    "standard_euler": 0.0,
    "damped_euler": 2.0,
    "false_euler": 2.0,
    "verlet": 2.0,
    "standard_heun": 0.0,
    "false_heun": math.sqrt(2),
    "semi_false_heun": math.sqrt(2 * math.sqrt(5) - 2),
    "leapfrog": 2.0,
    "rk4": 2 * math.sqrt(2),
    "merson": 2 * math.sqrt(3),
    "fehlberg": 0.0,
    "fehlberg_5": 0.0,
    "bs32": math.sqrt(3),
    "dopri5": 0.9971890086325299,  # where r₁² = 1 − Φ⁶/1800 + Φ⁸/1600 − Φ¹⁰/14400 + Φ¹²/360000 is 1 again, in 80 digits
    "dop853": 5.96035981170278,  # of the polynomial in truths, in 40 digits
    "pefrl": 2.989449545906729,  # where 1 + p = 0, by bisection of the product of nine shears in fractions
}
known = looped("method", sorted(LIMITS))

#: Methods whose steps are derived number by number take long.
DEAR = [m.name for m in sw.methods() if m.has_derivatives]
QUICK = [name for name in METHODS if name not in DEAR]
#: A method of each structure, of those that do not take long.
OF_EACH_STRUCTURE = ["standard_euler", "false_euler", "verlet", "leapfrog", "semi_false_heun", "rk4", "fehlberg_5", "pefrl"]

#: R(z) = 1 + z + … of the methods that treat both blocks alike.
TAYLOR = {
    "standard_euler": (1, 1),
    "standard_heun": (1, 1, 1 / 2),
    "rk4": (1, 1, 1 / 2, 1 / 6, 1 / 24),
    "merson": (1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 144),
    "fehlberg": (1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 104),
    "fehlberg_5": (1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 2080),
    "bs32": (1, 1, 1 / 2, 1 / 6),
    "dopri5": (1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 600),
    "dop853": (*(1 / math.factorial(k) for k in range(9)), *map(float, DOP853_TAIL)),
}


def by_hand(method: str, a: Any, n_v: int) -> Any:
    """P of a step, from h·A in the order (v, y), without this library: each stage is a matrix that acts on the start.

    Or of many steps, from their h·A along the axes before the last two; in floats or in fractions.
    """
    one = np.eye(a.shape[-1], dtype=a.dtype)
    kick, drift = a.copy(), a.copy()
    kick[..., n_v:, :] = 0 * kick[..., n_v:, :]  # what changes v
    drift[..., :n_v, :] = 0 * drift[..., :n_v, :]  # what changes y
    if method in TAYLOR:
        return sum(c * np.linalg.matrix_power(a, k) for k, c in enumerate(TAYLOR[method]))
    if method == "false_euler":
        return (one + drift) @ (one + kick)
    if method == "damped_euler":
        return (one + kick) @ (one + drift)
    dv1 = kick
    first = one + dv1
    dy1 = drift @ first if method == "false_heun" else drift
    predicted = first + dy1  # (v1, y1)
    dv2 = kick @ predicted
    newer = one + dv2 + dy1  # (v + dv2, y1)
    dy2 = drift @ newer
    return one + (dv1 + dv2) / 2 + (dy1 + dy2) / 2
