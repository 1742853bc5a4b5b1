"""The second exact arithmetic: what is fused, that both languages fuse the same, and that a·b + c is rounded once."""

import contextlib
import itertools
import math
import runpy
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import given
from hypothesis import strategies as st
from stepwell import _core
from stepwell.reference import functions as fn
from stepwell.reference.bits import DOUBLE, SINGLE
from stepwell.reference.fma import exact_fma, fma, odd_sum
from stepwell.reference.systems import nbody
from stepwell.reference.systems.nbody import inverse_cube
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.tape.forms import forms, in_quick_forms
from stepwell.reference.tape.fused import fused
from stepwell.reference.tape.increments import increments_last
from stepwell.reference.tape.lines import Operation, listed, needed
from stepwell.reference.tape.quotients import LARGEST, inverse
from stepwell.reference.traced import Tracer
from support import ROOT, families
from support.cases import SYSTEMS, assert_same, drawn, fits, number
from support.families import family
from support.tracing import CONTROLS, METHODS, made
from support.true_functions import arguments, errors
from support.ways import assert_equal_ways, kernels

#: Of each precision its type, its digits, the exponents of its least normal number and of the first that is too large.
PRECISIONS: dict[int, tuple[Any, int, int, int]] = {64: (np.float64, 53, -1022, 1024), 32: (np.float32, 24, -126, 128)}


def rounded_once(a: float, b: float, c: float, width: int) -> Any:
    """a·b + c by exact rational arithmetic, or as IEEE 754 has it where that has no answer."""
    kind, digits, least, most = PRECISIONS[width]
    if not (math.isfinite(a) and math.isfinite(b)):
        return kind(a * b + c)
    if not math.isfinite(c):
        return kind(c)
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    if not exact:
        return kind(a * b + c)
    size = abs(exact)
    exponent = max(least, math.floor(math.log2(size.numerator) - math.log2(size.denominator)))
    exponent += (Fraction(2) ** (exponent + 1) <= size) - (Fraction(2) ** exponent > size and exponent > least)
    unit = Fraction(2) ** (exponent - digits + 1)
    whole = round(size / unit) * unit  # Python rounds halves to even
    return kind(math.copysign(float(whole) if whole < 2**most else math.inf, 1 if exact > 0 else -1))


def same(a: Any, b: Any) -> bool:
    return bool((np.isnan(a) and np.isnan(b)) or (a == b and np.signbit(a) == np.signbit(b)))


@pytest.mark.parametrize("width", PRECISIONS)
@given(draw=st.data())
def test_a_product_and_a_sum_are_rounded_once(width: int, draw: st.DataObject) -> None:
    kind = PRECISIONS[width][0]
    a, b, c = (draw.draw(st.floats(width=width)) for _ in range(3))
    with np.errstate(all="ignore"):
        value = fma(kind(a), kind(b), kind(c))
        assert value.dtype == kind
        assert same(value, rounded_once(a, b, c, width)), (a, b, c)
        if width == 64 and hasattr(math, "fma") and not any(map(math.isnan, (a, b, c))):
            with contextlib.suppress(OverflowError, ValueError):  # where IEEE 754 has an infinity or a NaN
                assert same(value, math.fma(a, b, c))


def test_where_sums_cancel_and_halves_are_met() -> None:
    """c is minus the product, or a few last digits beside it; and products whose rest is half a digit of the sum."""
    rng = np.random.default_rng(3)
    a, b = (rng.normal(size=20_000) * 2.0 ** rng.integers(-40, 40, 20_000) for _ in range(2))
    c = -(a * b) * (1.0 + rng.integers(-3, 4, a.size) * 2.0**-52)
    c[::3] = rng.normal(size=c[::3].size) * 2.0 ** rng.integers(-80, 80, c[::3].size)
    a[::5] = 1.0 + 2.0**-30 * rng.integers(0, 8, a[::5].size)
    b[::5], c[::5] = 1.0 + 2.0**-23, 2.0**53 * rng.integers(1, 4, c[::5].size)
    sums = fma(a, b, c)
    assert sums.tolist() == [exact_fma(*each) for each in zip(a.tolist(), b.tolist(), c.tolist(), strict=True)]
    assert (sums != a * b + c).mean() > 0.2  # it is another number often enough for this to be a test


