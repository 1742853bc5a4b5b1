"""Stiff problems with reference values (Test Set for IVP Solvers), and smooth ones for orders."""

from __future__ import annotations

from decimal import Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw
from stepwell.scenes.stiff_equations import hires, oregonator, rober


class Problem(NamedTuple):
    """A stiff problem.

    Attributes:
        system: its equations.
        start: y at t = 0.
        values: y at some times.
        least: the absolute tolerance, as a share of the relative one.
        allowed: the relative error at these times, over the tolerance.
        long: whether the reference would take long.
    """

    system: Any
    start: list[float]
    values: dict[float, list[float]]
    least: float
    allowed: float
    long: bool = False


@sw.system(order=1)
def van_der_pol(t, y):  # type: ignore[no-untyped-def]
    return [y[1], ((1.0 - y[0] * y[0]) * y[1] - y[0]) / 1e-6]


@sw.system(order=1)
def van_der_pol_1(t, y, mu=1000.0):  # type: ignore[no-untyped-def]
    return [y[1], mu * (1.0 - y[0] * y[0]) * y[1] - y[0]]


@sw.system(order=1)
def reversible(t, y):  # type: ignore[no-untyped-def]
    a, b, _ = y
    return [-a + 2000.0 * b, a - 2003.0 * b, 3.0 * b]


PROBLEMS = {
    "rober": Problem(
        rober,
        [1.0, 0.0, 0.0],
        {
            0.4: [0.98517211386, 3.386395379e-5, 0.01479402218522],
            40.0: [0.71582706871941, 9.18553476456e-6, 0.28416374574583],
            1e2: [0.6172348823961, 6.15359127464e-6, 0.3827589640126],
            1e5: [0.0178659211423, 7.27475146852e-8, 0.9821340061102],
        },
        1e-8,
        30.0,
    ),
    "oregonator": Problem(
        oregonator,
        [1.0, 2.0, 3.0],
        {
            30.0: [1.000661467180497, 1512.778937348249, 10358.54312767229],
            60.0: [1.000874625199626, 1144.336972384497, 83.72149966624639],
            90.0: [1.001890368438751, 529.9926232295553, 1.662279579042420],
            120.0: [1.004118022612645, 243.8326079910346, 1.008822224048647],
        },
        1e-2,
        100.0,
        long=True,
    ),
    "hires": Problem(
        hires,
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057],
        {
            321.8122: [
                7.371312573325668e-4,
                1.442485726316185e-4,
                5.888729740967575e-5,
                1.175651343283149e-3,
                2.386356198831330e-3,
                6.238968252742796e-3,
                2.849998395185769e-3,
                2.850001604814231e-3,
            ]
        },
        1e-6,
        100.0,
    ),
    "van der Pol": Problem(
        van_der_pol,
        [2.0, 0.0],
        {1.0: [-1.863646254808130, 0.7535430865435460], 2.0: [1.706167732170456, -0.8928097010248257]},
        1e-3,
        100.0,
        long=True,
    ),
    "reversible": Problem(reversible, [1.0, 0.0, 0.0], {10.0: [0.984650571, 4.91588271e-4, 0.0148578407]}, 1e-6, 100.0),
}


@sw.system(order=1)
def prothero_robinson(t, y, rate=1e6):  # type: ignore[no-untyped-def]
    return -rate * (y - np.sin(t + 0.5)) + np.cos(t + 0.5)


def exponential(matrix: Any, t: float) -> Any:
    """e^(A·t) in a hundred digits, rounded: a series of a part of the time, squared."""
    with localcontext() as context:
        context.prec = 120
        exactly: Any = np.frompyfunc(lambda x: Decimal(float(x)), 1, 1)
        z = exactly(matrix) * Decimal(t)
        squarings = max(0, int(np.ceil(np.log2(np.abs(matrix).sum() * t + 1.0))) + 4)
        z = z / Decimal(2) ** squarings
        term = total = exactly(np.eye(len(matrix)))
        for k in range(1, 50):
            term = term @ z / k
            total = total + term
        for _ in range(squarings):
            total = total @ total
        return total.astype(float)
