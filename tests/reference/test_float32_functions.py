"""Functions and fused multiply-adds of float32: how far each is from the truth, for all of its numbers in the long run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference import bits, functions, trig
from stepwell.reference.functions import exponential, logarithms, trigonometric
from stepwell.reference.tape.evaluate import Evaluation
from support.cases import assert_same

F = np.float32


# ---- functions


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


def worst(f: Callable[[Any], Any], truth: Callable[[Any], Any], within: float = math.inf, long: bool = False) -> float:
    """The largest error of a function in units in the last place of the result; infinite where it is wrong beside all numbers.

    The truth is NumPy's of float64, within 2⁻⁵² or so of its result: 2⁻²⁸ of a unit here.
    """
    most = 0.0
    for x in blocks(long):
        x = x[~(np.abs(x) > within)]
        with np.errstate(all="ignore"):
            want, got = truth(x.astype(float)), f(x).astype(float)
            rounded = want.astype(F)
        ends = ~(np.isfinite(rounded) & np.isfinite(got))
        if not np.array_equal(got[ends], rounded[ends], equal_nan=True):
            return math.inf
        want, got = want[~ends], got[~ends]
        _, exponent = np.frexp(want)
        most = max(most, float((np.abs(got - want) / np.ldexp(1.0, np.maximum(exponent - 24, -149))).max(initial=0.0)))
    return most


#: Of each function the truth, up to where it holds, and the largest error of all arguments, found by the long test.
TRUE: dict[str, tuple[Callable[[Any], Any], float, float]] = {
    "sin": (np.sin, 12_867.0, 0.80),
    "cos": (np.cos, 12_867.0, 0.82),
    "exp": (np.exp, math.inf, 0.78),
    "log": (np.log, math.inf, 0.84),
    "tan": (np.tan, 12_867.0, 0.90),
    "arcsin": (np.arcsin, math.inf, 0.65),
    "arccos": (np.arccos, math.inf, 0.60),
    "arctan": (np.arctan, math.inf, 0.85),
    "sinh": (np.sinh, math.inf, 0.92),
    "cosh": (np.cosh, math.inf, 0.92),
    "tanh": (np.tanh, math.inf, 0.88),
    "exp2": (np.exp2, math.inf, 0.80),
    "expm1": (np.expm1, math.inf, 0.92),
    "log1p": (np.log1p, math.inf, 0.94),
    "log2": (np.log2, math.inf, 0.80),
    "log10": (np.log10, math.inf, 0.70),
    "cbrt": (np.cbrt, math.inf, 0.52),
    "sqrt": (np.sqrt, math.inf, 0.501),
    "round": (np.round, math.inf, 0.0),
    "floor": (np.floor, math.inf, 0.0),
    "abs": (np.abs, math.inf, 0.0),
    "sign": (np.sign, math.inf, 0.0),
}


def pairs(n: int) -> tuple[Any, Any]:
    """Pairs of numbers of float32: any, some of like sizes, and some whose powers are finite."""
    rng = np.random.default_rng(3)
    a, b = (rng.integers(0, 2**32, n, dtype=np.uint64).astype(np.uint32).view(F) for _ in range(2))
    normal = rng.normal(size=(2, n)).astype(F)
    wide, powers = np.exp(9.0 * rng.normal(size=n)).astype(F), (4.0 * rng.normal(size=n)).astype(F)
    return np.concatenate([a, normal[0], wide]), np.concatenate([b, normal[1], powers])


@pytest.mark.parametrize("name", ["arctan2", "hypot", "mod", "power"])
def test_no_result_of_two_numbers_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    tape = _core.Tape(single=True)
    run = Evaluation(tape, [getattr(functions, name)(tape.state(0), tape.state(1))], {})
    a, b = pairs(100_000)
    with np.errstate(all="ignore"):
        if name == "mod":  # NaN beyond, and NumPy's has as many digits as it takes
            near = np.abs(a.astype(float) / b) < 2.0**23
            a, b = a[near], b[near]
        want, got = getattr(np, name)(a.astype(float), b.astype(float)), run([a, b], 0.0, 1.0)[0].astype(float)
        rounded = want.astype(F)
    ends = ~(np.isfinite(rounded) & np.isfinite(got))
    np.testing.assert_array_equal(got[ends], rounded[ends])
    want, got = want[~ends], got[~ends]
    _, exponent = np.frexp(want)
    assert (np.abs(got - want) / np.ldexp(1.0, np.maximum(exponent - 24, -149))).max() < 0.8


@pytest.mark.parametrize("name", TRUE)
def test_no_result_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    truth, within, most = TRUE[name]
    assert worst(function(getattr(functions, name)), truth, within) <= most < 1.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log"])
def test_none_of_all_results_is_further_than_an_ulp_from_the_truth(name: str) -> None:
    truth, within, most = TRUE[name]
    largest = worst(function(getattr(functions, name)), truth, within, long=True)
    assert most - 0.03 < largest <= most


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [name for name, (_, _, most) in TRUE.items() if most > 0.501 and name not in ("sin", "cos", "exp", "log")]
)
def test_none_of_all_results_of_the_others_is_either(name: str) -> None:
    truth, within, most = TRUE[name]
    assert worst(function(getattr(functions, name)), truth, within, long=True) <= most


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
def test_a_wrong_constant_is_noticed(
    name: str, module: ModuleType, constant: str, value: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = module.CONSTANTS.single._replace(**{constant: value})
    monkeypatch.setattr(module, "CONSTANTS", module.CONSTANTS._replace(single=wrong))
    truth, within, most = TRUE[name]
    assert worst(function(getattr(functions, name)), truth, within) > most


@pytest.mark.mutant
def test_logarithms_that_scale_no_subnormal_numbers_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bits.SINGLE, "least_normal", 0.0)
    truth, within, most = TRUE["log"]
    assert worst(function(functions.log), truth, within) > most


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
        f = function(getattr(functions, name))
        x = F(10.0) ** np.linspace(4.2, 6.3, 20_000).astype(F)
        error = np.abs(f(x).astype(float) - truth(x.astype(float)))
        assert (error <= 2.0**-24 + 2.0**-24 * np.abs(x)).all()
        assert np.isnan(f(np.array([2.2e6, np.inf, np.nan], dtype=F))).all()


@sw.system(order=1)
def curious(t: Any, y: Any, *, k: Any = 1.0) -> Any:
    return np.exp(-k * y) * np.cos(y) + np.log(1.0 + y * y) - 0.1 * np.round(3.0 * y) + np.sqrt(np.abs(y)) * np.sin(t) - y**3


@sw.system(order=1)
def angles(t: Any, y: Any, *, k: Any = 1.0) -> Any:
    small = np.arctan(y) / 2.0
    hyperbolic = np.tanh(y) + np.sinh(small) - np.cosh(small)
    return np.tan(small) + np.arcsin(small) + np.arccos(small) + np.arctan2(y, k) + hyperbolic - 3.0 * y


@sw.system(order=1)
def powers(t: Any, y: Any, *, k: Any = 1.0) -> Any:
    z = 0.1 * y
    logarithms = np.log1p(y * y) + np.log2(1.0 + y * y) - np.log10(2.0 + np.clip(y, 0.0, 1.0))
    roots = np.cbrt(y) + np.hypot(y, k) + np.mod(y, k)
    return np.power(2.0 + z, k) + np.exp2(z) + np.expm1(z) + logarithms + roots - 3.0 * y


@pytest.mark.parametrize("equations", [curious, angles, powers])
def test_functions_in_equations_of_ones_own(equations: Any) -> None:
    options: dict[str, Any] = {"y": np.linspace(-2.0, 2.0, 50), "dt": 0.05, "steps": 300, "every": 50, "dtype": "float32"}
    system = equations(k=np.linspace(0.5, 1.0, 50))
    run = sw.integrate(system, "rk4", **options)
    assert_same(run, sw.integrate(system, "rk4", **options, backend="numpy"))
    wide = sw.integrate(system, "rk4", **(options | {"dtype": "float64"}))
    assert 0.0 < np.abs(run.y - wide.y).max() < 0.1  # beside jumps of a remainder
    assert np.median(np.abs(run.y[1] - wide.y[1])) < 1e-6
