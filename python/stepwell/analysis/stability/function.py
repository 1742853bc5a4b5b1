"""The stability function of a method: the factor R(z) by which a step multiplies a mode of ṡ = λ·s, with z = λ·dt."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...base.reprs import table
from ...errors import UnsupportedError
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import LinearSystem
from .expansion import NEGLIGIBLE, SUPERSCRIPTS, polynomials
from .numbers import Polynomial, Rational
from .parts import function_of_rates


class StabilityFunction(NamedTuple):
    """R(z), a quotient of polynomials.

    Attributes:
        above: the polynomial above the line.
        below: that below it; 1 for methods that solve no equations.
    """

    above: Polynomial
    below: Polynomial

    def __call__(self, z: Any) -> Any:
        """R(z), of one number or of an array."""
        values = [np.polyval([float(c) for c in p.coefficients[::-1]], z) for p in self]
        return values[0] / values[1]

    @property
    def a_stable(self) -> bool:
        """True if no mode that decays, or keeps its amplitude, grows by any step: |R(z)| ≤ 1 wherever Re z ≤ 0.

        By the maximum principle that is so if no pole lies there and |R| ≤ 1 on the imaginary axis, z = iy. There both squares
        of magnitudes are polynomials in y².
        """
        poles = np.roots([float(c) for c in self.below.coefficients[::-1]])
        if (poles.real <= 0.0).any():
            return False
        margin = _square_on_axis(self.below) + -_square_on_axis(self.above)
        sizes = [_square_on_axis(Polynomial(*(abs(c) for c in p.coefficients)), signs=False) for p in self]
        size = sizes[0] + sizes[1]
        # What is left of a coefficient after cancellation is rounding of the method's coefficients.
        exact = (c if abs(c) > NEGLIGIBLE * size[k] else Fraction(0) for k, c in enumerate(margin.coefficients))
        return _never_negative(Polynomial(*exact))

    @property
    def l_stable(self) -> bool:
        """True if it is A-stable, and the faster a mode decays, the nearer to zero a step brings it: R(z) → 0 for z → −∞."""
        return self.a_stable and len(self.above.coefficients) < len(self.below.coefficients)

    def _repr_html_(self) -> str:
        rows = [
            [name, *(str(c) for c in p.coefficients), *[""] * (max(len(q.coefficients) for q in self) - len(p.coefficients))]
            for name, p in zip(("above the line", "below"), self, strict=True)
        ]
        powers = [f"z{str(k).translate(SUPERSCRIPTS)}>" for k in range(len(rows[0]) - 1)]
        return table(repr(self).strip("<>"), ["", *powers], rows)

    def __repr__(self) -> str:
        above, below = (" + ".join(_term(c, k) for k, c in enumerate(p.coefficients) if c) for p in self)
        if len(self.below.coefficients) > 1:
            above = f"({above})/({below})" if len(self.above.coefficients) > 1 else f"{above}/({below})"
        kind = "L-stable" if self.l_stable else "A-stable" if self.a_stable else "not A-stable"
        return f"<R(z) = {above.replace('+ -', '− ').replace('(-', '(−')}, {kind}>"


def function(method: str | Method) -> StabilityFunction:
    """The stability function of a method that treats velocities and coordinates alike.

    Args:
        method: its name, or what ``stepwell.method`` returns.

    Raises:
        UnsupportedError: if the method treats them differently (Verlet, False Euler): its step is no function of λ·dt alone.

    Example:
        >>> sw.stability.function("backward_euler")
        <R(z) = 1/(1 − z), L-stable>
    """
    method = find_method(method)
    if not function_of_rates(method):
        raise UnsupportedError(
            f"method: {method.name} treats velocities and coordinates differently, so its step is no function of λ·dt alone; "
            f"stability_limit and analyse serve every method"
        )
    return _function(method)


@cache
def _function(method: Method) -> StabilityFunction:
    alone: Polynomial | Rational = polynomials(LinearSystem([[1.0]], velocities=0), method)[0, 0]
    above, below = alone.fraction
    if len(below.coefficients) > 1:  # rounding of the method's coefficients
        above = Polynomial(*(c if abs(c) > NEGLIGIBLE * abs(below[k]) else 0 for k, c in enumerate(above.coefficients)))
    return StabilityFunction(above, below)


def a_stable(method: Method) -> bool:
    """True if a method is A-stable; one that treats both blocks differently is not."""
    return method.is_implicit and _function(method).a_stable


def _square_on_axis(p: Polynomial, *, signs: bool = True) -> Polynomial:
    """|p(iy)|² as a polynomial in y²: the real part has the even powers, the imaginary part the odd ones.

    Without their signs it is the sum of the sizes of the terms of each coefficient.
    """
    turned = [-c if signs and k % 4 >= 2 else c for k, c in enumerate(p.coefficients)]
    real, imaginary = Polynomial(*turned[::2]), Polynomial(*turned[1::2])
    square: Polynomial = real * real + Polynomial(0, 1) * imaginary * imaginary
    return square


def _never_negative(p: Polynomial) -> bool:
    """True if a polynomial is nowhere below zero where its unknown is above: tried between its roots, exactly."""
    if not p.coefficients:
        return True
    roots = np.roots([float(c) for c in p.coefficients[::-1]])
    real = sorted(float(x.real) for x in roots if x.real > 0.0 and abs(x.imag) <= 1e-6 * abs(x))
    between = [0.5 * (a + b) for a, b in zip([0.0, *real], [*real, 2.0 * real[-1] + 1.0 if real else 1.0], strict=True)]
    return all(p(Fraction(x)) >= 0 for x in between)


def _term(c: Fraction, power: int) -> str:
    symbol = "" if not power else "z" + (str(power).translate(SUPERSCRIPTS) if power > 1 else "")
    simple = c.limit_denominator(10_000)
    if abs(simple - c) > NEGLIGIBLE * abs(c):
        return f"{float(c):.4g}" + (f"·{symbol}" if symbol else "")
    top = str(abs(simple.numerator)) if abs(simple.numerator) > 1 or not symbol else ""
    return ("-" if c < 0 else "") + f"{top}{symbol}" + (f"/{simple.denominator}" if simple.denominator > 1 else "")
