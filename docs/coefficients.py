"""Prints the coefficients of stepwell's elementary functions (``python/stepwell/reference/functions/``); needs mpmath.

Each polynomial has the least squares of weighted errors at Chebyshev nodes, and so nearly the least possible error. Its
coefficients are rounded one after the other, the lowest power first, and the others are fitted again, so that they make up for
the rounding.
"""

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np

mp.mp.dps = 70


def of_square(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function of z = r² from an even one of r."""
    return lambda z: f(mp.sqrt(z))


#: Of each polynomial: the function, from where to where, how many coefficients, and the power of the argument that it is
#: multiplied by where it is used, by which its errors are weighed.
FITS: dict[str, tuple[Callable[[Any], Any], Any, Any, int, int]] = {
    "SIN": (of_square(lambda r: (mp.sin(r) - r) / r**3), 0, (mp.pi / 4) ** 2, 6, 1),
    "COS": (
        of_square(lambda r: (mp.cos(r) - 1 + r * r / 2) / r**4),
        0,
        (mp.pi / 4) ** 2,
        6,
        2,
    ),
    "EXP": (
        lambda r: (mp.exp(r) - 1 - r - r * r / 2) / r**3,
        -mp.log(2) / 2,
        mp.log(2) / 2,
        10,
        3,
    ),
    "EXP_QUICK": (
        lambda r: (mp.exp(r) - 1 - r) / r**2,
        -mp.log(2) / 2,
        mp.log(2) / 2,
        10,
        2,
    ),
    "EXP2": (
        lambda r: (mp.mpf(2) ** r - 1 - r * mp.log(2)) / r**2,
        -mp.mpf(1) / 2,
        mp.mpf(1) / 2,
        10,
        2,
    ),
    "SINH": (
        of_square(lambda r: (mp.sinh(r) - r) / r**3),
        0,
        (mp.log(2) / 2) ** 2,
        5,
        1,
    ),
    "COSH": (
        of_square(lambda r: (mp.cosh(r) - 1 - r * r / 2) / r**4),
        0,
        (mp.log(2) / 2) ** 2,
        5,
        2,
    ),
    "ATAN": (
        of_square(lambda t: (mp.atan(t) - t) / t**3),
        0,
        (mp.sqrt(2) - 1) ** 2,
        11,
        1,
    ),
    "ASIN": (of_square(lambda x: (mp.asin(x) - x) / x**3), 0, mp.mpf(1) / 4, 13, 1),
    "LOG": (
        of_square(lambda s: 2 * (mp.atanh(s) - s) / s**3),
        0,
        (3 - 2 * mp.sqrt(2)) ** 2,
        7,
        1,
    ),
    "LOG_LONG": (
        of_square(lambda s: 3 * (mp.atanh(s) - s - s**3 / 3) / s**5),
        0,
        (3 - 2 * mp.sqrt(2)) ** 2,
        7,
        2,
    ),
}


#: The same for float32.
SINGLE_FITS = {
    name: (*FITS[name][:3], n, FITS[name][4])
    for name, n in {"SINH": 3, "COSH": 2, "ATAN": 5, "ASIN": 6}.items()
}
SINGLE_FITS |= {
    name: (*FITS[name][:3], n, FITS[name][4])
    for name, n in {"EXP2": 5, "EXP": 5, "LOG_LONG": 4}.items()
}


def fit(
    f: Callable[[Any], Any],
    low: Any,
    high: Any,
    n: int,
    weight: int,
    rounded: Any = float,
) -> tuple[list[float], float]:
    """Coefficients from the lowest power up, and the largest error found at 300 points, times that power of the argument."""
    many = 4 * n
    points = [
        (low + high) / 2 + (high - low) / 2 * mp.cospi((mp.mpf(k) + 0.5) / many)
        for k in range(many)
    ]
    rest = [f(z) for z in points]
    coefficients: list[float] = []
    for k in range(n):
        powers = mp.matrix([[z ** (j + weight) for j in range(k, n)] for z in points])
        weighted = mp.matrix(
            [value * z**weight for value, z in zip(rest, points, strict=True)]
        )
        c = float(
            rounded(mp.lu_solve(powers, weighted)[0])
        )  # of more equations than unknowns it makes the least squares
        rest = [value - c * z**k for value, z in zip(rest, points, strict=True)]
        coefficients.append(c)
    between = [
        low + (high - low) * (mp.mpf(k) + mp.mpf(1) / 3) / 300 for k in range(300)
    ]
    off = [sum(c * z**k for k, c in enumerate(coefficients)) - f(z) for z in between]
    return coefficients, float(
        max(abs(each * z**weight) for each, z in zip(off, between, strict=True))
    )


if __name__ == "__main__":
    fits = [(name, *fit(*arguments)) for name, arguments in FITS.items()]
    fits += [
        (f"float32: {name}", *fit(*arguments, np.float32))
        for name, arguments in SINGLE_FITS.items()
    ]
    for name, coefficients, error in fits:
        print(f"{name} = (  # error {error:.2g}")
        print("".join(f"    {c!r},\n" for c in coefficients) + ")")
