"""Elementary functions, written once: the same bits on NumPy's arrays and, by a tape, in the core.

Each takes numbers, arrays of float64, symbols of a tape, and arrays of symbols, mixed, and broadcasts as NumPy does. Of a symbol
it writes a straight line of additions, multiplications, divisions, square roots, comparisons and operations on bits, which are
exact or correctly rounded everywhere. ``docs/theory/functions.md`` lists errors and costs.

Symbols of float32 take the same formulas. The ``CONSTANTS`` of each file are a record for either precision; where the two differ
in their operations, the formula asks ``is_single``.
"""

from .comparisons import equal, greater, greater_equal, less, less_equal, not_equal
from .exponential import exp, exp2, expm1
from .hyperbolic import cosh, sinh, tanh
from .inverse import arccos, arcsin, arctan, arctan2
from .logarithms import log, log1p, log2, log10
from .powers import power
from .roots import cbrt, hypot, sqrt, square
from .rounding import abs, ceil, clip, copysign, floor, maximum, minimum, mod, remainder, round, sign, trunc, where
from .trigonometric import cos, deg2rad, rad2deg, sin, tan

__all__ = [
    "abs",
    "arccos",
    "arcsin",
    "arctan",
    "arctan2",
    "cbrt",
    "ceil",
    "clip",
    "copysign",
    "cos",
    "cosh",
    "deg2rad",
    "equal",
    "exp",
    "exp2",
    "expm1",
    "floor",
    "greater",
    "greater_equal",
    "hypot",
    "less",
    "less_equal",
    "log",
    "log1p",
    "log2",
    "log10",
    "maximum",
    "minimum",
    "mod",
    "not_equal",
    "power",
    "rad2deg",
    "remainder",
    "round",
    "sign",
    "sin",
    "sinh",
    "sqrt",
    "square",
    "tan",
    "tanh",
    "trunc",
    "where",
]