def test_where_two_roundings_would_differ() -> None:
    """Sums near the middle between two numbers of float32: rounded to float64 first, some would go the wrong way."""
    rng, kind = np.random.default_rng(2), np.float32
    a, b = (kind(1.0) + kind(2.0**-23) * rng.integers(0, 2**12, 4000).astype(kind) for _ in range(2))
    c = (kind(2.0) ** rng.integers(24, 34, 4000)).astype(kind) * rng.integers(1, 4, 4000).astype(kind)
    c[::2] = -np.nextafter((a.astype(float) * b)[::2].astype(kind), kind(9.0)) * kind(2.0**-3)
    once = np.array([rounded_once(*map(float, each), 32) for each in zip(a, b, c, strict=True)])
    np.testing.assert_array_equal(fma(a, b, c), once)
    tiny = kind(2.0**-60) * rng.choice([-1, 1], 4000).astype(kind)
    halves = (kind(1.0) + kind(2.0**-23) * rng.integers(0, 99, 4000).astype(kind)).astype(kind)
    # The product is half a last place of the sum, and the tiny rest decides.
    small = np.array([rounded_once(float(h), 1.0 + 2.0**-23, float(t), 32) for h, t in zip(halves, tiny, strict=True)])
    np.testing.assert_array_equal(fma(halves, kind(1.0 + 2.0**-23), tiny), small)
    twice = (halves.astype(float) * float(kind(1.0 + 2.0**-23)) + tiny).astype(kind)
    assert odd_sum(np.array([1.0]), np.array([2.0**-60]))[0] > 1.0
    assert (twice != small).any() or (np.asarray(a * b + c) != once).any()


#: By default a third of the systems, and one method of each.
SOME = [(name, 1) for name in SYSTEMS if number(name, "fuse") % 3 == 0]


@pytest.mark.parametrize(("name", "some"), family([*SOME, *((name, None) for name in SYSTEMS)], lambda _, some: some is not None))
def test_both_fuse_the_same(name: str, some: int | None) -> None:
    system, _, _ = made(name)
    if int(np.prod(system.v_shape)) > 30:
        return  # its step is too long for one tape
    counts = []
    for method in drawn([each for each in METHODS if fits(system, each)], some, name):
        tape = _core.Tape()
        symbols = Tracer(system, tape).step(method)
        core = listed(*tape.fused(symbols))
        plain, roots = listed(tape, symbols)
        assert core == needed(*fused(plain, roots)), method.name
        counts.append(sum(operation.name.count("multiply ") + (operation.name == "subtract multiply") for operation in core[0]))
    assert max(counts) > 0


RATIONAL: dict[str, Any] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negate": lambda a: -a,
}


def exactly(tape: list[Operation], roots: list[int], numbers: dict[tuple[str, int], Fraction]) -> list[Fraction]:
    """The roots in rational arithmetic, without any rounding."""
    values: list[Fraction] = []
    for name, of, which in tape:
        if name == "constant":
            values.append(Fraction(float(np.uint64(which).view(np.float64))))
        elif of:
            values.append(RATIONAL[name](*(values[line] for line in of)))
        else:
            values.append(numbers.setdefault((name, which), Fraction(len(numbers) + 3, 7)))
    return [values[root] for root in roots]


#: Systems whose rates are sums, products and quotients.
ALGEBRAIC = ("damped", "chain of five")


