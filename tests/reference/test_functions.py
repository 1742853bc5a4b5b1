"""Elementary functions: against multi-precision arithmetic and, where there is nothing to round, against NumPy's.

That the core makes the same bits of them is in ``test_functions_traced.py``.
"""

import doctest
import importlib.util
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from types import ModuleType
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ShapeError
from stepwell.reference import bits, trig
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
from stepwell.reference.functions.logarithms import logaddexp
from stepwell.reference.tape import forms
from stepwell.reference.tape.evaluate import Evaluation
from support import ROOT
from support.refusals import refused
from support.true_functions import OF_ONE, OF_TWO, PRECISION, SPECIALS, TRUE, arguments, errors, same, sizes
from support.ways import assert_equal_ways

PAGE = (ROOT / "docs" / "theory" / "functions.md").read_text(encoding="utf-8")


def table() -> dict[str, list[str]]:
    """The table of docs/theory/functions.md: of each function its cells."""
    lines = [line for line in PAGE.splitlines() if line.startswith("| `")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {name.strip("` "): row[1:] for row in rows for name in row[0].split(",")}


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


def test_where_most_is_lost() -> None:
    for name, low, high in (
        ("sin", 0.7, 0.8),  # the two kernels meet
        ("cos", 0.75, 0.87),
        ("tan", 0.76, 0.79),
        ("expm1", 0.3466, 0.349),  # 1 − 2⁻ⁿ and eʳ − 1 cancel most where n becomes 1
        ("sinh", 0.3466, 0.36),
        ("log", 1.4, 1.415),  # s is largest
        ("log1p", 0.4, 0.415),
    ):
        x = np.random.default_rng(3).uniform(low, high, 2000)
        assert errors(getattr(fn, name)(x), name, (x,)).max() < 1.0, name


def test_large_angles() -> None:
    """Beyond the exact reduction the error is that of a rounded argument; beyond 2⁵⁰ there is none.

    n times the first part of π/2 is rounded, by 2⁻⁵³ of nearly x; the other parts are 2⁻³⁰ of that; the result is rounded.
    """
    x = sizes(np.random.default_rng(4), 300, 24.0, 50.0)
    with mp.workprec(PRECISION):
        for name in ("sin", "cos"):
            for result, v in zip(getattr(fn, name)(x).tolist(), x.tolist(), strict=True):
                assert abs(mp.mpf(result) - TRUE[name](mp.mpf(v))) <= v * 2.0**-53 * (1 + 2.0**-28) + 2.0**-52
    for f in (fn.sin, fn.cos, fn.tan):
        assert np.isnan(f(np.array([np.nextafter(2.0**50, np.inf), -1e300, math.inf]))).all()
        assert not np.isnan(f(np.array([2.0**50, -(2.0**50)]))).any()


CONSTANTS = [
    *((trigonometric, name, name) for name in ("sin", "cos")),
    *((exponential, *names) for names in (("exp", "expm1"), ("exp_short", "exp"), ("exp2", "exp2"))),
    *((hyperbolic, name, name) for name in ("sinh", "cosh")),
    *((inverse, *names) for names in (("atan", "arctan"), ("asin", "arcsin"), ("quarter_pi", "arctan"))),
    *((logarithms, *names) for names in (("log", "log"), ("log10_2", "log10"))),
    (powers, "log_long", "power"),
    (trigonometric, "half_pi", "sin"),
    (exponential, "ln2", "exp"),
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


def odd_powers_without_x(x: Any, z: Any, coefficients: Any) -> Any:
    return pieces.polynomial(z, coefficients[::2]) + pieces.polynomial(z, coefficients[1::2])


def one_scale_for_all_exponents(x: Any, low: Any) -> Any:
    return DOUBLE.magic + DOUBLE.bias


@pytest.mark.mutant
@pytest.mark.parametrize("name", ["exp", "expm1", "exp2"])
@pytest.mark.parametrize(("piece", "wrong"), [("by_parity", odd_powers_without_x), ("magic", one_scale_for_all_exponents)])
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


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with np.errstate(all="ignore"):  # of NumPy's own functions
        yield


@pytest.mark.parametrize("names", [OF_ONE, OF_TWO], ids=["one", "two"])
def test_at_zeros_infinities_and_nan_as_numpy(names: Any) -> None:
    """Signs of zero included; other results may differ by two ulp, one for either side."""
    x, y = (each.reshape(-1) for each in np.meshgrid(SPECIALS, SPECIALS))
    for name in names:
        numbers = (SPECIALS,) if names is OF_ONE else (x, y)
        mine, theirs = getattr(fn, name)(*numbers), getattr(np, name)(*numbers)
        beyond = (abs(numbers[0]) > 2.0**50) & (name in ("sin", "cos", "tan"))
        if name in ("mod", "remainder"):
            beyond = np.isfinite(x) & np.isfinite(y) & (abs(x / y) >= 2.0**52)
        assert np.isnan(mine[beyond]).all(), name
        exact = ~np.isfinite(theirs) | (theirs == 0.0) | (abs(theirs) == 1.0)
        near = abs(mine - theirs) <= 2 * np.spacing(abs(theirs))
        right = np.where(exact, same(mine, theirs), near & (np.signbit(mine) == np.signbit(theirs)))
        assert (right | beyond).all(), name


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


def test_known_powers_are_products_in_the_order_that_is_told() -> None:
    """A product of n factors is rounded n − 1 times, whichever way it is made; root and quotient are one more each."""
    x = np.random.default_rng(7).uniform(0.2, 3.0, 200)
    for exponent in (*range(-16, 17), *(k / 2 for k in range(-9, 10, 2)), 15.5, -15.5):
        products, n = fn.power(x, exponent), int(abs(exponent))
        halved, below = n != abs(exponent), exponent < 0
        if exponent == 7:
            assert same(products, (x * (x * x)) * ((x * x) * (x * x))).all()
        if exponent == -2.5:
            assert same(products, 1.0 / ((x * x) * np.sqrt(x))).all()
        bound = max(n - 1, 0) + 2 * halved + below
        assert errors(products, "power", (x, np.full(200, float(exponent)))).max() <= bound + 0.001, exponent


def test_known_powers_at_the_ends() -> None:
    for exponent in (-3, -2, -1, 0, 1, 2, 3, 16, 1.5, -0.5, 0.5):
        mine, theirs = fn.power(SPECIALS, exponent), np.power(SPECIALS, np.full(SPECIALS.shape, float(exponent)))
        exact = (~np.isfinite(SPECIALS) | (SPECIALS == 0.0)) & ~(np.isneginf(SPECIALS) & (exponent % 1 != 0))
        assert same(mine[exact], theirs[exact]).all()
    assert np.isnan(fn.power(-math.inf, 0.5))  # C has infinity
    # A number and an array of it are not the same exponent: the one is known, the other is not.
    assert fn.power(1.1, 16) != fn.power(1.1, np.array([16.0]))[0]


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


def test_what_is_no_number_is_refused_by_name() -> None:
    wrongs: list[Any] = ["1", None, 1j, object(), [[1.0], [1.0, 2.0]], np.array(["a"])]
    for wrong in wrongs:
        refused(sw.StepwellError, r"^x: ", fn.sin, wrong)
        refused(sw.StepwellError, r"^y: ", fn.power, 1.0, wrong)
        refused(sw.StepwellError, r"^condition: ", fn.where, wrong, 1.0, 2.0)
    for mismatched in (lambda: fn.hypot([1.0, 2.0], np.ones(3)), lambda: fn.where([True, False], np.ones(3), 1.0)):
        refused(ShapeError, r"expected shapes that broadcast, got \(2,\) and \(3,\)", mismatched)
    with pytest.raises(TypeError):
        fn.sin()  # type: ignore[call-arg]


def test_the_page_tells_the_operations_on_the_tape() -> None:
    written = table()
    for name in (*OF_ONE, *OF_TWO):
        tape = _core.Tape()
        symbol = getattr(fn, name)(*map(tape.state, range(2 if name in OF_TWO else 1)))
        kinds = [kind for kind, _, _ in tape.operations([symbol])[0] if kind not in ("state", "constant")]
        slow = sum(kind in ("divide", "square root") for kind in kinds)
        assert written[name][:2] == [str(len(kinds)), str(slow)], name


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


F = np.float32


def function(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function of float32 by its tape."""
    tape = _core.Tape(single=True)
    run = Evaluation(tape, [f(tape.state(0))], {})

    def of(x: Any) -> Any:
        with np.errstate(all="ignore"):
            return np.broadcast_to(run([x], 0.0, 1.0)[0], np.shape(x))

    return of


def blocks(long: bool, stride: int = 9973) -> Iterator[Any]:
    """Numbers of float32: all of them, or one in so many, a prime, with zeros, infinities and the ends of the ranges."""
    if not long:
        yield np.arange(0, 2**32, stride, dtype=np.uint64).astype(np.uint32).view(F)
        ends = np.array([0, 1, 0x7FFFFF, 0x800000, 0x3F800000, 0x7F7FFFFF, 0x7F800000, 0x42B17218, 0x3F3504F3], dtype=np.uint32)
        yield np.concatenate([ends, ends + np.uint32(1), ends | np.uint32(1 << 31)]).view(F)
        return
    for first in range(0, 2**32, 2**22):
        yield np.arange(first, first + 2**22, dtype=np.uint64).astype(np.uint32).view(F)


def worst_of_single(f: Callable[[Any], Any], truth: Callable[[Any], Any], within: float = math.inf, long: bool = False) -> float:
    """The largest error of a function in units in the last place of the result; infinite where it is wrong beside all numbers.

    The truth is NumPy's of float64, within 2⁻⁵² or so of its result: 2⁻²⁸ of a unit here.
    """
    return max(error_of_singles(f(x), truth(x.astype(float))) for x in (x[~(np.abs(x) > within)] for x in blocks(long)))


def error_of_singles(results: Any, truths: Any) -> float:
    """In units in the last place; infinite where results are not finite and wrong."""
    results, rounded = results.astype(float), truths.astype(F)
    ends = ~(np.isfinite(rounded) & np.isfinite(results))
    if not np.array_equal(results[ends], rounded[ends], equal_nan=True):
        return math.inf
    results, truths = results[~ends], truths[~ends]
    _, exponent = np.frexp(truths)
    return float((np.abs(results - truths) / np.ldexp(1.0, np.maximum(exponent - 24, -149))).max(initial=0.0))


TRUE_OF_SINGLES: dict[str, tuple[Callable[[Any], Any], float, float]] = {
    **{name: (getattr(np, name), 12_867.0, most) for name, most in {"sin": 0.80, "cos": 0.82, "tan": 0.90}.items()},
    **{
        name: (getattr(np, name), math.inf, most)
        for name, most in {
            "exp": 0.78, "log": 0.84, "arcsin": 0.65, "arccos": 0.60, "arctan": 0.85, "sinh": 0.92, "cosh": 0.92, "tanh": 0.88,
            "exp2": 0.80, "expm1": 0.92, "log1p": 0.94, "log2": 0.80, "log10": 0.70, "cbrt": 0.52, "sqrt": 0.501, "round": 0.0,
            "floor": 0.0, "abs": 0.0, "sign": 0.0,
        }.items()
    },
}  # fmt: skip


def pairs_of_singles(n: int) -> tuple[Any, Any]:
    """Pairs of numbers of float32: any, some of like sizes, and some whose powers are finite."""
    rng = np.random.default_rng(3)
    a, b = (rng.integers(0, 2**32, n, dtype=np.uint64).astype(np.uint32).view(F) for _ in range(2))
    normal = rng.normal(size=(2, n)).astype(F)
    wide, powers = np.exp(9.0 * rng.normal(size=n)).astype(F), (4.0 * rng.normal(size=n)).astype(F)
    return np.concatenate([a, normal[0], wide]), np.concatenate([b, normal[1], powers])


def test_the_logarithm_of_a_sum_of_exponentials() -> None:
    """With a rounding of the larger argument, and of what is added to it; infinities as in NumPy."""
    ends = np.array([-np.inf, -800.0, -1.0, -0.0, 0.0, 1e-9, 1.0, 800.0, np.inf, np.nan])
    x = np.concatenate([ends, np.random.default_rng(1).normal(size=40) * 30.0])
    x, y = x[:, np.newaxis], x
    with np.errstate(all="ignore"):
        true, finite = np.logaddexp(x, y), np.isfinite(x + y)
        error = np.abs(logaddexp(x, y) - true)[finite]
    assert (error <= 2.0 * np.spacing(np.maximum(np.maximum(np.abs(x), np.abs(y)), 1.0))[finite]).all()
    np.testing.assert_array_equal(logaddexp(x, y)[~finite], true[~finite])


@pytest.mark.parametrize("name", ["arctan2", "hypot", "mod", "power"])
def test_no_result_of_two_numbers_of_float32_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    tape = _core.Tape(single=True)
    run = Evaluation(tape, [getattr(fn, name)(tape.state(0), tape.state(1))], {})
    a, b = pairs_of_singles(100_000)
    if name == "mod":  # NaN beyond, and NumPy's has as many digits as it takes
        near = np.abs(a.astype(float) / b) < 2.0**23
        a, b = a[near], b[near]
    assert error_of_singles(run([a, b], 0.0, 1.0)[0], getattr(np, name)(a.astype(float), b.astype(float))) < 0.8


def test_no_result_of_float32_is_further_than_an_ulp_from_the_truth() -> None:
    for name, (truth, within, most) in TRUE_OF_SINGLES.items():
        assert worst_of_single(function(getattr(fn, name)), truth, within) <= most < 1.0, name


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name, (_, _, most) in TRUE_OF_SINGLES.items() if most > 0.501])
def test_none_of_all_results_of_float32_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    truth, within, most = TRUE_OF_SINGLES[name]
    largest = worst_of_single(function(getattr(fn, name)), truth, within, long=True)
    assert (most - 0.03 if name in ("sin", "cos", "exp", "log") else 0.0) < largest <= most


SINES, EXPONENTIALS, LOGARITHMS = (each.CONSTANTS.single for each in (trigonometric, exponential, logarithms))


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("name", "module", "constant", "value"),
    [
        ("sin", trigonometric, "sin", (-0.1666666, *SINES.sin[1:])),
        ("cos", trigonometric, "cos", (0.0416, *SINES.cos[1:])),
        ("sin", trigonometric, "half_pi", (*SINES.half_pi[:3], 0.0)),
        ("exp", exponential, "exp_short", (*EXPONENTIALS.exp_short[:3], 0.0083, EXPONENTIALS.exp_short[4])),
        ("exp", exponential, "overflow_from", 90.0),
        ("exp", exponential, "underflow_until", -87.0),
        ("log", logarithms, "log", (LOGARITHMS.log[0], 0.399, *LOGARITHMS.log[2:])),
    ],
)
def test_a_wrong_constant_of_float32_is_noticed(
    name: str, module: ModuleType, constant: str, value: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_constants(monkeypatch, module, "single", **{constant: value})
    truth, within, most = TRUE_OF_SINGLES[name]
    assert worst_of_single(function(getattr(fn, name)), truth, within) > most


@pytest.mark.mutant
def test_logarithms_that_scale_no_subnormal_numbers_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bits.SINGLE, "least_normal", 0.0)
    truth, within, most = TRUE_OF_SINGLES["log"]
    assert worst_of_single(function(fn.log), truth, within) > most


def test_the_sine_of_built_in_systems() -> None:
    """Within an ulp of 1, 2⁻²³, up to 6433 rad; from there on within the effect of rounding the argument and that."""
    sine = function(lambda x: trig.sin(np.array([x], dtype=object))[0])
    for x in blocks(False, 1511):
        x = x[np.abs(x) < 2.0**21].astype(float)
        error = np.abs(sine(x.astype(F)).astype(float) - np.sin(x))
        small = np.abs(x) <= 6433.0
        assert error[small].max(initial=0.0) <= 2.0**-23
        assert (error <= 2.0**-23 + 2.0**-24 * np.abs(x)).all()


def test_the_sine_and_cosine_of_large_angles() -> None:
    for name, truth in (("sin", np.sin), ("cos", np.cos)):
        f = function(getattr(fn, name))
        x = F(10.0) ** np.linspace(4.2, 6.3, 20_000).astype(F)
        error = np.abs(f(x).astype(float) - truth(x.astype(float)))
        assert (error <= 2.0**-24 + 2.0**-24 * np.abs(x)).all()
        assert np.isnan(f(np.array([2.2e6, np.inf, np.nan], dtype=F))).all()


EQUATIONS: list[Callable[[Any, Any, Any], Any]] = [
    lambda t, y, k: np.exp(-k * y) * np.cos(y) + np.log(1.0 + y * y) + np.sqrt(np.abs(y)) * np.sin(t) - y**3,
    lambda t, y, k: np.tan(np.arctan(y) / 2.0) + np.arcsin(y / 9.0) + np.arccos(y / 9.0) + np.arctan2(y, k) - 3.0 * y,
    lambda t, y, k: (
        np.tanh(y) + np.sinh(y / 9.0) - np.cosh(y / 9.0) - 0.1 * np.round(3.0 * y) + np.cbrt(y) + np.hypot(y, k) - 3.0 * y
    ),
    lambda t, y, k: np.power(2.0 + 0.1 * y, k) + np.exp2(0.1 * y) + np.expm1(0.1 * y) + np.mod(y, k) - 3.0 * y,
    lambda t, y, k: np.log1p(y * y) + np.log2(1.0 + y * y) - np.log10(2.0 + np.clip(y, 0.0, 1.0)) - 3.0 * y,
]


@pytest.mark.parametrize("rate", EQUATIONS)
def test_functions_in_equations_of_ones_own(rate: Callable[[Any, Any, Any], Any]) -> None:
    """In float32, by every level; beside jumps of a remainder near what float64 has."""
    system = sw.system(order=1)(lambda t, y, *, k=1.0: rate(t, y, k))(k=np.linspace(0.5, 1.0, 50))
    options: dict[str, Any] = {"y": np.linspace(-2.0, 2.0, 50), "dt": 0.05, "steps": 100, "every": 50}
    run = assert_equal_ways(system, "rk4", ways=("by the reference", "at each level"), dtype="float32", **options)
    wide = sw.integrate(system, "rk4", **options)
    assert 0.0 < np.abs(run.y - wide.y).max() < 0.1
    assert np.median(np.abs(run.y[1] - wide.y[1])) < 1e-6


@mp.workdps(60)
def test_the_polynomial_misses_the_sine_by_less_than_a_quarter_of_1e_18() -> None:
    """Its error oscillates with nine peaks on [0, π/2]; 300 points find each peak of it to a hundredth."""
    worst = mp.mpf(0)
    for k in range(1, 301):
        r = mp.pi / 2 * k / 300
        value = r + r**3 * sum(mp.mpf(c) * r ** (2 * i) for i, c in enumerate(trig.CONSTANTS.double.sin))
        worst = max(worst, abs(value - mp.sin(r)))
    assert 1e-19 < worst < 2.5e-19  # what is known of the best polynomial of this degree: 1.95e-19


@mp.workdps(60)
def test_the_parts_of_pi() -> None:
    """The first has 33 bits, so n times it is exact below 2²⁰; both together miss π by what 53 bits of the second leave."""
    first, second = trig.CONSTANTS.double.pi
    assert first.as_integer_ratio()[0].bit_length() <= 33
    assert abs(mp.mpf(first) + second - mp.pi) <= second / 2**53


@mp.workdps(60)
def test_within_an_ulp_of_one() -> None:
    """An ulp of 1 is 2⁻⁵². Points near odd multiples of π/2 are the worst: there the last sum rounds at 1."""
    rng = np.random.default_rng(3)
    near = (2 * rng.integers(-300_000, 300_000, 300) + 1) * (math.pi / 2) + rng.uniform(-0.2, 0.2, 300)
    x = np.concatenate([rng.uniform(-2.0, 2.0, 200), rng.uniform(-1e6, 1e6, 200), near])
    for function, true in ((trig.sin, mp.sin), (trig.cos, mp.cos)):
        assert max(abs(s - true(mp.mpf(a))) for s, a in zip(function(x).tolist(), x.tolist(), strict=True)) <= 2.0**-52


@mp.workdps(60)
def test_near_a_multiple_of_pi_the_error_is_far_below_an_ulp_of_one() -> None:
    """n times the second part of π rounds: n·1.2e-10·2⁻⁵³, and the part itself is as far from the rest of π."""
    n = np.arange(1, 300_000, 997)
    for s, a, k in zip(trig.sin(n * math.pi).tolist(), (n * math.pi).tolist(), n.tolist(), strict=True):
        assert abs(s - mp.sin(mp.mpf(a))) <= 2 * k * mp.mpf(trig.CONSTANTS.double.pi[1]) / 2**53 + mp.mpf(abs(s)) / 2**52


def test_symmetries_and_what_is_no_number() -> None:
    x = np.random.default_rng(4).uniform(0.0, 1e5, 10_000)
    np.testing.assert_array_equal(trig.sin(-x), -trig.sin(x))
    np.testing.assert_array_equal(trig.cos(-x), trig.cos(x))
    assert (trig.sin(np.zeros(())), trig.cos(np.zeros(()))) == (0.0, 1.0)
    for function in (trig.sin, trig.cos):
        assert np.isnan(function(np.array([np.nan, np.inf, -np.inf]))).all()
