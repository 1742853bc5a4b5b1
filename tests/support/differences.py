"""Central differences with a bound on their error, to hold derivatives against."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def central(f: Callable[[Any], Any], x: Any, step: Any, rounding: float) -> tuple[Any, Any]:
    """f'(x) by a central difference, and a bound on how far it is from it.

    With D(δ) = (f(x + δ) − f(x − δ))/2δ the truncation is δ²·f‴/6 + O(δ⁴), and D(2δ) − D(δ) is three times that: it bounds the
    truncation with room for the higher orders, as long as these are smaller. ``rounding`` bounds the relative error of a value of
    f: each of two values is off by rounding·|f| at most, which makes rounding·|f|/δ of D(δ), and 1.5 times that with D(2δ); x ± δ
    are exact sums or off by half an eps of x, which the caller has in ``rounding``.
    """
    near = [f(x + k * step) for k in (-2, -1, 1, 2)]
    one, two = (near[2] - near[1]) / (2 * step), (near[3] - near[0]) / (4 * step)
    size = np.max(np.abs(near), axis=0)
    return one, np.abs(two - one) + 1.5 * rounding * size / np.abs(step)