@pytest.mark.parametrize("name", ALGEBRAIC)
def test_multiplying_increments_last_changes_roundings_alone(name: str) -> None:
    """Without any rounding both tapes have the same values, but for the new numbers c and c₂/c₁, each of which is rounded.

    There are at most three for an evaluation, each wrong by 2⁻⁵³ of a term, and no term of a step exceeds 2⁸ times its result.
    """
    system, _, _ = made(name)
    shorter = 0
    for method in METHODS:
        if not fits(system, method) or method.is_implicit:  # whose exchanges of rows are choices
            continue
        tape = _core.Tape()
        plain, roots = listed(tape, Tracer(system, tape).step(method))
        numbers: dict[tuple[str, int], Fraction] = {}
        want = exactly(plain, roots, numbers)
        last, places = increments_last(plain, roots)
        got = exactly(last, places, numbers)
        bound = Fraction(3 * method.evaluations * 2**8, 2**53)
        assert all(abs(a - b) <= bound * max(1, abs(b)) for a, b in zip(got, want, strict=True)), method.name
        products = [sum(operation.name == "multiply" for operation in each) for each in (plain, last)]
        shorter += products[1] < products[0]
    assert shorter > 0


@pytest.mark.parametrize("by_core", [True, False], ids=["core", "reference"])
def test_which_of_two_negated_products_was_met_first_decides_nothing(by_core: bool) -> None:
    """−a·b − (c + d)·d: a tape makes (−a·b) − … of it, or (−(c + d)·d) − …, by the order in which it comes upon the two."""
    plain, shortened = [], []
    for deep_first in (False, True):
        tape = _core.Tape()
        a, b, c, d = (tape.state(i) for i in range(4))
        deep = -((c + d) * d) if deep_first else None
        flat = -(a * b)
        total = flat + (-((c + d) * d) if deep is None else deep)
        lines, roots = listed(tape, [total])
        plain.append(graph(lines, roots))
        shortened.append(graph(*(listed(*tape.fused([total])) if by_core else fused(lines, roots))))
    assert plain[0] != plain[1]
    assert shortened[0] == shortened[1]


def graph(lines: Any, roots: Any) -> list[Any]:
    """What values are made of, whatever the order of lines and of operands that commute."""
    keys: list[Any] = []
    for name, of, what in lines:
        operands = [keys[line] for line in of]
        free = 2 if name in ("add", "multiply", "multiply add") else 0
        keys.append((name, *sorted(operands[:free], key=repr), *operands[free:], what))
    return [keys[root] for root in roots]


def test_the_order_of_writing_decides_nothing() -> None:
    """x·y + z·x, its products written down in either order, and its sum either way round."""
    factors = set()
    for turned, swapped in itertools.product((False, True), repeat=2):
        tape = _core.Tape()
        leaves = [tape.state(i) for i in ((2, 1, 0) if turned else (0, 1, 2))]
        x, y, z = sorted(leaves, key=repr) if not turned else leaves[::-1]
        products = [z * x, x * y] if turned else [x * y, z * x]
        p, q = products[::-1] if turned else products
        lines, _ = listed(*tape.fused([q + p if swapped else p + q]))
        [line] = [operation for operation in lines if operation.name == "multiply add"]
        factors.add(frozenset(lines[each].extra for each in line.of[:2]))
    assert len(factors) == 1


def of_both(system: Any, method: Any, **options: Any) -> list[sw.Run]:
    """The fused run by core and reference, of the same bits, and the plain one, of others."""
    ways = ((True, "rust"), (True, "numpy"), (False, "rust"))
    runs = [sw.integrate(system, method, fused=fused, backend=backend, **options) for fused, backend in ways]
    for name in ("v", "y"):
        assert getattr(runs[0], name).tobytes() == getattr(runs[1], name).tobytes(), name
    assert np.size(runs[0].y[-1]) == 1 or any(not np.array_equal(getattr(runs[0], x), getattr(runs[2], x)) for x in "vy")
    return runs


@pytest.mark.parametrize("control", CONTROLS)
def test_what_is_recorded_under_control(control: str) -> None:
    """What is recorded is a property of the state and is computed as it is without; what a control did is fused."""
    system, v, y = made("three bodies")
    run, other, _ = of_both(system, "rk4", v=v, y=y, dt=1e-3, steps=10, control=CONTROLS[control], record=["energy"], every=5)
    assert np.array_equal(run.work, other.work)
    assert np.array_equal(run.recorded["energy"], run.quantity("energy"))


