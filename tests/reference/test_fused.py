"""The second exact arithmetic: what is fused, that both languages fuse the same, and that a·b + c is rounded once."""

from __future__ import annotations

import contextlib
import math
import pickle
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import given
from hypothesis import strategies as st
from stepwell import _core
from stepwell.reference.fma import exact_fma, fma
from stepwell.reference.tape.fused import fused
from stepwell.reference.tape.increments import increments_last
from stepwell.reference.tape.lines import Operation, listed, needed
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support.cases import SOME, SYSTEMS, drawn, fits
from support.tracing import ABLE, CONTROLS, METHODS, made

WRONG: Any = "yes"
ANY = st.floats(allow_nan=True, allow_infinity=True)


def rounded_once(a: float, b: float, c: float) -> float:
    """a·b + c by exact rational arithmetic, or as IEEE 754 has it where that has no answer."""
    if not (math.isfinite(a) and math.isfinite(b)):
        return a * b + c
    if not math.isfinite(c):
        return c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    if not exact:
        return a * b + c
    try:
        return float(exact)
    except OverflowError:
        return math.inf if exact > 0 else -math.inf


def same(a: float, b: float) -> bool:
    return (a != a and b != b) or (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))


@given(ANY, ANY, ANY)
def test_a_product_and_a_sum_are_rounded_once(a: float, b: float, c: float) -> None:
    with np.errstate(all="ignore"):
        want = getattr(math, "fma", None)
        got = fma(a, b, c).item()
        assert same(got, rounded_once(a, b, c)), (a, b, c)
        if want and not any(map(math.isnan, (a, b, c))):
            with contextlib.suppress(OverflowError, ValueError):  # where IEEE 754 has an infinity or a NaN
                assert same(got, want(a, b, c))


def test_where_sums_cancel_and_halves_are_met() -> None:
    # c is minus the product, or a few last digits beside it; and products whose rest is half a digit of the sum.
    rng = np.random.default_rng(3)
    a, b = (rng.normal(size=20_000) * 2.0 ** rng.integers(-40, 40, 20_000) for _ in range(2))
    c = -(a * b) * (1.0 + rng.integers(-3, 4, a.size) * 2.0**-52)
    c[::3] = rng.normal(size=c[::3].size) * 2.0 ** rng.integers(-80, 80, c[::3].size)
    a[::5] = 1.0 + 2.0**-30 * rng.integers(0, 8, a[::5].size)
    b[::5], c[::5] = 1.0 + 2.0**-23, 2.0**53 * rng.integers(1, 4, c[::5].size)
    got = fma(a, b, c)
    assert got.tolist() == [exact_fma(*each) for each in zip(a.tolist(), b.tolist(), c.tolist(), strict=True)]
    assert (got != a * b + c).mean() > 0.2  # it is another number often enough for this to be a test


