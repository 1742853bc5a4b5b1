"""What elementary functions are held against: multi-precision arithmetic, and arguments among which the hard ones are."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
from stepwell.reference import functions

Points = tuple[np.ndarray, ...]

#: Enough for a result of 53 bits that lies close to the middle between two numbers, and for sums that cancel.
PRECISION = 160

SAME = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log1p", "log10", "power")
TRUE: dict[str, Callable[..., Any]] = {name: getattr(mp, name) for name in SAME} | {
    f"arc{name}": getattr(mp, f"a{name}") for name in ("sin", "cos", "tan", "tan2")
}
TRUE |= {
    "exp2": lambda x: mp.power(2, x),
    "log2": lambda x: mp.log(x, 2),
    "cbrt": lambda x: mp.sign(x) * mp.cbrt(abs(x)),
    "hypot": lambda x, y: mp.sqrt(x * x + y * y),
    "deg2rad": lambda x: x * mp.pi / 180,
    "rad2deg": lambda x: x * 180 / mp.pi,
}


#: Those that compare two numbers.
COMPARE = ["equal", "greater", "greater_equal", "less", "less_equal", "not_equal"]
#: Functions of two numbers, and of one.
OF_TWO = ["arctan2", "copysign", "hypot", "maximum", "minimum", "mod", "power", "remainder"]
OF_ONE = sorted(set(functions.__all__) - {*COMPARE, *OF_TWO, "clip", "where"})

#: Zeros, what is subnormal, whole, half, large, infinite, none, and where functions overflow or cease to be numbers.
SPECIAL = [0.0, 5e-324, 1e-310, 2.0**-1022, 1e-20, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 709.0, 711.0, 746.0, 1025.0, 1076.0]
SPECIAL += [2.0**52 + 1, 2.0**53 - 1, 2.0**53, 1e300, 1.7976931348623157e308, math.inf]
SPECIALS = np.array([*SPECIAL, *(-x for x in SPECIAL), math.nan])


def same(a: Any, b: Any) -> Any:
    """Where bits are equal, or both are NaN."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return (a.view(np.uint64) == b.view(np.uint64)) | (np.isnan(a) & np.isnan(b))


def signs(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.choice([-1.0, 1.0], n)


def sizes(rng: np.random.Generator, n: int, low: float = -1074.0, high: float = 1024.0) -> np.ndarray:
    """Numbers above zero of all sizes, by their binary logarithm."""
    return np.minimum(2.0 ** rng.uniform(low, high - 1e-9, n), np.finfo(float).max)


def of_turns(rng: np.random.Generator, n: int) -> np.ndarray:
    """The numbers at multiples of π/2 and beside them, as far as the reduction is promised to be exact."""
    x = rng.integers(1, [16, 2**16, 2**24] * (n // 3 + 1))[:n] * (math.pi / 2)
    return np.nextafter(x, x + rng.integers(-1, 2, n)) * signs(rng, n)


def arguments(name: str, rng: np.random.Generator, n: int) -> Points:
    """About n arguments: of all sizes where the function is no constant there, and near what is hard."""
    k = n // 4
    u, some = rng.uniform, signs(rng, k)
    match name:
        case "sin" | "cos" | "tan":
            large = [u(-10.0, 10.0, k), u(-1e5, 1e5, k // 2), u(-2.6e7, 2.6e7, k // 2), of_turns(rng, k)]
            return (np.concatenate([*large, some * sizes(rng, k, high=2.0)]),)
        case "arcsin" | "arccos":
            near = 1.0 - sizes(rng, k, -53.0, 0.0)
            return (np.concatenate([u(-1.0, 1.0, k), u(0.45, 0.55, k) * some, near * some, sizes(rng, k, high=0.0) * some]),)
        case "arctan":
            return (np.concatenate([u(-1.0, 1.0, k), u(-5.0, 5.0, k), sizes(rng, k) * some, sizes(rng, k, -5.0, 60.0) * some]),)
        case "arctan2" | "hypot":
            x = sizes(rng, n, high=1020.0) * signs(rng, n)
            near = x[: n // 2] * sizes(rng, n // 2, -3.0, 3.0) * signs(rng, n // 2)
            return x, np.concatenate([near, sizes(rng, n - n // 2)])
        case "sinh" | "cosh" | "tanh":
            return (np.concatenate([u(-2.0, 2.0, k), u(-25.0, 25.0, k), u(-711.0, 711.0, k), sizes(rng, k, high=3.0) * some]),)
        case "exp":
            return (np.concatenate([u(-2.0, 2.0, k), u(-708.0, 709.0, k), u(-745.5, -708.0, k), u(709.0, 709.79, k)]),)
        case "expm1":
            return (np.concatenate([u(-2.0, 2.0, k), u(-45.0, 45.0, k), u(0.0, 709.79, k), sizes(rng, k, high=2.0) * some]),)
        case "exp2":
            return (
                np.concatenate([u(-2.0, 2.0, k), u(-1022.0, 1024.0, k), u(-1075.0, -1022.0, k), sizes(rng, k, high=2.0) * some]),
            )
        case "log" | "log2" | "log10":
            near = 1.0 + sizes(rng, k, -53.0, -1.0) * some
            return (np.concatenate([u(0.5, 2.0, k), near, sizes(rng, k), sizes(rng, k, -1074.0, -1020.0)]),)
        case "log1p":
            return (
                np.concatenate(
                    [u(-1.0, 3.0, k), -1.0 + sizes(rng, k, -53.0, 0.0), sizes(rng, k), sizes(rng, k, high=0.0) * some]
                ),
            )
        case "power":
            x = np.concatenate([sizes(rng, k, -20.0, 20.0), 1.0 + sizes(rng, k, -52.0, -1.0) * some, sizes(rng, 2 * k)])
            # Results of all sizes, some of them subnormal, some too large.
            y = u(-1.0, 1.0, 4 * k) * sizes(rng, 4 * k, -10.0, math.log2(1078.0)) / np.log2(x)
            return x, np.where(np.isfinite(y), y, 1.5)
        case _:
            return (sizes(rng, n) * signs(rng, n),)


def errors(results: np.ndarray, name: str, points: Points) -> np.ndarray:
    """How far each result is from the truth, in units in the last place of the truth; infinity counts as 2¹⁰²⁴."""
    out = []
    with mp.workprec(PRECISION):
        for result, *row in zip(results.tolist(), *(each.tolist() for each in points), strict=True):
            true = TRUE[name](*map(mp.mpf, row))
            size = int(mp.frexp(true)[1]) - 53 if true else -1074
            if abs(true) >= mp.mpf(2) ** 1024:
                out.append(0.0 if result == math.copysign(math.inf, true) else math.inf)
                continue
            number = math.copysign(1.0, result) * mp.mpf(2) ** 1024 if math.isinf(result) else mp.mpf(result)
            out.append(float(abs(number - true) / mp.mpf(2) ** max(size, -1074)))
    return np.array(out)