def test_a_number_that_all_have_in_common_is_one_of_each() -> None:
    """Nothing that is hoisted is fused."""
    common, own = (
        sw.integrate(sw.Oscillator(omega, 0.1), "rk4", v=0.0, y=np.ones(3), dt=0.1, steps=500, fused=True)
        for omega in (2.0, np.full(3, 2.0))
    )
    assert np.array_equal(common.y, own.y)


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_what_cannot_be_fused_says_so(backend: str) -> None:
    with pytest.raises(sw.errors.ArgumentError, match=r"fused: a step of about \d+ operations is too long"):
        sw.integrate(sw.Chain(9000), "rk4", v=np.zeros(9000), y=np.ones(9000), dt=0.1, steps=2, fused=True, backend=backend)
    with pytest.raises(sw.errors.DTypeError, match="fused: expected True or False"):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=2, fused="yes", backend=backend)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("system", "shape"),
    [(sw.Chain(150), (150,)), (sw.Chain(80), (80, 9)), (sw.NBody(np.ones(12), softening=0.1), (12, 2, 2))],
    ids=repr,
)
def test_long_steps(system: sw.System, shape: tuple[int, ...]) -> None:
    """Of more operations than a tape has that is not fused: one tape, as long as it is."""
    v, y = np.random.default_rng(3).normal(size=(2, *shape))
    run, _, plain = of_both(system, "rk4", v=0.1 * v, y=y, dt=0.1, steps=2)
    assert np.allclose(run.y, plain.y, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("method", "states", "members"), [("rk4", 1, ()), ("leapfrog", 3, (33,)), ("rk4", 3, (2,)), ("rk4", 12, ())]
)
def test_the_matrix_form(method: str, states: int, members: tuple[int, ...]) -> None:
    """Each product after the first is added by one operation: on a tape, by the kernel of large matrices, by the reference."""
    rng = np.random.default_rng(states)
    a = np.zeros((2 * states, 2 * states))
    a[:states, states:], a[states:, :states] = -np.eye(states) - 0.1 * rng.normal(size=(states, states)), np.eye(states)
    b = np.concatenate([np.ones((states, 1)), np.zeros((states, 1))])
    system = sw.LinearSystem(a, b, x=[sw.Sinusoid(0.3, 2.0)], velocities=states)
    v, y = rng.normal(size=(2, states, *members))
    ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.05, "steps": 8, "every": 4, "form": "matrix"}
    run, _, plain = of_both(system, method, **ask)
    assert np.allclose(run.y, plain.y, rtol=1e-11, atol=1e-11)


def names(values: list[Any], tape: Any) -> list[str]:
    """The operations of a fused tape, in which leaves do not count; both languages write the same."""
    core = listed(*tape.fused(values))
    assert core == needed(*fused(*listed(tape, values)))
    return sorted(operation.name for operation in core[0] if operation.of)


def test_any_signs_take_two_fused_operations() -> None:
    """±a ± (±p·q ± r·s); of small whole numbers, which round nowhere, it is the value of the plain tape."""
    for case in itertools.product((False, True), repeat=6):
        minus_a, minus_sum, minus_second, negated, a_is_first, a_is_of_state = case
        tape = _core.Tape()
        x, y, p, q = tape.state(0), tape.state(1), tape.param(0), tape.param(1)
        a: Any = tape.state(2) if a_is_of_state else tape.param(2)
        a = -a if minus_a else a
        both = p * x - q * y if minus_second else p * x + q * y
        both = -both if negated else both
        first, second = (a, both) if a_is_first else (both, a)
        whole = first - second if minus_sum else first + second
        of_state = [name for name in names([whole], tape) if name != "negate"]
        assert len(of_state) == 2, case
        assert all("multiply" in name for name in of_state), (case, of_state)
        numbers = [3.0, 5.0, 7.0] if a_is_of_state else [3.0, 5.0]
        values = [
            value(*tape_of, numbers, [11.0, 13.0, 7.0]) for tape_of in (listed(*tape.fused([whole])), listed(tape, [whole]))
        ]
        assert values[0] == values[1], case


