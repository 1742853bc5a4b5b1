"""What the tests of stability have in common."""

from __future__ import annotations

import math

import numpy as np
import stepwell as sw

from support.looped import looped

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
    "dop853": 5.96035981170278,  # of the polynomial in truths, in 40 digits
    "pefrl": 2.989449545906729,  # where 1 + p = 0, by bisection of the product of nine shears in fractions
}
known = looped("method", sorted(LIMITS))

#: Methods whose steps are derived number by number take long.
DEAR = [m.name for m in sw.methods() if m.has_derivatives]
QUICK = [name for name in METHODS if name not in DEAR]
#: A method of each structure, of those that do not take long.
OF_EACH_STRUCTURE = ["standard_euler", "false_euler", "verlet", "leapfrog", "semi_false_heun", "rk4", "fehlberg_5", "pefrl"]
