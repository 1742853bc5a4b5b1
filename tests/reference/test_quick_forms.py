"""Quick forms of functions in fused steps: where they are used, that both languages use them alike, and how exact they are."""

from __future__ import annotations

import math
import runpy
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference import functions as fn
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.tape.forms import forms, in_quick_forms
from stepwell.reference.tape.fused import fused
from stepwell.reference.tape.lines import listed, needed
from support import ROOT
from support.true_functions import arguments, errors
from support.ways import assert_equal_ways, kernels


def test_the_cores_table_is_that_of_the_specification() -> None:
    table = ROOT / "rust/core/src/tape/forms_table.rs"
    if not table.exists():
        pytest.skip("the sources of the core are not here")
    printed = runpy.run_path(str(ROOT / "docs/forms.py"))["table"]()
    assert table.read_text("utf-8") == printed, "python docs/forms.py > rust/core/src/tape/forms_table.rs"


def test_a_form_is_shorter() -> None:
    for form in forms():
        plain, quick = (sum(operation.name != "constant" for operation in each) for each in form)
        assert quick < 0.7 * plain


def functions(tape: Any) -> dict[str, tuple[list[Any], int]]:
    """Values, and how many functions among them have the quick form."""
    x, y, p, t = tape.state(0), tape.state(1), tape.param(0), tape.time()
    return {
        "one": ([fn.sin(x)], 1),
        "of a sum": ([2.0 * fn.sin(x + y) + y], 1),
        "two": ([fn.sin(x) + fn.sin(y)], 2),
        "the same twice": ([fn.sin(x) + y, fn.sin(x) * y], 1),
        "of a sine": ([fn.sin(p * fn.sin(x))], 2),
        "beside a parameter": ([fn.sin(x + p * t)], 1),
        "with the cosine": ([fn.sin(x), fn.cos(x)], 0),
        "with the cosine of another": ([fn.sin(x), fn.cos(y)], 1),
        "with the tangent": ([fn.sin(x), fn.tan(x)], 0),
        "with a value within": ([fn.sin(x), fn.abs(x)], 0),
        "of a parameter": ([x + fn.sin(p)], 0),
        "of the time": ([x + fn.sin(p * t)], 0),
        "a cosine": ([fn.cos(x)], 0),
        "with what is like a value within": ([fn.sin(x), fn.abs(y)], 1),
        "an exponential": ([fn.exp(x)], 1),
        "an exponential in sums": ([1.0 - fn.exp(x * p), 1.0 / (1.0 + fn.exp(y))], 2),
        "an exponential of a sine": ([fn.exp(p * fn.sin(x))], 2),
        "an exponential of a parameter": ([x * fn.exp(p)], 0),
        "an exponential with a value within": ([fn.exp(x), fn.where(x < -746.0, y, p)], 0),
        "what is like an exponential": ([fn.expm1(x), fn.exp2(y), fn.sinh(x), fn.power(y, p)], 0),
    }


def quick(lines: list[Any]) -> int:
    """How many quick forms there are among operations that have no other fused ones."""
    names = Counter(operation.name for operation in lines)
    sines = names["multiply subtract"] // 2
    return sines + (names["subtract multiply"] - sines) // 2


def test_where_they_are_used_and_that_both_languages_agree() -> None:
    for what in functions(_core.Tape()):
        tape = _core.Tape()
        values, count = functions(tape)[what]
        plain, roots = listed(tape, values)
        lines, _ = in_quick_forms(plain, roots)
        assert quick(lines) == count, what
        assert listed(*tape.fused(values)) == needed(*fused(plain, roots)), what


@pytest.mark.parametrize("i", range(2), ids=["sin", "exp"])
def test_constants_that_came_first_change_nothing(i: int) -> None:
    """Operands that may change places are in the order of their lines, which is another one here."""
    tape = _core.Tape()
    for operation in reversed(forms()[i].plain):
        if operation.name == "constant":
            tape.constant(operation.extra)
    value = (fn.sin, fn.exp)[i](tape.state(0))
    lines, _ = in_quick_forms(*listed(tape, [value]))
    assert quick(lines) == 1
    assert listed(*tape.fused([value])) == needed(*fused(*listed(tape, [value])))


def test_float32_has_none() -> None:
    tape = _core.Tape(single=True)
    plain, roots = listed(tape, [fn.sin(tape.state(0)), fn.exp(tape.state(1))])
    assert in_quick_forms(plain, roots) == (plain, roots)


def in_quick_form(function: Callable[[Any], Any], x: np.ndarray) -> np.ndarray:
    tape = _core.Tape()
    (values,) = Evaluation(tape, [function(tape.state(0))], {}, fuse=True)([x])
    return np.asarray(values)


