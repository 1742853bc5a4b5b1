"""The order of a user's method, by power series in the step.

A step is made of a system whose rates are polynomials without any symmetry, over numbers that are polynomials in h: those of the
result agree with those of the exact solution up to h to the order. Blocks that a method keeps between steps are those that it has
after many steps: it is led along the exact solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..errors import UnsupportedError
from ..reference.program import Program, Programs

#: The highest power of h. The system has so many derivatives.
POWERS = 12

#: Numbers of a block. Of scalar rates several conditions of order are one.
SIZE = 2

#: A coefficient that differs by less, relative to that of the solution, does so by the rounding of the method's numbers.
ROUNDING = 1e-9

#: Without rates, steps multiply a state by a matrix. Powers of it that stay below this do not grow.
STEPS, BOUNDED = 1000, 100.0


class Polynomials:
    """Numbers that are polynomials in h, shape (powers, numbers)."""

    __slots__ = ("of",)

    def __init__(self, of: Array) -> None:
        self.of = of

    def __add__(self, other: Polynomials) -> Polynomials:
        return Polynomials(self.of + other.of)

    def __sub__(self, other: Polynomials) -> Polynomials:
        return Polynomials(self.of - other.of)

    def __rmul__(self, factor: float) -> Polynomials:
        return Polynomials(factor * self.of)


def _times(a: Array, b: Array) -> Array:
    product: Array = np.convolve(a, b)[: POWERS + 1]
    return product


class _Problem:
    """v̇ = f(t, v, y) and ẏ = g(t, v, y), or ẏ = v and f of t and y alone; scaled to the step h. Times are whole steps later."""

    def __init__(self, acceleration: bool) -> None:
        self.acceleration, self.later = acceleration, 0.0
        count = 2 * SIZE * (POWERS + 1)
        # Numbers without a pattern, the same in every process.
        numbers = np.sin(1.0 + 1.7 * np.arange(count * (2 + 2 * SIZE)) ** 1.5)
        factors, directions = np.split(numbers, [count])
        self.factors = factors.reshape(2 * SIZE, POWERS + 1)
        self.directions = directions[: count * (1 + 2 * SIZE)].reshape(2 * SIZE, POWERS + 1, 1 + 2 * SIZE).copy()
        if acceleration:
            self.directions[:, :, 1 : 1 + SIZE] = 0.0

    def rates(self, of: range, t: Array, v: Array, y: Array) -> Array:
        """Some of the rates: sums of powers of directions."""
        state = np.concatenate([t[:, np.newaxis], v, y], axis=1)
        columns = []
        for i in of:
            total = np.zeros(POWERS + 1)
            for power in range(POWERS + 1):
                along, product = state @ self.directions[i, power], np.eye(1, POWERS + 1)[0]
                for _ in range(power):
                    product = _times(product, along)
                total += self.factors[i, power] / factorial(power) * product
            columns.append(total)
        return np.stack(columns, axis=1)

    def dv(self, t: float, v: Polynomials, y: Polynomials) -> Polynomials:
        """h·v̇."""
        return self._scaled(self.rates(range(SIZE), self._time(t), v.of, y.of))

    def dy(self, t: float, v: Polynomials, y: Polynomials) -> Polynomials:
        """h·ẏ."""
        if self.acceleration:
            return self._scaled(v.of)
        return self._scaled(self.rates(range(SIZE, 2 * SIZE), self._time(t), v.of, y.of))

    def velocity(self, d: Polynomials) -> Polynomials:
        """The increment d divided by h; its first coefficient is 0 where d is an increment."""
        return Polynomials(np.concatenate([d.of[1:], np.zeros((1, SIZE))]))

    def _time(self, share: float) -> Array:
        time: Array = (self.later + share) * np.eye(1, POWERS + 1, 1)[0]
        return time

    @staticmethod
    def _scaled(rates: Array) -> Polynomials:
        return Polynomials(np.concatenate([np.zeros((1, rates.shape[1])), rates[:-1]]))

    def solution(self) -> tuple[Array, Array]:
        """V and y as power series of the time, from a state at time 0."""
        v, y = np.zeros((POWERS + 1, SIZE)), np.zeros((POWERS + 1, SIZE))
        v[0], y[0] = [0.3, -0.7], [0.9, 0.4]
        t = np.eye(1, POWERS + 1, 1)[0]
        over = np.arange(1.0, POWERS + 1)[:, np.newaxis]
        for _ in range(POWERS):
            of_v = self.rates(range(SIZE), t, v, y)
            of_y = v.copy() if self.acceleration else self.rates(range(SIZE, 2 * SIZE), t, v, y)
            v[1:], y[1:] = of_v[:-1] / over, of_y[:-1] / over
        return v, y


def _first_power(difference: Array, scale: Array) -> int:
    """The first power of h whose coefficient is not rounding; one more than the last if there is none."""
    sizes = np.maximum(1.0, np.abs(scale).max(axis=1))
    there = np.flatnonzero(np.abs(difference).max(axis=1) > ROUNDING * sizes)
    return int(there[0]) if there.size else POWERS + 1


def _errors(programs: Programs, acceleration: bool) -> tuple[int, int, int]:
    """The first powers of h in the error of a step, in the estimate of it, and in the error of a first step."""
    s = _Problem(acceleration)
    exact = s.solution()

    def at(steps: float) -> list[Polynomials]:
        """The exact state so many steps later."""
        powers = (steps ** np.arange(POWERS + 1))[:, np.newaxis]
        return [Polynomials(block * powers) for block in exact]

    def led(steps: int) -> tuple[int, list[Any]]:
        """The error of a step from the exact state, after so many along the exact solution, and what it returned."""
        kept: Sequence[Any] = ()
        for later in range(-steps, 1):
            s.later, made = float(later), []
            v, y = at(later)
            if programs.begin is not None and later == -steps:
                kept = programs.begin.run(s, 0.0, 1.0, v, y)  # type: ignore[arg-type]
            made = programs.whole.run(s, 0.0, 1.0, v, y, kept)  # type: ignore[arg-type]
            kept = made[2:] if programs.kept else ()
        ends = at(1.0)
        powers = (_first_power(one.of - end.of, end.of) for one, end in zip(made, ends, strict=False))
        return min(powers), made

    # What is kept of a step is known exactly after as many steps as there are blocks, and one more.
    power, made = led(len(programs.kept) + 1 if programs.kept else 0)
    estimate = min((_first_power(block.of, block.of) for block in made[2:]), default=0) if programs.estimates else 0
    return power, estimate, led(0)[0] if programs.kept else power


def _grows(programs: Programs) -> bool:
    """True if steps grow without rates, so that no step is short enough (a method that is not zero-stable)."""

    class Rest:
        def dv(self, t: float, v: Array, y: Array) -> Array:
            return 0.0 * v

        def dy(self, t: float, v: Array, y: Array) -> Array:
            return 0.0 * y

        def velocity(self, d: Array) -> Array:
            return 0.0 * d

    state = list(np.eye(2 + len(programs.kept)))
    matrix = np.stack(programs.whole.run(Rest(), 0.0, 1.0, state[0], state[1], state[2:]))
    with np.errstate(all="ignore"):
        return not bool((np.abs(np.linalg.matrix_power(matrix, STEPS)) < BOUNDED).all())


def order_of(name: str, programs: Programs) -> tuple[int, int | None, bool]:
    """The order of a method, that of its estimate, and whether it has its order only for ÿ = a(t, y)."""
    asks = any(each[0] == "velocity" for each in (*programs.whole.operations, *(programs.begin or Program((), ())).operations))
    general = (0, 0, 0) if asks else _errors(programs, acceleration=False)
    special = _errors(programs, acceleration=True)
    acceleration = special[0] > general[0]
    power, estimate, first = special if acceleration else general
    order = power - 1
    if order < 1:
        raise UnsupportedError(
            f"{name}: expected a step whose error is smaller than the step, got one of order {order}: not even v + s.dv(t, v, y) "
            f"and y + s.dy(t, v, y) are right"
        )
    if programs.kept and _grows(programs):
        raise UnsupportedError(f"{name}: its steps grow even without rates (it is not zero-stable), so it is wrong with any step")
    if first < order:
        raise UnsupportedError(
            f"start: expected blocks with which the first step has an error of h to the power of {order} or more, as a method of "
            f"order {order} needs, got one of h to the power of {first}"
        )
    if programs.estimates and estimate <= 1:
        raise UnsupportedError(
            f"{name}: expected an estimate of the error as third and fourth result, which falls faster than the step, got one "
            f"that goes with h to the power of {estimate}"
        )
    return order, estimate if programs.estimates else None, acceleration