def value(lines: list[Any], roots: list[int], state: list[float], parameters: list[float]) -> float:
    """A line's value, of numbers of which all sums and products are exact."""
    values: list[float] = []
    rules: dict[str, Any] = {
        "add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b, "negate": lambda a: -a,
        "multiply add": lambda a, b, c: a * b + c, "multiply subtract": lambda a, b, c: a * b - c,
        "subtract multiply": lambda a, b, c: c - a * b,
    }  # fmt: skip
    for name, of, extra in lines:
        leaf = {"state": state, "parameter": parameters}.get(name)
        values.append(rules[name](*(values[each] for each in of)) if leaf is None else leaf[extra])
    return values[roots[0]]


def test_what_is_left_as_it_is() -> None:
    """A third value that is known last, products that are read again, and products of what is known before the step."""
    tape = _core.Tape()
    x, y, p, q = tape.state(0), tape.state(1), tape.param(0), tape.param(1)
    late = (x * y + p).sqrt().sqrt().sqrt()
    assert names([late + (p * x + q * y)], tape).count("add") == 1
    once = p * x
    assert "multiply" in names([late * q - (once + q * y), once], tape)
    assert names([x + (p * q + q * q)], tape).count("add") >= 1


def test_a_chain_is_shorter() -> None:
    """Two products, the later one with one operation behind it."""
    listing = str(sw.explain(sw.Oscillator(1.1, damping=0.1, a=sw.Sinusoid(0.7, 0.9)), "standard_heun", fused=True))
    in_each = listing.split("in each step")[1].split("operations of a step")[0]
    assert in_each.count("fma(") == 7
    assert in_each.count("·") == 0


DIVISORS = st.floats(2.0**-500, 2.0**500).flatmap(lambda c: st.sampled_from([c, -c]))
EDGES = [0.0, -0.0, math.inf, -math.inf, math.nan, 1.7e308, -1.7e308, 1.0, 3.0]


def parts_of(c: float, **options: Any) -> tuple[float, float]:
    parts = inverse(c, **options)
    assert parts is not None
    return parts


@given(DIVISORS)
def test_both_parts_have_one_sign_and_are_as_near_as_can_be(c: float) -> None:
    upper, lower = parts_of(c)
    exact = 1 / Fraction(c)
    assert abs(Fraction(upper)) <= abs(exact) < abs(Fraction(math.nextafter(upper, math.copysign(math.inf, c))))
    assert lower == float(exact - Fraction(upper))
    assert lower == 0.0 or math.copysign(1.0, lower) == math.copysign(1.0, c)


@given(st.floats(2.0**-60, 2.0**60, width=32))
def test_both_parts_of_float32(c: float) -> None:
    upper, lower = parts_of(c, single=True)
    assert (upper, lower) == (np.float32(upper), np.float32(lower))
    rest = 1 / Fraction(c) - Fraction(upper)
    assert 0 <= rest < Fraction(np.nextafter(np.float32(upper), np.float32(np.inf)).item()) - Fraction(upper)
    assert abs(rest - Fraction(lower)) <= rest / 2**24


def quotient(x: Any, c: float) -> Any:
    upper, lower = parts_of(c)
    return fma(x, np.full_like(x, upper), x * lower)


def test_the_bits_are_those_of_the_quotient() -> None:
    rng = np.random.default_rng(11)
    for c in (3.0, 10.0, -18.0, 80.0, 0.1, 1.0 / 3.0, math.pi, -49.0, 1e150, 1e-150, 1.0 + 2.0**-52, 2.0 - 2.0**-52):
        x = rng.normal(size=20_000) * 2.0 ** rng.integers(-400, 400, 20_000)
        # Quotients next to the middle between two numbers: multiples of c and of a half, and their neighbours.
        near = (rng.integers(2**53, 2**54, 20_000) / 2.0**54) * c
        x = np.concatenate([x, near, np.nextafter(near, np.inf), np.nextafter(near, -np.inf), EDGES])
        with np.errstate(all="ignore"):
            exact, both = x / c, quotient(x, c)
        np.testing.assert_array_equal(both, exact, err_msg=str(c))
        np.testing.assert_array_equal(np.signbit(both[:-5]), np.signbit(exact[:-5]), err_msg=str(c))


