"""Polynomials and their quotients, with which a reference step computes in place of numbers.

``Polynomial`` stands for an expression in an unknown, exactly, and ``Rational`` for a quotient of two, as steps that solve
equations have it. NumPy arrays of objects apply the operations of their elements, so the reference needs no change for them.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from ...reference.series import Series


def exact(value: float | Fraction) -> Fraction:
    """The fraction that a float stands for: a simple one that rounds to it if there is one (1/6), else its exact value."""
    if isinstance(value, Fraction):
        return value
    simple = Fraction(value).limit_denominator(100_000)
    return simple if float(simple) == value else Fraction(value)


class Polynomial:
    """A polynomial with exact coefficients, from the constant on."""

    __slots__ = ("coefficients",)

    def __init__(self, *coefficients: float | Fraction) -> None:
        fractions = [exact(c) for c in coefficients]
        while fractions and not fractions[-1]:
            fractions.pop()
        self.coefficients = tuple(fractions)

    def __eq__(self, other: object) -> bool:
        return self.coefficients == other.coefficients if isinstance(other, Polynomial) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.coefficients)

    def __getitem__(self, power: int) -> Fraction:
        return self.coefficients[power] if power < len(self.coefficients) else Fraction(0)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series, Rational)):
            return NotImplemented
        other = _polynomial(other)
        return Polynomial(*(self[k] + other[k] for k in range(max(len(self.coefficients), len(other.coefficients)))))

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series, Rational)):
            return NotImplemented
        other = _polynomial(other)
        product = [Fraction(0)] * max(0, len(self.coefficients) + len(other.coefficients) - 1)
        for i, a in enumerate(self.coefficients):
            for j, b in enumerate(other.coefficients):
                product[i + j] += a * b
        return Polynomial(*product)

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series, Rational)):
            return NotImplemented
        if isinstance(other, Polynomial):
            return quotient(self, other)
        return self * (1 / exact(other))

    def __rtruediv__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, (np.ndarray, Series)) else quotient(_polynomial(other), self)

    def __neg__(self) -> Polynomial:
        return Polynomial(*(-c for c in self.coefficients))

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, (Series, Rational)) else self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    __radd__ = __add__
    __rmul__ = __mul__

    def __call__(self, x: Any) -> Any:
        """The value at x, by Horner's rule; exact for a ``Fraction``."""
        value = x * 0
        for c in reversed(self.coefficients):
            value = value * x + (c if isinstance(x, Fraction) else float(c))
        return value

    @property
    def fraction(self) -> tuple[Polynomial, Polynomial]:
        """The polynomials above and below the line of a quotient."""
        return self, Polynomial(1)

    def terms(self, count: int) -> list[Fraction]:
        """The first coefficients of its power series."""
        return [self[k] for k in range(count)]

    def root_near(self, x: float) -> float:
        """The root that Newton's method reaches from ``x``, computed with exact values; infinite where the slope vanishes."""
        slope = Polynomial(*(k * c for k, c in enumerate(self.coefficients) if k))
        for _ in range(64):  # a few suffice, except one for each bit at a double root
            at = Fraction(x)
            value, rise = self(at), slope(at)
            if not value:
                break
            if not rise:
                return math.inf
            if (following := float(at - value / rise)) == x:
                break
            x = following
        return x

    def __repr__(self) -> str:
        return f"Polynomial{tuple(map(str, self.coefficients))}"


def _polynomial(value: Any) -> Polynomial:
    return value if isinstance(value, Polynomial) else Polynomial(value)


class Rational:
    """A quotient of polynomials without a common factor; that below is 1 where the unknown is 0."""

    __slots__ = ("above", "below")

    def __init__(self, above: Polynomial, below: Polynomial) -> None:
        self.above, self.below = above, below

    def __add__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series)):
            return NotImplemented
        other = _rational(other)
        return quotient(self.above * other.below + other.above * self.below, self.below * other.below)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series)):
            return NotImplemented
        other = _rational(other)
        return quotient(self.above * other.above, self.below * other.below)

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series)):
            return NotImplemented
        other = _rational(other)
        return quotient(self.above * other.below, self.below * other.above)

    def __rtruediv__(self, other: Any) -> Any:
        return _rational(other) / self

    def __neg__(self) -> Rational:
        return Rational(-self.above, self.below)

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, Series) else self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    __radd__ = __add__
    __rmul__ = __mul__

    def __call__(self, x: Any) -> Any:
        """The value at x; exact for a ``Fraction``."""
        return self.above(x) / self.below(x)

    @property
    def fraction(self) -> tuple[Polynomial, Polynomial]:
        """The polynomials above and below the line."""
        return self.above, self.below

    def terms(self, count: int) -> list[Fraction]:
        """The first coefficients of its power series."""
        known: list[Fraction] = []
        for k in range(count):
            known.append(self.above[k] - sum((self.below[j] * known[k - j] for j in range(1, k + 1)), Fraction(0)))
        return known

    def __repr__(self) -> str:
        return f"({self.above!r})/({self.below!r})"


def quotient(above: Polynomial, below: Polynomial) -> Polynomial | Rational:
    """A quotient without common factors."""
    common = _common(above, below)
    if len(common.coefficients) > 1:
        above, below = _divided(above, common)[0], _divided(below, common)[0]
    scale = 1 / below[0]
    above, below = above * scale, below * scale
    return above if len(below.coefficients) == 1 else Rational(above, below)


def _common(a: Polynomial, b: Polynomial) -> Polynomial:
    """Their common factor, by Euclid's algorithm."""
    while b.coefficients:
        b = b * (1 / b.coefficients[-1])  # the fractions stay as short as they can
        a, b = b, _divided(a, b)[1]
    return a


def _divided(a: Polynomial, b: Polynomial) -> tuple[Polynomial, Polynomial]:
    """The quotient of a division with remainder, and the remainder."""
    rest, lead = list(a.coefficients), b.coefficients[-1]
    places = len(rest) - len(b.coefficients) + 1
    result = [Fraction(0)] * max(0, places)
    for k in reversed(range(places)):
        result[k] = rest[k + len(b.coefficients) - 1] / lead
        for j, c in enumerate(b.coefficients):
            rest[k + j] -= result[k] * c
    return Polynomial(*result), Polynomial(*rest)


def _rational(value: Any) -> Rational:
    return value if isinstance(value, Rational) else Rational(_polynomial(value), Polynomial(1))
