"""The sine that both languages share: its polynomial in 60 digits, its reduction, and what the analysis asks of it."""

from __future__ import annotations

import decimal
import math
from collections.abc import Iterator
from decimal import Decimal

import numpy as np
import pytest
from stepwell.reference import trig

PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494")


@pytest.fixture(autouse=True)
def sixty_digits() -> Iterator[None]:
    with decimal.localcontext(prec=60):
        yield


def true_sin(x: Decimal) -> Decimal:
    """The series, after whole turns and half turns are taken off."""
    n = int((x / PI).to_integral_value())
    r, total = x - n * PI, Decimal(0)
    term = r
    for k in range(1, 30):  # from there on the terms are below 1e-50
        total += term
        term = -term * r * r / (2 * k * (2 * k + 1))
    return total if n % 2 == 0 else -total


def test_the_polynomial_misses_the_sine_by_less_than_a_quarter_of_1e_18() -> None:
    """Its error oscillates with nine peaks on [0, π/2]; 300 points find each peak of it to a hundredth."""
    worst = Decimal(0)
    for k in range(1, 301):
        r = PI / 2 * k / 300
        z = r * r
        value = r + r * z * sum(Decimal(c) * z**i for i, c in enumerate(trig.CONSTANTS.double.sin))
        worst = max(worst, abs(value - true_sin(r)))
    assert 1e-19 < float(worst) < 2.5e-19  # what is known of the best polynomial of this degree: 1.95e-19


def test_the_parts_of_pi() -> None:
    """The first has 33 bits, so n times it is exact below 2²⁰; both together miss π by what 53 bits of the second leave."""
    first, second = trig.CONSTANTS.double.pi
    assert first.as_integer_ratio()[0].bit_length() <= 33
    assert abs(Decimal(first) + Decimal(second) - PI) <= Decimal(second) / 2**53


@pytest.mark.parametrize("function", [trig.sin, trig.cos], ids=["sin", "cos"])
def test_within_an_ulp_of_one(function: object) -> None:
    """An ulp of 1 is 2⁻⁵². Points near odd multiples of π/2 are the worst: there the last sum rounds at 1."""
    rng = np.random.default_rng(3)
    near = (2 * rng.integers(-300_000, 300_000, 300) + 1) * (math.pi / 2) + rng.uniform(-0.2, 0.2, 300)
    x = np.concatenate([rng.uniform(-2.0, 2.0, 200), rng.uniform(-1e6, 1e6, 200), near])
    values = function(x)  # type: ignore[operator]
    shift = PI / 2 if function is trig.cos else Decimal(0)
    worst = max(abs(Decimal(float(s)) - true_sin(Decimal(float(a)) + shift)) for s, a in zip(values, x, strict=True))
    assert worst <= Decimal(2) ** -52


def test_near_a_multiple_of_pi_the_error_is_far_below_an_ulp_of_one() -> None:
    """n times the second part of π rounds: n·1.2e-10·2⁻⁵³, and the part itself is as far from the rest of π."""
    n = np.arange(1, 300_000, 997)
    x = n * math.pi
    values = trig.sin(x)
    for s, a, k in zip(values.tolist(), x.tolist(), n.tolist(), strict=True):
        allowed = 2 * k * Decimal(trig.CONSTANTS.double.pi[1]) / 2**53 + Decimal(abs(s)) / 2**52
        assert abs(Decimal(s) - true_sin(Decimal(a))) <= allowed


def test_symmetries() -> None:
    x = np.random.default_rng(4).uniform(0.0, 1e5, 10_000)
    np.testing.assert_array_equal(trig.sin(-x), -trig.sin(x))
    np.testing.assert_array_equal(trig.cos(-x), trig.cos(x))
    assert trig.sin(np.zeros(())) == 0.0
    assert trig.cos(np.zeros(())) == 1.0


def test_what_is_not_finite_is_not_a_number() -> None:
    with np.errstate(invalid="ignore"):
        for x in (np.nan, np.inf, -np.inf):
            assert np.isnan(trig.sin(np.array(x)))
            assert np.isnan(trig.cos(np.array(x)))