def test_small_quotients_are_neighbours_at_most() -> None:
    x = np.random.default_rng(2).uniform(-1.0, 1.0, 20_000) * 2.0 ** -np.linspace(960.0, 1074.0, 20_000).round()
    for c in (3.0, 1e10, -0.7):
        with np.errstate(all="ignore"):
            exact, both = x / c, quotient(x, c)
        assert (np.abs(both - exact) <= np.spacing(np.abs(exact))).all()


def quotients(single: bool) -> tuple[Any, list[Any]]:
    """A tape with divisions of all sorts, and their quotients."""
    tape = _core.Tape(single=single) if single else _core.Tape()
    x, y, p, h = tape.state(0), tape.state(1), tape.param(0), tape.step()
    most = LARGEST.single if single else LARGEST.double
    ends = [math.ldexp(*each) for each in ((1.0, most), (1.5, most), (1.0, -most), (1.0, -most - 1))]
    by = [3.0, -10.0, 4.0, -0.5, 0.1, *ends]
    values = [x / tape.number(c) for c in by]
    values += [-x / tape.number(10.0), (x + y) / tape.number(7.0) + y, y - x / tape.number(3.0) * y, h * x / tape.number(6.0)]
    # What stays: quotients of what is known beforehand, by parameters, and by what changes.
    values += [p / tape.number(3.0) * x, x / p, tape.number(3.0) / x, x / y, x / tape.number(0.0) + y]
    return tape, values


@pytest.mark.parametrize("single", [False, True])
def test_both_languages_write_the_same(single: bool) -> None:
    tape, values = quotients(single)
    core = listed(*tape.fused(values))
    assert core == needed(*fused(*listed(tape, values), single=single))
    assert sum(operation.name == "divide" for operation in core[0]) == 7  # beyond the bounds 2, and the last five


def constants(lines: list[Operation], single: bool) -> list[float]:
    precision = SINGLE if single else DOUBLE
    return [precision.constant(operation.extra) for operation in lines if operation.name == "constant"]


def test_a_sign_is_the_numbers_and_a_power_of_two_one_product() -> None:
    tape = _core.Tape()
    x = tape.state(0)
    lines, _ = listed(*tape.fused([-x / tape.number(10.0)]))
    assert [operation.name for operation in lines].count("negate") == 0
    assert all(each < 0.0 for each in constants(lines, False))
    lines, _ = listed(*tape.fused([x / tape.number(8.0)]))
    assert sorted(operation.name for operation in lines) == ["constant", "multiply", "state"]
    lines, _ = listed(*tape.fused([x + x / tape.number(8.0)]))
    assert sorted(operation.name for operation in lines) == ["constant", "multiply add", "state"]


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


@sw.system(order=1)
def leaking(t: Any, y: Any, *, tau: float = 7.0) -> Any:
    return -(y + 0.3) / 10.0 + np.exp(-y / 18.0) / tau - y / 3.0


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_bad_member_touches_no_other_and_the_rest_is_as_accurate_as_a_plain_run(dtype: Any) -> None:
    """A sine on this side of its limit, and one on the other; rates that overflow."""
    swings: Any = swinging(), {"v": np.zeros(37)}, (2.0**50, 2.0**51), "1 of 37"
    for system, start, beyond, words in (swings, (leaking(), {}, (-1e30, 1e30), "of 37"))[dtype == "float32" :]:
        y, ask = np.linspace(-3.0, 3.0, 37), start | {"dt": 0.05, "steps": 40, "fused": True, "dtype": dtype}
        well = assert_equal_ways(system, "rk4", ways=("by the reference", "at each level"), y=y, **ask)
        far = y.copy()
        far[[5, 20]] = beyond
        rest = np.delete(np.arange(37), [5, 20])
        for level in sw.isa_levels():
            with kernels(level), pytest.warns(sw.DivergenceWarning, match=words):
                ill = sw.integrate(system, "rk4", y=far, **ask)
            assert np.array_equal(ill.y[-1][rest], well.y[-1][rest]), level
        plain = sw.integrate(system, "rk4", y=y, **ask | {"fused": False})
        assert np.abs(plain.y - well.y).max() < (1e-5 if dtype == "float32" else 1e-13)


