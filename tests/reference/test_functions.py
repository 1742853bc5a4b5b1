"""Elementary functions: against multi-precision arithmetic and, where there is nothing to round, against NumPy's.

That the core makes the same bits of them is in ``test_functions_traced.py``.
"""

from __future__ import annotations

import doctest
import importlib.util
import math
from collections.abc import Iterator
from fractions import Fraction
from types import ModuleType
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ShapeError
from stepwell.reference import functions as fn
from stepwell.reference.bits import DOUBLE
from stepwell.reference.functions import (
    exponential,
    hyperbolic,
    inverse,
    logarithms,
    pieces,
    powers,
    roots,
    rounding,
    trigonometric,
)
from stepwell.reference.tape import forms
from support import ROOT
from support.true_functions import OF_ONE, OF_TWO, PRECISION, SPECIALS, TRUE, arguments, errors, same, sizes

PAGE = (ROOT / "docs" / "theory" / "functions.md").read_text(encoding="utf-8")


def table() -> dict[str, list[str]]:
    """The table of docs/theory/functions.md: of each function its cells."""
    lines = [line for line in PAGE.splitlines() if line.startswith("| `")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {name.strip("` "): row[1:] for row in rows for name in row[0].split(",")}


# ---- how accurate they are


def worst(name: str, n: int, seed: int) -> float:
    points = arguments(name, np.random.default_rng(seed), n)
    return float(errors(getattr(fn, name)(*points), name, points).max())


@pytest.mark.parametrize("name", TRUE)
def test_no_result_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    """And none is further than the page tells of many more."""
    largest = worst(name, 3000, 1)
    assert 0.45 < largest < 1.0
    assert largest <= float(table()[name][2])


@pytest.mark.long
@pytest.mark.parametrize("name", TRUE)
def test_none_of_many_results_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    assert worst(name, 60_000, 2) < 1.0


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("sin", 0.7, 0.8),  # the two kernels meet
        ("cos", 0.75, 0.87),
        ("tan", 0.76, 0.79),
        ("expm1", 0.3466, 0.349),  # 1 − 2⁻ⁿ and eʳ − 1 cancel most where n becomes 1
        ("sinh", 0.3466, 0.36),
        ("log", 1.4, 1.415),  # s is largest
        ("log1p", 0.4, 0.415),
    ],
)
def test_where_most_is_lost(name: str, low: float, high: float) -> None:
    x = np.random.default_rng(3).uniform(low, high, 3000)
    assert errors(getattr(fn, name)(x), name, (x,)).max() < 1.0


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_beyond_the_exact_reduction_the_error_is_that_of_a_rounded_argument(name: str) -> None:
    """n times the first part of π/2 is rounded, by 2⁻⁵³ of nearly x; the other parts are 2⁻³⁰ of that; the result is rounded."""
    x = sizes(np.random.default_rng(4), 300, 24.0, 50.0)
    with mp.workprec(PRECISION):
        for result, v in zip(getattr(fn, name)(x).tolist(), x.tolist(), strict=True):
            assert abs(mp.mpf(result) - TRUE[name](mp.mpf(v))) <= v * 2.0**-53 * (1 + 2.0**-28) + 2.0**-52


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_an_angle_that_is_too_large_has_none(name: str) -> None:
    assert np.isnan(getattr(fn, name)(np.array([np.nextafter(2.0**50, np.inf), -1e300, math.inf]))).all()
    assert not np.isnan(getattr(fn, name)(np.array([2.0**50, -(2.0**50)]))).any()


CONSTANTS = [
    (trigonometric, "sin", "sin"),
    (trigonometric, "cos", "cos"),
    (exponential, "exp", "expm1"),
    (exponential, "exp_short", "exp"),
    (exponential, "exp2", "exp2"),
    (logarithms, "log", "log"),
    (hyperbolic, "sinh", "sinh"),
    (hyperbolic, "cosh", "cosh"),
    (inverse, "atan", "arctan"),
    (inverse, "asin", "arcsin"),
    (powers, "log_long", "power"),
    (trigonometric, "half_pi", "sin"),
    (exponential, "ln2", "exp"),
    (inverse, "quarter_pi", "arctan"),
    (logarithms, "log10_2", "log10"),
]


