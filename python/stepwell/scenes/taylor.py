"""Orbits of bodies to more digits than a float has, by Taylor series in decimal numbers.

They are for scenes whose solution has no formula. Python's ``decimal`` gives the same digits everywhere and needs no library.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from decimal import Context, Decimal, localcontext
from operator import mul

import numpy as np

from ..base.arrays import Array
from ..errors import ArgumentError

#: The digits of every number, the tolerance of a step relative to the state, and the terms of the series.
DIGITS = 40
TOLERANCE = 1e-30
TERMS = 32

Series = list[Decimal]


class Orbit:
    """The orbit of bodies under Newton's law, as a function of time.

    The series of every step is stored, so that a time within a step costs one polynomial. A call with a time after the last step
    makes further steps. The series of a power follows from the usual recurrence (Moore, *Interval Analysis*, 1966), the step
    from the last two terms (Jorba and Zou, *Experimental Mathematics* 14, 2005).

    Args:
        masses: one for each body, G = 1.
        v: velocities at t = 0, shape (bodies, dim).
        y: places at t = 0, likewise.
        period: the period of a periodic motion, in units of time; times are then folded into one period.
        tolerance: the tolerance of a step, relative to the state.
    """

    def __init__(
        self, masses: Sequence[float], v: Array, y: Array, period: float | None = None, tolerance: float = TOLERANCE
    ) -> None:
        self.masses = [Decimal(m) for m in masses]
        self.period = period
        self.tolerance = tolerance
        self.shape = y.shape
        self._state = [[Decimal(x) for x in block.ravel().tolist()] for block in (v, y)]
        #: The times at which each step begins, and that at which the last one ends. They are floats, so that the place of a
        #: float within a step is exact.
        self._times = [0.0]
        #: The terms of each step at its end, shape (terms, 2, bodies·dim); for a time within the step they are scaled down.
        self._terms: list[Array] = []

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Velocities and places at times of shape (n,): two arrays of shape (n, bodies, dim).

        Raises:
            ArgumentError: if a time is before the start by more than the first step.
        """
        t = np.asarray(t, dtype=np.float64)
        if self.period is not None:
            t = np.mod(t, self.period)
        self._reach(float(t.max(initial=0.0)))
        if (t < -self._times[1]).any():
            raise ArgumentError(f"t: the exact solution begins at 0, got {t.min():g}")
        values = np.empty((len(t), *self._terms[0].shape[1:]))
        step_of = np.clip([bisect_right(self._times, each) - 1 for each in t.tolist()], 0, len(self._terms) - 1)
        for step in np.unique(step_of).tolist():
            here = step_of == step
            begin, end = self._times[step : step + 2]
            share = ((t[here] - begin) / (end - begin))[:, np.newaxis, np.newaxis]
            value = np.zeros((len(share), *values.shape[1:]))
            for term in self._terms[step][::-1]:
                value = value * share + term
            values[here] = value
        return values[:, 0].reshape(-1, *self.shape), values[:, 1].reshape(-1, *self.shape)

    @property
    def steps(self) -> int:
        """The number of steps so far."""
        return len(self._terms)

    def _reach(self, t: float) -> None:
        """Step until t lies within the last step."""
        with localcontext(Context(prec=DIGITS)):
            while self._times[-1] < t or not self._terms:
                self._step()

    def _step(self) -> None:
        v, y = self._series()
        length = min(_radius(v, y, k, self.tolerance) for k in (TERMS - 1, TERMS))
        begin = self._times[-1]
        end = begin + length
        h = Decimal(end) - Decimal(begin)
        power, powers = Decimal(1), []
        for _ in range(TERMS + 1):
            powers.append(power)
            power *= h
        at_end = [[list(map(mul, series, powers)) for series in block] for block in (v, y)]
        self._state = [[sum(terms, Decimal(0)) for terms in block] for block in at_end]
        self._terms.append(np.array(at_end, dtype=np.float64).transpose(2, 0, 1))
        self._times.append(end)

    def _series(self) -> tuple[list[Series], list[Series]]:
        """The coefficients of every velocity and coordinate around the last time."""
        bodies, dim = self.shape
        v, y = ([[x] for x in block] for block in self._state)
        pairs = [_Pair(i, j, dim) for i in range(bodies) for j in range(i + 1, bodies)]
        for k in range(TERMS):
            pull = [Decimal(0)] * (bodies * dim)
            for pair in pairs:
                for axis, p in enumerate(pair.next(k, y)):
                    pull[pair.i * dim + axis] += self.masses[pair.j] * p
                    pull[pair.j * dim + axis] -= self.masses[pair.i] * p
            for place, speed, force in zip(y, v, pull, strict=True):
                place.append(speed[k] / (k + 1))
                speed.append(force / (k + 1))
        return v, y


