"""Polynomials that a reference step computes with in place of numbers.

``Polynomial`` stands for an expression in an unknown, exactly. NumPy arrays of objects apply the operations of their elements, so
the reference needs no change for it.
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
        if isinstance(other, (np.ndarray, Series)):
            return NotImplemented
        other = _polynomial(other)
        return Polynomial(*(self[k] + other[k] for k in range(max(len(self.coefficients), len(other.coefficients)))))

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series)):
            return NotImplemented
        other = _polynomial(other)
        product = [Fraction(0)] * max(0, len(self.coefficients) + len(other.coefficients) - 1)
        for i, a in enumerate(self.coefficients):
            for j, b in enumerate(other.coefficients):
                product[i + j] += a * b
        return Polynomial(*product)

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, (np.ndarray, Series)):
            return NotImplemented
        return self * (1 / exact(other))

    def __neg__(self) -> Polynomial:
        return Polynomial(*(-c for c in self.coefficients))

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, Series) else self + (-other)

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