quick_sine, quick_exponential = partial(in_quick_form, fn.sin), partial(in_quick_form, fn.exp)


def test_errors_of_the_exponential_are_below_a_unit_in_the_last_place() -> None:
    rng = np.random.default_rng(4)
    (hard,) = arguments("exp", rng, 1200)
    largest = rng.uniform(-0.3466, 0.3466, 800), rng.uniform(0.3, 0.5, 800), math.log(2) * (rng.integers(-900, 900, 800) + 0.5)
    x = np.concatenate([hard, *largest])
    assert errors(quick_exponential(x), "exp", (x,)).max() < 0.93


def test_the_ends_of_the_exponential() -> None:
    zeros, infinities = [-745.14, -746.0, -747.0, -1e300, -math.inf], [709.79, 710.0, 711.0, 1e300, math.inf]
    with np.errstate(all="ignore"):
        assert quick_exponential(np.array([0.0, -0.0, 5e-324, -5e-324, -745.13])).tolist() == [1.0, 1.0, 1.0, 1.0, 5e-324]
        assert quick_exponential(np.array(zeros)).tolist() == [0.0] * 5
        assert quick_exponential(np.array(infinities)).tolist() == [math.inf] * 5
        assert quick_exponential(np.array([709.78])) == pytest.approx(math.exp(709.78), rel=1e-15)
        assert np.isnan(quick_exponential(np.array([math.nan])))


def test_errors_of_the_sine_are_below_those_of_the_longer_form() -> None:
    rng = np.random.default_rng(4)
    (hard,) = arguments("sin", rng, 1200)
    largest = [rng.uniform(math.pi / 2 - 0.6, math.pi / 2, 800), rng.uniform(-2000.0, 2000.0, 800)]
    x = np.concatenate([hard, *largest])
    assert errors(quick_sine(x), "sin", (x,)).max() < 0.77


def test_the_ends_of_the_sine() -> None:
    most = 2.0**50
    x = np.array([0.0, 5e-324, 1e-310, most, math.nextafter(most, math.inf), 1e300, math.inf, math.nan])
    with np.errstate(all="ignore"):
        up, down, plain = quick_sine(x), quick_sine(-x), fn.sin(x)
    assert np.array_equal(np.isnan(up), np.isnan(plain))
    assert np.array_equal(up, -down, equal_nan=True)
    assert np.array_equal(np.signbit(up[:3]), [False] * 3)
    assert np.array_equal(np.signbit(down[:3]), [True] * 3)
    assert up[:3].tolist() == x[:3].tolist()


@sw.system
def swinging(t: Any, v: Any, y: Any, *, omega: float = 1.0) -> Any:
    return -(omega * omega) * np.sin(y)


def test_a_bad_member_touches_no_other() -> None:
    y = np.linspace(-3.0, 3.0, 37)
    ask: dict[str, Any] = {"v": np.zeros(37), "dt": 0.05, "steps": 40, "fused": True}
    well = assert_equal_ways(swinging(), "rk4", ways=("by the reference", "at each level"), y=y, **ask)
    far = y.copy()
    far[5], far[20] = 2.0**50, 2.0**51  # a sine on this side of its limit, and none on the other
    rest = np.delete(np.arange(37), [5, 20])
    for level in sw.isa_levels():
        with kernels(level), pytest.warns(sw.DivergenceWarning, match="1 of 37"):
            ill = sw.integrate(swinging(), "rk4", y=far, **ask)
        assert np.array_equal(ill.y[-1][rest], well.y[-1][rest]), level
        assert np.isfinite(ill.y[-1][5])


@sw.system(order=1)
def opening(t: Any, y: Any, *, width: float = 0.01) -> Any:
    return 1.0 / (1.0 + np.exp(-y / width)) - 0.25 * np.exp(-y * y) - y * (1.0 - np.exp(-y * 0.125))


@pytest.mark.parametrize("fused", [False, True])
def test_exponentials_of_all_sizes_have_the_same_bits(fused: bool) -> None:
    y = np.concatenate([np.linspace(-9.0, 9.0, 301), [0.0, -0.0, 5e-324]])
    ways = ("by the reference", "at each level")
    run = assert_equal_ways(opening(), "rk4", ways=ways, y=y, dt=0.01, steps=20, fused=fused)
    assert np.isfinite(run.y).all()


def test_a_run_is_as_accurate_as_a_plain_one() -> None:
    y = np.linspace(-2.5, 2.5, 37)
    plain, quick = (sw.integrate(swinging(), "rk4", v=0.0, y=y, dt=0.01, steps=500, fused=each) for each in (False, True))
    assert np.abs(plain.y - quick.y).max() < 1e-13