#: The largest error of Newton's 1/√x³, in units of the last digit (``bodies.rs`` derives it).
BOUND_OF_CUBES = 2.2


def worst_cube(x: Any) -> float:
    """The largest error of 1/√x³ of these some_numbers, in units of the last digit of the true value."""

    def error(x: float, f: float) -> float:
        # f²·x³ is (1 + δ)² where f is off by δ, which is exact but for δ².
        off = float(Fraction(f) ** 2 * Fraction(x) ** 3 - 1) / 2
        return abs(off) * f / float(np.spacing(f))

    return max(map(error, x.tolist(), inverse_cube(x).tolist()))


def some_numbers(count: int = 4000) -> Any:
    """Two binades densely, where the start is a straight line each, and all exponents that have a cube."""
    rng = np.random.default_rng(5)
    ends = [1.0, 2.0, 4.0, np.nextafter(1.0, 2), np.nextafter(2.0, 1), np.nextafter(2.0, 3), np.nextafter(4.0, 3)]
    wide = rng.uniform(1, 2, count) * 2.0 ** rng.integers(-650, 650, count)
    return np.concatenate([ends, rng.uniform(1, 4, count), np.linspace(1, 4, count, endpoint=False), wide])


def test_newtons_force_is_right_within_the_bound() -> None:
    assert worst_cube(some_numbers()) < BOUND_OF_CUBES


def test_any_other_constant_is_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, place in (("START", 0), ("FIRST", 0), ("FIRST", 1), ("SECOND", 0), ("SECOND", 1), ("SECOND", 2)):
        constant = getattr(nbody, name)
        if name == "START":
            other: Any = constant._replace(double=constant.double + (1 << 46))
        else:
            other = tuple(each * (1.05 if i == place else 1.0) for i, each in enumerate(constant))
        with monkeypatch.context() as patched:
            patched.setattr(nbody, name, other)
            assert worst_cube(some_numbers(1000)) > BOUND_OF_CUBES, (name, place)


def test_beyond_the_range_it_is_no_number_as_the_quotient_is_infinite() -> None:
    with np.errstate(all="ignore"):
        tiny = np.array([0.0, 5e-324, 1e-310, 2.3e-308, 1e-250, 1e-207, 1e-206])
        assert not np.isfinite(inverse_cube(tiny)).any()
        assert not np.isfinite(1.0 / (tiny * np.sqrt(tiny))).any()
        assert np.isfinite(inverse_cube(np.array([4e-206, 1e-100, 1e100, 1.7e308]))).all()
        assert np.isnan(inverse_cube(np.array([np.inf, np.nan]))).all()


def crowd(n: int, dim: int, batch: tuple[int, ...] = (), massless: int = 0, **of: Any) -> dict[str, Any]:
    """Some bodies, the last of which have no mass."""
    rng = np.random.default_rng([n, dim, *batch])
    masses = rng.uniform(0.1, 1, n) / n
    if massless:
        masses[-massless:] = 0.0
    system = sw.NBody(masses, softening=0.05, dim=dim, **({"force": "newton"} | of))
    return {"system": system, "v": 0.1 * rng.normal(size=(n, dim, *batch)), "y": rng.normal(size=(n, dim, *batch))}


@pytest.mark.parametrize(("n", "dim"), [(2, 2), (3, 3), (9, 3), (10, 2), (17, 3), (32, 2), (63, 2), (64, 3), (65, 2), (130, 3)])
def test_the_core_equals_the_reference(n: int, dim: int) -> None:
    """Few bodies are a tape, more a kernel written by hand; with forces and bodies without mass in turns."""
    forces = ("newton", "logarithmic", "printed")
    pairs = [(force, massless) for force in forces for massless in (0, 3)]
    for force, massless in pairs if families.LONG else (pairs[n % 6], pairs[(n + 2) % 6]):
        if massless >= n:
            continue  # nothing moves
        ask = crowd(n, dim, massless=massless, force=force) | {"method": "leapfrog", "dt": 0.1, "steps": 6, "fused": True}
        core, plain = sw.integrate(**ask), sw.integrate(**ask | {"fused": False})
        assert_same(core, sw.integrate(**ask, backend="numpy"))
        assert core.fused
        assert plain.v.tobytes() != core.v.tobytes(), (force, massless)
        assert np.allclose(plain.v, core.v, rtol=1e-11, atol=1e-13), (force, massless)