@SOME
@pytest.mark.parametrize("name", SYSTEMS)
def test_both_fuse_the_same(name: str, some: int | None) -> None:
    system, _, _ = made(name)
    if int(np.prod(system.v_shape)) > 30:
        return  # its step is too long for one tape
    counts = []
    for method in drawn([each for each in METHODS if fits(system, each)], some and some // 2, name):
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
    # Without any rounding both tapes have the same values, but for the new numbers c and c₂/c₁, each of which is rounded: there
    # are at most three for an evaluation, each wrong by 2⁻⁵³ of a term, and no term of these steps exceeds 2⁸ times its result.
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


def runs(system: Any, method: Any, v: Any, y: Any, **more: Any) -> tuple[Any, Any]:
    return tuple(sw.integrate(system, method, v=v, y=y, fused=True, backend=backend, **more) for backend in ("rust", "numpy"))


def assert_equal(one: Any, other: Any) -> None:
    assert np.array_equal(one.v, other.v, equal_nan=True)
    assert np.array_equal(one.y, other.y, equal_nan=True)
    assert np.array_equal(np.signbit(one.y), np.signbit(other.y))


KERNELS = ["interpret", *(level for level in _core.isa_levels() if level != "interpret")]
RUN = ["free", "pendulum, sinusoid a, damped", "sampled x and a, physical", "three bodies, newton", "chain of five"]


@pytest.mark.parametrize("kernels", KERNELS)
@pytest.mark.parametrize("name", [*RUN, "restricted three bodies", "linear, velocities only"])
def test_the_core_has_the_bits_of_the_reference(name: str, kernels: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STEPWELL_KERNELS", kernels)
    system, v, y = made(name)
    for method in map(sw.method, ("damped_euler", "leapfrog", "verlet", "false_heun", "rk4", "fehlberg_5")):
        if fits(system, method):
            assert_equal(*runs(system, method, v, y, dt=0.01, steps=5, every=2))


def test_with_a_tolerance() -> None:
    system, v, y = made("three bodies")
    for method in ABLE:
        one, other = runs(system, method, v, y, tolerance=1e-6, at=[0.05, 0.12, 0.25])
        assert_equal(one, other)
        assert one.paces == other.paces
        plain = sw.integrate(system, method, v=v, y=y, tolerance=1e-6, at=[0.25])
        assert np.abs(plain.y[-1] - one.y[-1]).max() < 1e-4
        first = sw.integrate(system, method, v=v, y=y, tolerance=1e-6, at=[0.05], fused=True)
        on = sw.integrate(system, method, at=[0.25], resume=first)
        assert np.array_equal(on.y[-1], one.y[-1])


@pytest.mark.parametrize("control", CONTROLS)
def test_under_control_and_what_is_recorded(control: str) -> None:
    system, v, y = made("three bodies")
    for method in ("false_euler", "semi_false_heun", "rk4"):
        more = {"control": CONTROLS[control], "record": ["energy"], "every": 5}
        one, other = runs(system, method, v, y, dt=1e-3, steps=20, **more)
        assert_equal(one, other)
        assert np.array_equal(one.work, other.work)
        # What is recorded is a property of the state and is computed as it is without.
        assert np.array_equal(one.recorded["energy"], one.quantity("energy"))


def test_a_world_and_going_on() -> None:
    system, v, y = made("three bodies")
    for method in ("leapfrog", "verlet", "rk4"):
        whole = sw.integrate(system, method, v=v, y=y, dt=1e-3, steps=20, fused=True)
        half = sw.integrate(system, method, v=v, y=y, dt=1e-3, steps=8, fused=True)
        assert np.array_equal(sw.integrate(system, method, steps=12, resume=half).y, whole.y)
        world = sw.World(system, method, v=v.copy(), y=y.copy(), dt=1e-3, fused=True)
        world.step(8)
        again = pickle.loads(pickle.dumps(world))
        again.step(12)
        assert np.array_equal(again.y, whole.y[-1])
    plain, with_fused = (sw.integrate(system, "rk4", v=v, y=y, dt=0.1, steps=5, fused=each).y for each in (False, True))
    assert not np.array_equal(plain, with_fused)


def test_a_member_alone_and_batches_of_two_axes() -> None:
    for batch in ((), (2, 3)):
        omega = np.broadcast_to(np.float64(1.3), batch)
        for method in ("false_euler", "leapfrog", "rk4"):
            assert_equal(*runs(sw.Oscillator(omega), sw.method(method), 0.2, 1.0, dt=0.1, steps=7, every=3))


def test_neither_company_nor_threads_change_a_bit() -> None:
    omega = np.linspace(0.5, 2.0, 1000)
    together = sw.integrate(sw.Oscillator(omega, 0.1), "rk4", v=0.0, y=1.0, dt=0.1, steps=500, fused=True, threads=2)
    for i in (0, 499, 999):
        alone = sw.integrate(sw.Oscillator(float(omega[i]), 0.1), "rk4", v=0.0, y=1.0, dt=0.1, steps=500, fused=True)
        assert alone.y[-1] == together.y[-1, i]
    # A number that all have in common is one of each: nothing that is hoisted is fused.
    common = sw.integrate(sw.Oscillator(2.0, 0.1), "rk4", v=0.0, y=np.ones(3), dt=0.1, steps=500, fused=True)
    own = sw.integrate(sw.Oscillator(np.full(3, 2.0), 0.1), "rk4", v=0.0, y=np.ones(3), dt=0.1, steps=500, fused=True)
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
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=2, fused=WRONG, backend=backend)


@pytest.mark.parametrize(
    ("system", "shape", "members"),
    [(sw.Chain(200), (200,), ()), (sw.Chain(200), (200,), (9,)), (sw.NBody(np.ones(12), softening=0.1), (12, 2), (2,))],
    ids=repr,
)
def test_long_steps(system: sw.System, shape: tuple[int, ...], members: tuple[int, ...]) -> None:
    """Of more operations than a tape has that is not fused: one tape, as long as it is."""
    rng = np.random.default_rng(3)
    v, y = 0.1 * rng.normal(size=(*shape, *members)), rng.normal(size=(*shape, *members))
    runs = [
        sw.integrate(system, "rk4", v=v, y=y, dt=0.1, steps=2, fused=fused, backend=backend)
        for fused, backend in ((True, "rust"), (True, "numpy"), (False, "rust"))
    ]
    assert np.array_equal(runs[0].y, runs[1].y)
    assert np.array_equal(runs[0].v, runs[1].v)
    assert not np.array_equal(runs[0].v, runs[2].v)
    assert np.allclose(runs[0].y, runs[2].y, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", ["rk4", "leapfrog"])
@pytest.mark.parametrize(("states", "members"), [(1, ()), (3, (33,)), (12, ()), (12, (2,))])
def test_the_matrix_form(states: int, members: tuple[int, ...], method: str) -> None:
    """Each product after the first is added by one operation: on a tape, by the kernel of large matrices, by the reference."""
    rng = np.random.default_rng(states)
    a = np.zeros((2 * states, 2 * states))
    a[:states, states:], a[states:, :states] = -np.eye(states) - 0.1 * rng.normal(size=(states, states)), np.eye(states)
    b = np.concatenate([np.ones((states, 1)), np.zeros((states, 1))])
    system = sw.LinearSystem(a, b, x=[sw.Sinusoid(0.3, 2.0)], velocities=states)
    v, y = rng.normal(size=(2, states, *members))
    ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.05, "steps": 8, "every": 4, "form": "matrix"}
    runs = [
        sw.integrate(system, method, fused=fused, backend=backend, **ask)
        for fused, backend in ((True, "rust"), (True, "numpy"), (False, "rust"))
    ]
    assert np.array_equal(runs[0].y, runs[1].y)
    assert np.array_equal(runs[0].v, runs[1].v)
    assert states == 1 or not np.array_equal(runs[0].y, runs[2].y)
    assert np.allclose(runs[0].y, runs[2].y, rtol=1e-11, atol=1e-11)
    if members:
        alone = sw.integrate(system, method, fused=True, **ask | {"v": v[:, 0], "y": y[:, 0]})
        assert np.array_equal(alone.y, runs[0].y[..., 0])
    halves = sw.integrate(system, method, fused=True, **ask | {"steps": 4})
    rest = sw.integrate(system, method, steps=4, form="matrix", resume=halves)
    assert np.array_equal(rest.y[-1], runs[0].y[-1])


def test_the_power_form() -> None:
    """Products of matrices are fused; both backends make the same ones."""
    system = sw.Oscillator(np.array([0.5, 1.0, 3.0]), 0.1, x=sw.Sinusoid(0.3, 2.0))
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.05, "steps": 1000, "every": 333, "form": "power"}
    fused, other = (sw.integrate(system, "rk4", fused=True, backend=backend, **ask) for backend in ("rust", "numpy"))
    plain = sw.integrate(system, "rk4", **ask)
    assert np.array_equal(fused.y, other.y)
    assert not np.array_equal(fused.y, plain.y)
    assert np.allclose(fused.y, plain.y, rtol=1e-10, atol=1e-10)