class TurningOrbit(Orbit):
    """The orbit of a body without mass around two that circle each other, in the frame that turns with them; see ``Orbit``.

    Args:
        mu: the light body's share of the mass; it stands at (1 − μ, 0), the heavy one at (−μ, 0).
        v: velocity at t = 0, shape (2,).
        y: place at t = 0, likewise.
        tolerance: the tolerance of a step, relative to the state.
    """

    def __init__(self, mu: float, v: Array, y: Array, tolerance: float = TOLERANCE) -> None:
        with localcontext(Context(prec=DIGITS)):
            super().__init__([0.0], v, y, tolerance=tolerance)
            self.masses += [1 - Decimal(mu), Decimal(mu)]
            self._stand = [-Decimal(mu), 1 - Decimal(mu)]

    def _series(self) -> tuple[list[Series], list[Series]]:
        """The coefficients of both velocities and both coordinates around the last time."""
        v, y = ([[x] for x in block] for block in self._state)
        places = [*y, [self._stand[0]], [Decimal(0)], [self._stand[1]], [Decimal(0)]]
        pairs = [_Pair(0, 1, 2), _Pair(0, 2, 2)]
        for k in range(TERMS):
            pull = [y[0][k] + 2 * v[1][k], y[1][k] - 2 * v[0][k]]
            for pair in pairs:
                for axis, p in enumerate(pair.next(k, places)):
                    pull[axis] += self.masses[pair.j] * p
            for series in places[2:]:
                series.append(Decimal(0))
            for place, speed, force in zip(y, v, pull, strict=True):
                place.append(speed[k] / (k + 1))
                speed.append(force / (k + 1))
        return v, y


class _Pair:
    """The series of the pull between two bodies, d/r³, term by term."""

    def __init__(self, i: int, j: int, dim: int) -> None:
        self.i, self.j, self.dim = i, j, dim
        self.distance: list[Series] = [[] for _ in range(dim)]
        self.square: Series = []
        #: Term n of the square times n.
        self.slope: Series = []
        self.cube: Series = []

    def next(self, k: int, y: list[Series]) -> list[Decimal]:
        """Term k for each axis."""
        for axis, series in enumerate(self.distance):
            series.append(y[self.j * self.dim + axis][k] - y[self.i * self.dim + axis][k])
        self.square.append(sum((_square(series, k) for series in self.distance), Decimal(0)))
        self.slope.append(k * self.square[k])
        first = self.square[0]
        if k == 0:
            self.cube.append(1 / (first * first.sqrt()))
        else:
            # From s·u̇ = p·ṡ·u for u = s^p, p = −3/2, all doubled so that the factors are whole: 2·k + n for s_n·u_(k − n).
            back = self.cube[::-1]
            plain, sloped = (sum(map(mul, series[1:], back), Decimal(0)) for series in (self.square, self.slope))
            self.cube.append(-((k + k) * plain + sloped) / (2 * k * first))
        return [_product(series, self.cube, k) for series in self.distance]


def _product(a: Series, b: Series, k: int) -> Decimal:
    """Term k of the product of two series."""
    return sum(map(mul, a, b[k::-1]), Decimal(0))


def _square(a: Series, k: int) -> Decimal:
    """Term k of the square of a series: each product of two different terms once, and doubled."""
    half = sum(map(mul, a[: (k + 1) // 2], a[k : k // 2 : -1]), Decimal(0))
    return half + half if k % 2 else half + half + a[k // 2] * a[k // 2]


def _radius(v: list[Series], y: list[Series], k: int, tolerance: float) -> float:
    """The longest step with which term k of each block, relative to the block, is within the tolerance."""
    steps = []
    for block in (v, y):
        scale = max(float(abs(series[0])) for series in block) or 1.0
        term = max(float(abs(series[k])) for series in block)
        steps.append(math.inf if term == 0.0 else (tolerance * scale / term) ** (1.0 / k))
    return min(steps)
