"""Elementary functions of symbols: what stands on a tape makes the bits that arrays have."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import TraceError
from stepwell.reference import functions as fn
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.tape.replay import Replay
from support import symbols
from support.true_functions import COMPARE, OF_ONE, OF_TWO, SPECIALS, TRUE, arguments, errors, same

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


@pytest.mark.parametrize("name", NAMES)
def test_the_tape_has_the_bits_of_arrays(name: str) -> None:
    tape, state = _core.Tape(), [patterns(1, 2000), patterns(2, 2000)][: 2 if name in OF_TWO else 1]
    symbol = getattr(fn, name)(*map(tape.state, range(len(state))))
    with np.errstate(all="ignore"):
        assert same(as_it_stands(tape, symbol, state), getattr(fn, name)(*state)).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_tape_that_shortens_nothing_has_the_same_bits(name: str) -> None:
    """The second tape, in Python: so no bit depends on what the core's does beforehand or leaves out."""
    tape, state = symbols.Tape(), [patterns(1, 500), patterns(2, 500)][: 2 if name in OF_TWO else 1]
    symbol = getattr(fn, name)(*map(tape.state, range(len(state))))
    (values,) = symbols.evaluate(tape, [symbol], {("state", i): each for i, each in enumerate(state)}, lambda _, t: t)
    with np.errstate(all="ignore"):
        assert same(np.broadcast_to(values, state[0].shape), getattr(fn, name)(*state)).all()


@pytest.mark.parametrize("name", OF_TWO)
@pytest.mark.parametrize("known", [0.0, -0.0, 1.0, -3.0, 0.3, 7.0, 1e300, np.inf, np.nan])
def test_a_number_beside_a_symbol_is_a_symbol(name: str, known: float) -> None:
    x, f = patterns(3, 500), getattr(fn, name)
    tape = _core.Tape()
    with np.errstate(all="ignore"):
        assert same(as_it_stands(tape, f(tape.state(0), known), [x]), f(x, known)).all()
        assert same(as_it_stands(tape, f(known, tape.state(0)), [x]), f(known, x)).all()


@pytest.mark.parametrize("name", NAMES)
def test_what_is_known_beforehand_is_computed_beforehand(name: str) -> None:
    """Unless a NaN comes up on the way, which the tape leaves to whoever computes."""
    folded = 0
    for x in [0.0, -0.0, 0.3, -2.0, 5e-324, 1e6, *np.random.default_rng(4).uniform(0.0, 1.0, 20).tolist()]:
        tape = _core.Tape()
        numbers = (x, 0.7)[: 2 if name in OF_TWO else 1]
        operations, (root,) = tape.operations([getattr(fn, name)(*map(tape.number, numbers))])
        expected = getattr(fn, name)(*(np.array(each) for each in numbers))
        with np.errstate(all="ignore"):
            assert same(as_it_stands(tape, getattr(fn, name)(*map(tape.number, numbers)), [np.zeros(1)]), expected).all()
        folded += [kind for kind, _, _ in operations] == ["constant"]
        assert root == len(operations) - 1  # nothing else
    assert folded >= 20


@pytest.mark.parametrize("exponent", [0, 1, -1, 5, 16, 0.5, -1.5, 2.3, -0.0])
def test_known_powers_of_symbols(exponent: float) -> None:
    x, tape = patterns(5, 1000), _core.Tape()
    with np.errstate(all="ignore"):
        assert same(as_it_stands(tape, fn.power(tape.state(0), exponent), [x]), fn.power(x, exponent)).all()


@pytest.mark.parametrize("name", COMPARE)
def test_comparisons_by_name(name: str) -> None:
    x, y, tape = patterns(9, 1000), np.random.default_rng(9).permutation(patterns(9, 1000)), _core.Tape()
    x[::3] = y[::3]
    f, theirs = getattr(fn, name), getattr(np, name)(x, y)
    assert (f(x, y) == theirs).all()
    for condition in (f(tape.state(0), tape.state(1)), f(np.array([tape.state(0)], dtype=object), tape.state(1))[0]):
        assert same(as_it_stands(tape, fn.where(condition, 1.0, 0.0), [x, y]), np.where(theirs, 1.0, 0.0)).all()
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


def test_sine_and_cosine_of_one_angle_share_their_work() -> None:
    tape = _core.Tape()
    x = tape.state(0)
    one, both = (len(tape.operations(symbols)[0]) for symbols in ([fn.sin(x)], [fn.sin(x), fn.cos(x)]))
    assert both - one < 10


@pytest.mark.parametrize("name", TRUE)
def test_fused_they_are_as_accurate(name: str) -> None:
    """Products that are exact stay so when they are fused, and the others lose a rounding."""
    points = arguments(name, np.random.default_rng(8), 400)
    tape = _core.Tape()
    (values,) = Evaluation(tape, [getattr(fn, name)(*map(tape.state, range(len(points))))], {}, fuse=True)(points)
    assert errors(values, name, points).max() < 1.0


def test_interp_is_numpys() -> None:
    """Between any places, of the time and of the state, and with what is given for outside."""
    places, values = np.array([0.0, 0.3, 0.5, 1.2, 2.0]), np.array([1.0, -2.0, 0.5, 3.0, 0.0])
    at = np.linspace(-1.0, 3.0, 401)
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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: np.interp(t, np.arange(1000.0), np.zeros(1000)), r"at most 256 points.* got 1000; .*sw\.Sampled"),
        (lambda t: np.interp(t, [0.0, 1.0], [1.0, 2.0, 3.0]), r"one length along one axis, got shapes \(2,\) and \(3,\)"),
        (lambda t: np.interp(t, [1.0, 0.0], [1.0, 2.0]), "places xp that ascend"),
        (lambda t: np.interp(t, [0.0, 1.0], [1.0, 2.0], period=1.0), "write np.mod"),
        (lambda t: np.interp(t, np.array([0.0, 1.0]) * t, [1.0, 2.0]), "known numbers as the places xp"),
    ],
)
def test_what_interp_refuses(call: Any, message: str) -> None:
    @sw.system
    def own(t: Any, v: Any, y: Any) -> Any:
        return call(t)

    with pytest.raises(TraceError, match=message):
        sw.integrate(own, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)


def test_a_spline_of_another_package_is_told_from_ones_own_mistakes() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    spline = interpolate.CubicSpline([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])

    @sw.system
    def own(t: Any, v: Any, y: Any) -> Any:
        return spline(t) - y

    with pytest.raises(TraceError, match=r"used by scipy, .* sw\.Sampled\(values, interval, interpolation="):
        sw.integrate(own, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
