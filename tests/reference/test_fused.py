"""The second exact arithmetic: what is fused, that both languages fuse the same, and that a·b + c is rounded once."""

from __future__ import annotations

import contextlib
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import given
from hypothesis import strategies as st
from stepwell import _core
from stepwell.reference.fma import exact_fma, fma, odd_sum
from stepwell.reference.tape.fused import fused
from stepwell.reference.tape.increments import increments_last
from stepwell.reference.tape.lines import Operation, listed, needed
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support.cases import SYSTEMS, drawn, fits, number
from support.families import family
from support.tracing import CONTROLS, METHODS, made

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
    # x·y + z·x, its products written down in either order, and its sum either way round.
    factors = set()
    for turned in (False, True):
        for swapped in (False, True):
            tape = _core.Tape()
            leaves = [tape.state(i) for i in ((2, 1, 0) if turned else (0, 1, 2))]
            x, y, z = sorted(leaves, key=repr) if not turned else leaves[::-1]
            products = [z * x, x * y] if turned else [x * y, z * x]
            p, q = products[::-1] if turned else products
            total = q + p if swapped else p + q
            lines, _ = listed(*tape.fused([total]))
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


def test_with_a_tolerance() -> None:
    system, v, y = made("three bodies")
    run, _, plain = of_both(system, "merson", v=v, y=y, tolerance=1e-6, at=[0.05, 0.12, 0.25])
    assert np.abs(plain.y[-1] - run.y[-1]).max() < 1e-4


def test_a_number_that_all_have_in_common_is_one_of_each() -> None:
    """Nothing that is hoisted is fused."""
    common, own = (
        sw.integrate(sw.Oscillator(omega, 0.1), "rk4", v=0.0, y=np.ones(3), dt=0.1, steps=500, fused=True)
        for omega in (2.0, np.full(3, 2.0))
    )
    assert np.array_equal(common.y, own.y)


def test_one_free_oscillator_is_two_operations() -> None:
    model = engine.model(engine.Plan(sw.Oscillator(), sw.method("false_euler"), (), 0.1, fused=True))
    kernel = _core.compiled(model, 1)
    assert kernel is not None
    counts = kernel["computed"]
    assert (counts["fused"], counts["additions"], counts["multiplications"]) == (2, 0, 0)


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


def test_the_power_form() -> None:
    """Products of matrices are fused; both backends make the same ones."""
    system = sw.Oscillator(np.array([0.5, 1.0, 3.0]), 0.1, x=sw.Sinusoid(0.3, 2.0))
    run, _, plain = of_both(system, "rk4", v=0.0, y=1.0, dt=0.05, steps=1000, every=333, form="power")
    assert np.allclose(run.y, plain.y, rtol=1e-10, atol=1e-10)