def test_members_and_worlds() -> None:
    """A tape, tapes of the rates side by side, and a kernel for one."""
    for n in (3, 12, 40, 70):
        ask = crowd(n, 3, (5,)) | {"method": "rk4", "dt": 0.01, "steps": 12, "fused": True}
        assert_equal_ways(**ask, ways=("alone", "in a world"))


def test_threads_change_no_bit() -> None:
    ask = crowd(1100, 3) | {"method": "leapfrog", "dt": 0.001, "steps": 2, "fused": True}
    assert_same(sw.integrate(**ask, threads=1), sw.integrate(**ask, threads=2))


@pytest.mark.parametrize("n", [4, 30])
def test_with_all_that_goes_around_bodies(n: int) -> None:
    ask = crowd(n, 2) | {"method": "rk4", "dt": 0.01, "steps": 6, "every": 3, "fused": True}
    record = {"record": ["energy", "closest", "momentum"]}
    for more in (
        record,
        {"control": sw.EnergyControl(0.1)} | record,
        {"force": 0.01 * np.ones((n, 2))} | record,
        {"method": "merson", "dt": None, "steps": None, "every": None, "tolerance": 1e-6, "at": [0.02, 0.05]},
    ):
        core, reference = (sw.integrate(**ask | more | {"backend": backend}) for backend in ("rust", "numpy"))
        assert_same(core, reference)
        assert core.recorded.keys() == reference.recorded.keys()
        for name, each in core.recorded.items():
            assert each.tobytes() == reference.recorded[name].tobytes(), (more, name)


@pytest.mark.parametrize("n", [4, 30])
def test_recorded_energies_are_not_fused(n: int) -> None:
    ask = crowd(n, 3) | {"method": "leapfrog", "dt": 0.01, "steps": 4, "every": 1, "fused": True}
    with_energies = sw.integrate(**ask, record=["energy"])
    without = sw.integrate(**ask)
    assert_same(with_energies, without)
    v, y = (np.moveaxis(each, 0, -1) for each in (without.v, without.y))
    assert np.allclose(with_energies.recorded["energy"], ask["system"].energy(v, y), rtol=1e-14)
    own = [ask["system"].recordable("energy", v[..., i], y[..., i], 0.01) for i in range(5)]
    assert with_energies.recorded["energy"].tolist() == [float(each) for each in own]


@pytest.mark.parametrize("n", [2, 20])
@pytest.mark.parametrize("where", ["one place", "far"])
def test_a_coincidence_is_noticed_in_the_same_step(n: int, where: str) -> None:
    ask = crowd(n, 2)
    system = sw.NBody(ask["system"].masses, force="newton")
    y = ask["y"].copy()
    y[1] = y[0] if where == "one place" else y[0] + 1e-110  # the cube of the distance is below all some_numbers
    ask |= {"system": system, "y": y, "method": "leapfrog", "dt": 0.01, "steps": 3}
    steps = []
    for is_fused in (False, True):
        with pytest.warns(sw.DivergenceWarning):
            steps.append(int(sw.integrate(**ask, fused=is_fused).first_bad_step))
    assert steps[0] == steps[1]


def test_in_float32() -> None:
    for n in (2, 5):
        ask = crowd(n, 3) | {"method": "leapfrog", "dt": 0.01, "steps": 20, "fused": True, "dtype": "float32"}
        core, exact = sw.integrate(**ask), sw.integrate(**ask | {"dtype": "float64"})
        assert_same(core, sw.integrate(**ask, backend="numpy"))
        assert np.allclose(core.y, exact.y, atol=1e-5)