def with_constants(monkeypatch: pytest.MonkeyPatch, module: ModuleType, precision: str, **constants: Any) -> None:
    """Let functions of one precision have other constants."""
    records = module.CONSTANTS
    monkeypatch.setattr(module, "CONSTANTS", records._replace(**{precision: getattr(records, precision)._replace(**constants)}))


@pytest.mark.mutant
@pytest.mark.parametrize(("module", "constant", "name"), CONSTANTS, ids=[c for _, c, _ in CONSTANTS])
def test_a_wrong_constant_is_noticed(module: ModuleType, constant: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its second part is wrong by a hundredth; π/4's by ten times itself, since it is below an ulp. That is more than an ulp."""
    first, second, *rest = getattr(module.CONSTANTS.double, constant)
    value = (first, second * (10.0 if constant == "quarter_pi" else 1.01), *rest)
    with_constants(monkeypatch, module, "double", **{constant: value})
    assert worst(name, 1000, 1) > 1.0


@pytest.mark.mutant
@pytest.mark.parametrize("name", ["exp", "expm1", "exp2"])
@pytest.mark.parametrize(
    ("piece", "wrong"),
    [
        (
            "by_parity",
            lambda x, z, coefficients: pieces.polynomial(z, coefficients[::2]) + pieces.polynomial(z, coefficients[1::2]),
        ),
        ("magic", lambda x, low: DOUBLE.magic + DOUBLE.bias),
    ],
    ids=["odd powers without their x", "one scale for all exponents"],
)
def test_a_wrong_piece_is_noticed(name: str, piece: str, wrong: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exponential, piece, wrong)
    assert worst(name, 1000, 1) > 1.0


def test_the_coefficients_are_those_that_the_script_finds() -> None:
    spec = importlib.util.spec_from_file_location("coefficients", ROOT / "docs" / "coefficients.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    before = mp.mp.dps
    try:
        spec.loader.exec_module(script)
        records = {constant.upper(): module.CONSTANTS for module, constant, _ in CONSTANTS}
        doubles = {name: getattr(constants.double, name.lower()) for name, constants in records.items()}
        doubles["EXP_QUICK"] = forms.EXP_QUICK
        assert set(script.FITS) <= set(doubles)
        for constant, inputs in script.FITS.items():
            coefficients, error = script.fit(*inputs)
            assert tuple(coefficients) == doubles[constant]
            assert error < 2.0**-57  # a sixteenth of an ulp of 1
        for constant, inputs in script.SINGLE_FITS.items():
            coefficients, error = script.fit(*inputs, np.float32)
            assert tuple(coefficients) == getattr(records[constant].single, constant.lower())
            assert error < 2.0**-26
    finally:
        mp.mp.dps = before


# ---- at the ends


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with np.errstate(all="ignore"):  # of NumPy's own functions
        yield


@pytest.mark.parametrize("name", OF_ONE)
def test_at_zeros_infinities_and_nan_as_numpy(name: str) -> None:
    """Signs of zero included; other results may differ by two ulp, one for either side."""
    mine, theirs = getattr(fn, name)(SPECIALS), getattr(np, name)(SPECIALS)
    beyond = (abs(SPECIALS) > 2.0**50) & (name in ("sin", "cos", "tan"))
    assert np.isnan(mine[beyond]).all()
    exact = ~np.isfinite(theirs) | (theirs == 0.0) | (abs(theirs) == 1.0)
    near = abs(mine - theirs) <= 2 * np.spacing(abs(theirs))
    assert (np.where(exact, same(mine, theirs), near & (np.signbit(mine) == np.signbit(theirs))) | beyond).all()


@pytest.mark.parametrize("name", OF_TWO)
def test_pairs_of_zeros_infinities_and_nan_as_numpy(name: str) -> None:
    x, y = (each.reshape(-1) for each in np.meshgrid(SPECIALS, SPECIALS))
    mine, theirs = getattr(fn, name)(x, y), getattr(np, name)(x, y)
    exact = ~np.isfinite(theirs) | (theirs == 0.0) | (abs(theirs) == 1.0)
    near = abs(mine - theirs) <= 2 * np.spacing(abs(theirs))
    right = np.where(exact, same(mine, theirs), near & (np.signbit(mine) == np.signbit(theirs)))
    if name in ("mod", "remainder"):
        beyond = np.isfinite(x) & np.isfinite(y) & (abs(x / y) >= 2.0**52)
        assert np.isnan(mine[beyond]).all()
        right |= beyond
    assert right.all()


def test_what_is_exact_is_numpys_to_the_bit() -> None:
    rng = np.random.default_rng(5)
    x = np.concatenate([SPECIALS, rng.uniform(-50.0, 50.0, 3000), rng.integers(-99, 99, 3000) / 2, sizes(rng, 3000)])
    y = rng.permutation(x)
    for name in ("floor", "ceil", "trunc", "round", "abs", "sign", "sqrt", "square"):
        assert same(getattr(fn, name)(x), getattr(np, name)(x)).all(), name
    for name in ("minimum", "maximum", "copysign"):
        assert same(getattr(fn, name)(x, y), getattr(np, name)(x, y)).all(), name
    assert same(fn.clip(x, -1.0, y), np.minimum(np.maximum(x, -1.0), y)).all()
    assert same(fn.where(x < y, x, 3.0), np.where(x < y, x, 3.0)).all()


def test_what_remains_of_a_division_is_exact() -> None:
    """By rational arithmetic; NumPy's too, but it says less where the signs differ and a sum is rounded."""
    rng = np.random.default_rng(6)
    y = sizes(rng, 2000) * rng.choice([-1.0, 1.0], 2000)
    x = np.concatenate(
        [y[:1000] * rng.integers(-999, 999, 1000), y[1000:] * rng.uniform(-1.0, 1.0, 1000) * 2.0 ** rng.integers(0, 51, 1000)]
    )
    x = np.where(np.isfinite(x), x, 1.0)
    for result, a, b in zip(fn.mod(x, y).tolist(), x.tolist(), y.tolist(), strict=True):
        if abs(Fraction(a) / Fraction(b)) < 2**52:
            true = math.fmod(a, b)  # exact, with the sign of a
            true = true + b if true and (true < 0) != (b < 0) else math.copysign(true, b) if true == 0.0 else true
            assert result == true
            assert math.copysign(1.0, result) == math.copysign(1.0, true)


# ---- powers


@pytest.mark.parametrize("exponent", [*range(-16, 17), *(k / 2 for k in range(-9, 10, 2)), 15.5, -15.5])
def test_known_powers_are_products_in_the_order_that_is_told(exponent: float) -> None:
    """A product of n factors is rounded n − 1 times, whichever way it is made; root and quotient are one more each."""
    x = np.random.default_rng(7).uniform(0.2, 3.0, 300)
    powers, n = fn.power(x, exponent), int(abs(exponent))
    halved, below = n != abs(exponent), exponent < 0
    if exponent == 7:
        assert same(powers, (x * (x * x)) * ((x * x) * (x * x))).all()
    if exponent == -2.5:
        assert same(powers, 1.0 / ((x * x) * np.sqrt(x))).all()
    bound = max(n - 1, 0) + 2 * halved + below
    got = errors(powers, "power", (x, np.full(300, float(exponent))))
    assert got.max() <= bound + 0.001


def test_known_powers_at_the_ends() -> None:
    for exponent in (-3, -2, -1, 0, 1, 2, 3, 16, 1.5, -0.5, 0.5):
        mine, theirs = fn.power(SPECIALS, exponent), np.power(SPECIALS, np.full(SPECIALS.shape, float(exponent)))
        exact = (~np.isfinite(SPECIALS) | (SPECIALS == 0.0)) & ~(np.isneginf(SPECIALS) & (exponent % 1 != 0))
        assert same(mine[exact], theirs[exact]).all()
    assert np.isnan(fn.power(-math.inf, 0.5))  # C has infinity
    # A number and an array of it are not the same exponent: the one is known, the other is not.
    assert fn.power(1.1, 16) != fn.power(1.1, np.array([16.0]))[0]


# ---- what they take and give


def test_numbers_and_arrays_of_any_shape_broadcast() -> None:
    assert isinstance(fn.sin(1), float)
    assert fn.sin(np.zeros(())).shape == ()
    assert fn.sin(np.zeros((2, 0, 3))).shape == (2, 0, 3)
    assert fn.arctan2(np.ones((2, 1)), np.ones(3)).shape == (2, 3)
    assert fn.exp([0, 1]).shape == (2,)
    assert fn.arctan2(x=1.0, y=0.0) == 0.0
    assert fn.where(True, 1.0, 2.0) == 1.0
    x = np.linspace(-3.0, 3.0, 7)
    assert same(fn.exp(x), [fn.exp(float(each)) for each in x]).all()
    assert same(fn.exp(x[::-1]), fn.exp(x)[::-1]).all()
    assert (x == np.linspace(-3.0, 3.0, 7)).all()


def test_examples_print_what_they_say() -> None:
    modules = [exponential, hyperbolic, inverse, logarithms, powers, rounding, roots, trigonometric]
    counts = [doctest.testmod(module) for module in modules]
    assert [(count.failed, count.attempted) for count in counts] == [(0, 1)] * len(modules)


@pytest.mark.parametrize("wrong", ["1", None, 1j, object(), [[1.0], [1.0, 2.0]], np.array(["a"])])
def test_what_is_no_number_is_refused_by_name(wrong: Any) -> None:
    with pytest.raises(sw.StepwellError, match=r"^x: "):
        fn.sin(wrong)
    with pytest.raises(sw.StepwellError, match=r"^y: "):
        fn.power(1.0, wrong)
    with pytest.raises(sw.StepwellError, match=r"^condition: "):
        fn.where(wrong, 1.0, 2.0)
    for mismatched in (lambda: fn.hypot([1.0, 2.0], np.ones(3)), lambda: fn.where([True, False], np.ones(3), 1.0)):
        with pytest.raises(ShapeError, match=r"expected shapes that broadcast, got \(2,\) and \(3,\)"):
            mismatched()
    with pytest.raises(TypeError):
        fn.sin()  # type: ignore[call-arg]


# ---- the page


@pytest.mark.parametrize("name", [*OF_ONE, *OF_TWO])
def test_the_page_tells_the_operations_on_the_tape(name: str) -> None:
    tape = _core.Tape()
    symbol = getattr(fn, name)(*map(tape.state, range(2 if name in OF_TWO else 1)))
    kinds = [kind for kind, _, _ in tape.operations([symbol])[0] if kind not in ("state", "constant")]
    slow = sum(kind in ("divide", "square root") for kind in kinds)
    assert table()[name][:2] == [str(len(kinds)), str(slow)]


def test_the_page_tells_what_two_functions_take_together() -> None:
    tape = _core.Tape()
    x = tape.state(0)
    for words, symbols in {
        "sine and cosine of one angle are": [fn.sin(x), fn.cos(x)],
        "hyperbolic sine and cosine": [fn.sinh(x), fn.cosh(x)],
        "`power(x, 2.3)` is": [fn.power(x, 2.3)],
        "`power(2.0, y)`": [fn.power(2.0, x)],
    }.items():
        operations = sum(kind not in ("state", "constant") for kind, _, _ in tape.operations(symbols)[0])
        assert f"{words} {operations}" in PAGE


def test_odd_and_even_functions_are_so_to_the_bit() -> None:
    for name in ("sin", "tan", "arcsin", "arctan", "sinh", "tanh", "cbrt", "round", "trunc", "cos", "cosh"):
        f, sign = getattr(fn, name), 1.0 if name in ("cos", "cosh") else -1.0
        x = np.concatenate([SPECIALS, *arguments(name, np.random.default_rng(9), 400)])
        assert same(f(-x), sign * f(x)).all()


def test_the_page_has_every_function() -> None:
    assert set(table()) == set(fn.__all__)
