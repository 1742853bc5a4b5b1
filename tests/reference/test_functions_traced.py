"""Elementary functions of symbols: what stands on a tape makes the bits that arrays have."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import TraceError
from stepwell.reference import functions as fn
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.tape.replay import Replay
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support.graphs import assert_one_graph
from support.refusals import refused
from support.true_functions import COMPARE, OF_ONE, OF_TWO, SPECIALS, TRUE, arguments, errors, same
from support.ways import assert_equal_ways

NAMES = [*OF_ONE, *OF_TWO]


def as_it_stands(tape: Any, symbol: Any, state: list[np.ndarray]) -> np.ndarray:
    """What a tape makes, one operation after the other, none of them fused."""
    (value,) = Replay(*tape.operations([symbol]))(state, [])
    return np.broadcast_to(value, np.broadcast_shapes(*(each.shape for each in state)))


def patterns(seed: int, n: int) -> np.ndarray:
    """Bits at random, so numbers of all sizes and some NaN, then numbers near 1, and all that is special."""
    rng = np.random.default_rng(seed)
    bits = rng.integers(0, 2**64, n, dtype=np.uint64).view(np.float64)
    return rng.permutation(np.concatenate([bits, rng.uniform(-4.0, 4.0, n), rng.uniform(-800.0, 800.0, n), SPECIALS]))


def test_the_tape_has_the_bits_of_arrays() -> None:
    state = [patterns(1, 1000), patterns(2, 1000)]
    for name in NAMES:
        f, numbers, tape = getattr(fn, name), state[: 2 if name in OF_TWO else 1], _core.Tape()
        with np.errstate(all="ignore"):
            assert same(as_it_stands(tape, f(*map(tape.state, range(len(numbers)))), numbers), f(*numbers)).all(), name


def test_a_number_beside_a_symbol_is_a_symbol() -> None:
    x = patterns(3, 500)
    for name, known in itertools.product(OF_TWO, [0.0, -0.0, 1.0, -3.0, 0.3, 7.0, 1e300, np.inf, np.nan]):
        f, tape = getattr(fn, name), _core.Tape()
        with np.errstate(all="ignore"):
            assert same(as_it_stands(tape, f(tape.state(0), known), [x]), f(x, known)).all(), (name, known)
            assert same(as_it_stands(tape, f(known, tape.state(0)), [x]), f(known, x)).all(), (name, known)


def test_what_is_known_beforehand_is_computed_beforehand() -> None:
    """Unless a NaN comes up on the way, which the tape leaves to whoever computes."""
    for name in NAMES:
        f, folded = getattr(fn, name), 0
        for x in [0.0, -0.0, 0.3, -2.0, 5e-324, 1e6, *np.random.default_rng(4).uniform(0.0, 1.0, 20).tolist()]:
            tape = _core.Tape()
            numbers = (x, 0.7)[: 2 if name in OF_TWO else 1]
            symbol = f(*map(tape.number, numbers))
            operations, (root,) = tape.operations([symbol])
            with np.errstate(all="ignore"):
                assert same(as_it_stands(tape, symbol, [np.zeros(1)]), f(*map(np.array, numbers))).all(), (name, x)
            folded += [kind for kind, _, _ in operations] == ["constant"]
            assert root == len(operations) - 1  # nothing else
        assert folded >= 20, name


def test_known_powers_of_symbols() -> None:
    x = patterns(5, 1000)
    for exponent in (0, 1, -1, 5, 16, 0.5, -1.5, 2.3, -0.0):
        tape = _core.Tape()
        with np.errstate(all="ignore"):
            assert same(as_it_stands(tape, fn.power(tape.state(0), exponent), [x]), fn.power(x, exponent)).all(), exponent


def test_comparisons_by_name() -> None:
    x, y = patterns(9, 1000), np.random.default_rng(9).permutation(patterns(9, 1000))
    x[::3] = y[::3]
    for name in COMPARE:
        f, theirs, tape = getattr(fn, name), getattr(np, name)(x, y), _core.Tape()
        assert (f(x, y) == theirs).all(), name
        for condition in (f(tape.state(0), tape.state(1)), f(np.array([tape.state(0)], dtype=object), tape.state(1))[0]):
            assert same(as_it_stands(tape, fn.where(condition, 1.0, 0.0), [x, y]), np.where(theirs, 1.0, 0.0)).all(), name
        assert isinstance(f(1.0, 2), np.bool_)


def test_choices_and_arrays_of_symbols() -> None:
    x, y = patterns(6, 1000), patterns(7, 1000)
    tape = _core.Tape()
    a, b = tape.state(0), tape.state(1)
    with np.errstate(all="ignore"):
        symbol = fn.where((a < b) & ~(a <= 1.0), fn.clip(a, -2.0, 2.0), 3)
        assert same(as_it_stands(tape, symbol, [x, y]), fn.where((x < y) & ~(x <= 1.0), fn.clip(x, -2.0, 2.0), 3)).all()
        both = np.array([a, b], dtype=object)
        for symbol, expected in zip(fn.arctan2(both, [1.0, 2.0]), (fn.arctan2(x, 1.0), fn.arctan2(y, 2.0)), strict=True):
            assert same(as_it_stands(tape, symbol, [x, y]), expected).all()
        chosen = fn.where(fn.less(both, 1.0) | ~fn.less(both, 3.0), both, 0.0)
        assert same(as_it_stands(tape, chosen[1], [x, y]), fn.where((y < 1.0) | ~(y < 3.0), y, 0.0)).all()
        mixed = fn.exp(np.array([a, 1.0], dtype=object))
        assert mixed[1] == fn.exp(1.0)
        assert mixed[0].id == fn.exp(a).id
        assert fn.where(True, a, 2.0).id == a.id
        assert fn.where(np.array([True, False]), both, 2.0)[0].id == a.id


def test_fused_they_are_as_accurate() -> None:
    """Products that are exact stay so when they are fused, and the others lose a rounding."""
    for name in TRUE:
        points, tape = arguments(name, np.random.default_rng(8), 200), _core.Tape()
        (values,) = Evaluation(tape, [getattr(fn, name)(*map(tape.state, range(len(points))))], {}, fuse=True)(points)
        assert errors(values, name, points).max() < 1.0, name


def test_interp_is_numpys() -> None:
    """Between any places, of the time and of the state, and with what is given for outside."""
    places, values = np.array([0.0, 0.3, 0.5, 1.2, 2.0]), np.array([1.0, -2.0, 0.5, 3.0, 0.0])
    at = np.linspace(-1.0, 3.0, 101)
    for outside in ({}, {"left": 7.0}, {"right": 9.0}, {"left": -1.0, "right": 1.0}):

        @sw.system(order=1)
        def table(t: Any, y: Any) -> Any:
            return np.interp(t, places, values, **outside)  # noqa: B023  # it is run in this turn of the loop

        system = table().for_state_shapes(None, np.empty(()))
        for t in at:
            rate = system.reference_at_step(1.0, ()).rates(t, np.empty(0), np.empty(()))[1]
            # A slope, a time since, a product and a sum, of values up to 3 and slopes up to 13.
            assert abs(rate - np.interp(t, places, values, **outside)) < 40 * 2.0**-52


def test_interp_means_the_same_as_a_linear_sampled() -> None:
    values = np.array([1.0, -2.0, 0.5, 3.0, 0.0])

    @sw.system
    def by_table(t: Any, v: Any, y: Any, *, push: Any = 0.0) -> Any:
        return np.interp(t, 0.25 * np.arange(5), values) - y

    @sw.system
    def by_input(t: Any, v: Any, y: Any, *, push: Any = 0.0) -> Any:
        return push - y

    start: dict[str, Any] = {"v": 0.0, "y": np.ones(3), "dt": 0.05, "steps": 30, "every": 3}
    lines = sw.Sampled(values, 0.25, interpolation="linear")
    runs = [sw.integrate(each, "rk4", **start) for each in (by_table(), by_input(push=lines))]
    assert runs[0].y == pytest.approx(runs[1].y, abs=1e-14)
    other = sw.integrate(by_table(), "rk4", **start, backend="numpy")
    np.testing.assert_array_equal(runs[0].y, other.y)


def pushed_by(call: Any) -> Any:
    return sw.system(lambda t, v, y: call(t))


def test_what_interp_refuses() -> None:
    calls: list[Any] = [
        (lambda t: np.interp(t, np.arange(1000.0), np.zeros(1000)), r"at most 256 points.* got 1000; .*sw\.Sampled"),
        (lambda t: np.interp(t, [0.0, 1.0], [1.0, 2.0, 3.0]), r"one length along one axis, got shapes \(2,\) and \(3,\)"),
        (lambda t: np.interp(t, [1.0, 0.0], [1.0, 2.0]), "places xp that ascend"),
        (lambda t: np.interp(t, [0.0, 1.0], [1.0, 2.0], period=1.0), "write np.mod"),
        (lambda t: np.interp(t, np.array([0.0, 1.0]) * t, [1.0, 2.0]), "known numbers as the places xp"),
    ]
    for call, message in calls:
        refused(TraceError, message, sw.integrate, pushed_by(call), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)


def test_a_spline_of_another_package_is_told_from_ones_own_mistakes() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    spline = interpolate.CubicSpline([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])

    @sw.system
    def own(t: Any, v: Any, y: Any) -> Any:
        return spline(t) - y

    with pytest.raises(TraceError, match=r"used by scipy, .* sw\.Sampled\(values, interval, interpolation="):
        sw.integrate(own, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)


TAYLOR = sw.method("taylor")

#: Rates rates_by y with a parameter p, which is a symbol on a tape and no series.
OF_STATE_AND_PARAMETER: dict[str, Callable[[Any, Any], Any]] = {
    "power": lambda y, p: y**p,
    "exponent": lambda y, p: p**y,
    "float_power": np.float_power,
    "hypot": np.hypot,
    "hypot rates_by a parameter first": lambda y, p: np.hypot(p, y),
    "logaddexp": np.logaddexp,
    "logaddexp rates_by a parameter first": lambda y, p: np.logaddexp(p, y),
    "arctan2": np.arctan2,
    "arctan2 rates_by a parameter first": lambda y, p: np.arctan2(p, y),
    "mod": np.mod,
    "remainder": np.remainder,
    "%": lambda y, p: y % p,
    "twice with different parameters": lambda y, p: np.hypot(y, p) - np.hypot(y, 2.0 * p),
    "twice with zeros rates_by both signs": lambda y, p: np.arctan2(y, 0.0) - p * np.arctan2(y, -0.0),
}


def rates_by(name: str) -> sw.System:
    @sw.system
    def own(t: Any, v: Any, y: Any, *, p: Any = 1.7) -> Any:
        return -OF_STATE_AND_PARAMETER[name](y, p)

    return own(p=[1.2, 1.7])


def test_series_of_two_arguments_are_one_graph() -> None:
    for name in OF_STATE_AND_PARAMETER:
        system, tape = rates_by(name).for_state_shapes(0.0, 0.0), _core.Tape()
        for what, traced in (("step", Tracer(system, tape).step), ("attempt", Tracer(system, tape).attempt)):
            model = engine.model(engine.Plan(system, TAYLOR, (), 0.1))
            assert_one_graph(tape, tape.trace(model, what), traced(TAYLOR))


@pytest.mark.parametrize("name", ["power", "hypot", "arctan2", "mod"])
def test_everything_that_reads_a_step_of_such_a_series(name: str) -> None:
    system = rates_by(name)
    one = {"v": 0.0, "y": 0.9}
    assert np.isfinite(sw.lyapunov(system, "taylor", **one, dt=0.01, steps=20).exponents).all()
    assert sum(sw.explain(system, "taylor").computed.values()) > 0
    assert "_step" in sw.export(system, "taylor", "c", dt=0.01, member=1).source
    below = sw.Event(lambda t, v, y: y - 0.85, name="below")
    run = sw.integrate(system, "taylor", **one, dt=0.01, steps=80, events=[below])
    assert (run.events["below"].count >= 1).all()
    assert np.shape(sw.stability_limit(system, "taylor", **one)) == (2,)


# The bits of exponential functions at all their edges, on every level.
#: Where e^x and its kind end, and where two factors take turns.
EDGES = [0.0, 709.78, 709.79, 710.0, 800.0, 1e300, 708.4, 708.3, 745.1, 745.2, 746.0, 744.4, 1022.0, 1024.0, 1074.0, 1075.0, 0.25]


def at_edges() -> np.ndarray:
    rng = np.random.default_rng(6)
    near = np.concatenate([[each, np.nextafter(each, 9e99), np.nextafter(each, -9e99)] for each in EDGES])
    halves = (np.arange(-1080, 1030) + 0.5) * np.log(2.0)  # where n changes
    some = [rng.uniform(-760.0, 720.0, 500), rng.uniform(-1.0, 1.0, 200), halves, np.nextafter(halves, 0.0)]
    return np.concatenate([near, -near, *some])


EXPONENTIALS: list[Callable[[Any], Any]] = [
    np.exp, np.expm1, np.exp2, lambda y: np.exp(y) * np.expm1(-y), lambda y: np.where(y < 0.0, np.exp(y), -np.exp(y)),
    # Fused, the last product and the sum are one operation: of one more and less, the logistic, next to what is subnormal and far
    # from it, next to what is infinite, and beside zero.
    lambda y: 1.0 + np.exp(y), lambda y: 1.0 - np.exp(y), lambda y: np.exp(y) - 1.0, lambda y: 1.0 / (1.0 + np.exp(-y)),
    lambda y: np.exp(y) + 1e-320, lambda y: 1e-270 - np.exp(y), lambda y: np.exp(y) - 1.7e308, lambda y: np.exp(y) + 0.0 * y,
    lambda y: 1.5**y, lambda y: np.tanh(y) + np.exp(-y),
]  # fmt: skip


def of_state(function: Any) -> sw.System:
    return sw.system(lambda t, v, y: function(y))()


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
@pytest.mark.parametrize("fused", [False, True])
def test_exponentials_at_their_edges_are_the_same_at_all_levels(fused: bool) -> None:
    """Where an instruction multiplies by a power of two."""
    for function, y in itertools.product(EXPONENTIALS, (at_edges(), np.array([-720.0]))):
        ask: dict[str, Any] = {"v": np.zeros(y.shape), "y": y, "dt": 1.0, "steps": 1}
        assert_equal_ways(of_state(function), "standard_euler", ways=("by the reference", "at each level"), fused=fused, **ask)
