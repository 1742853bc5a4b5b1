"""Taylor series of solutions: their coefficients against known ones, their steps, what they refuse."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ToleranceWarning, UnsupportedError
from stepwell.reference import series, series_pace
from stepwell.reference.tape import rules
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support.calls import assert_raises, quiet
from support.graphs import assert_traced_alike
from support.looped import looped
from support.truths import DRIVE, END, FORCE, OMEGA, forced_exact
from support.ways import assert_equal_ways

from benches.compare.chosen import solar

TAYLOR = sw.method("taylor")
EPS = 2.0**-52

#: Rates that are functions of the time alone, as NumPy and as mpmath have them; p is a polynomial, about 0.4.
FUNCTIONS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "product": (lambda p: p * p * (p + 1.0), lambda p: p * p * (p + 1)),
    "quotient": (lambda p: (p + 1.0) / (p * p + 2.0), lambda p: (p + 1) / (p * p + 2)),
    "whole over": (lambda p: 2.0 / p, lambda p: 2 / p),
    "reciprocal": (lambda p: 1.0 / p, lambda p: 1 / p),
    "negative reciprocal": (lambda p: -1.0 / p, lambda p: -1 / p),
    "root": (np.sqrt, mpmath.sqrt),
    "negative": (lambda p: -p * (1.0 - p), lambda p: -p * (1 - p)),
    "sin": (np.sin, mpmath.sin),
    "cos": (np.cos, mpmath.cos),
    "tan": (np.tan, mpmath.tan),
    "arcsin": (np.arcsin, mpmath.asin),
    "arccos": (np.arccos, mpmath.acos),
    "arctan": (np.arctan, mpmath.atan),
    "arctan2": (lambda p: np.arctan2(p, p + 1.0), lambda p: mpmath.atan(p / (p + 1))),
    "sinh": (np.sinh, mpmath.sinh),
    "cosh": (np.cosh, mpmath.cosh),
    "tanh": (np.tanh, mpmath.tanh),
    "exp": (np.exp, mpmath.exp),
    "expm1": (np.expm1, mpmath.expm1),
    "log": (np.log, mpmath.log),
    "log1p": (np.log1p, mpmath.log1p),
    "cbrt": (np.cbrt, mpmath.cbrt),
    "hypot": (lambda p: np.hypot(p, 2.0 * p + 1.0), lambda p: mpmath.sqrt(p * p + (2 * p + 1) ** 2)),
    "whole power": (lambda p: p**3, lambda p: p**3),
    "power": (lambda p: p**0.3, lambda p: p ** mpmath.mpf(0.3)),
    "exponent": (lambda p: 1.7**p, lambda p: mpmath.mpf(1.7) ** p),
    "both": (lambda p: p**p, lambda p: p**p),
    "abs": (lambda p: abs(-p), lambda p: p),
}


def polynomial(t: Any) -> Any:
    return 0.4 + t * (0.25 + t * (-0.125 + t * 0.5))


squared = sw.system(order=1)(lambda t, y: y * y)


def of_time(name: str) -> sw.System:
    function = FUNCTIONS[name][0]
    return sw.system(order=1)(lambda t, y: function(polynomial(t)) + 0.0 * y)().for_state_shapes(None, np.zeros(()))


def coefficients(system: sw.System, order: int, v: Any, y: Any) -> list[Any]:
    with np.errstate(all="ignore"):
        return series.coefficients(system.reference_at_step(1.0, ()), order, 0.0, 1.0, np.asarray(v), np.asarray(y))


def assert_known(name: str) -> None:
    """The coefficients of a function of a polynomial, within roundings.

    One of order k is a sum of products of lower ones. With the polynomial's |cⱼ| ≤ ½·ρ⁻ʲ and functions that are analytic where
    |t| < ρ, roundings grow as ρ⁻ᵏ: they are allowed 40 units of the largest of the coefficients so far for each order.
    """
    computed = [float(y) for _, y in coefficients(of_time(name), 13, np.zeros(0), 0.0)]
    with mpmath.workdps(60):
        true = [float(mpmath.re(c)) for c in mpmath.taylor(lambda t: FUNCTIONS[name][1](polynomial(t)), 0, 12)]
    size = 1.0
    for k in range(13):
        size = max(size, abs(true[k]))
        assert abs(computed[k] * (k + 1) - true[k]) <= 40 * (k + 1) * EPS * size, (name, k)


@looped("name", FUNCTIONS)
def test_functions_have_their_coefficients_and_one_graph(name: str) -> None:
    assert_known(name)
    assert_traced_alike(of_time(name), TAYLOR, "step", "attempt")


def _wrong_product(a: Any, b: Any, k: int) -> Any:
    return series._product(a[k], b[0]) if k else None


def _wrong_reciprocal(start: Any, dividend: Any, divisor: Any, sign: int = 0, right: Any = series._quotient) -> Any:
    return right(start, dividend, divisor, -sign)


#: A mistake in the reference, and a function whose coefficients it changes.
MISTAKES: dict[str, tuple[Callable[[pytest.MonkeyPatch], None], str]] = {
    "a product of the newest terms only": (lambda patch: patch.setattr(series, "_convolved", _wrong_product), "product"),
    "a reciprocal of the other sign": (lambda patch: patch.setattr(series, "_quotient", _wrong_reciprocal), "reciprocal"),
    "a difference for a sum": (lambda patch: patch.setattr(series, "_sum", lambda a, b: series._difference(a, b)), "quotient"),
    "a sum for a difference": (
        lambda patch: patch.setattr(series, "_difference", lambda a, b: b if a is None else (a if b is None else a + b)),
        "root",
    ),
    "a derivative of the other sign": (
        lambda patch: patch.setitem(rules.PARTIALS, "sin", (lambda f, y, x: -f("cos")(x),)),
        "sin",
    ),
}


@pytest.mark.mutant
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_wrong_recurrence_is_noticed(mistake: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, name = MISTAKES[mistake]
    make(monkeypatch)
    with pytest.raises(AssertionError):
        assert_known(name)


def test_a_step_is_the_series_cut_off_at_order_eight() -> None:
    """Of ẏ = y², y(0) = 1: 1/(1 − t) = Σ tᵏ. Every power and every sum is rounded: some 40 times in all, each term below 1.3."""
    for h in (0.1, 0.2):
        run = sw.integrate(squared, "taylor", y=1.0, dt=h, steps=1)
        assert abs(run.y[-1] - sum(h**k for k in range(9))) < 40 * EPS
        assert abs(run.y[-1] - sum(h**k for k in range(8))) > 0.5 * h**8


def _cleaned_slopes(error: Callable[[int], tuple[Any, Any]]) -> list[float]:
    """The order that 8, 16 and 32 steps show, of v and of y.

    E(h) = C·h⁸ + D·h⁹ + …. F(h) = 2⁹·E(h/2) − E(h) has no h⁹, so its slope is off by O(h²). With E alone it is
    off by O(h), and that of v on the forced system all but vanishes at 4 steps: slopes from 2 steps on are 13.3, 3.7, 7.5, 7.8.
    Rounding, 1e-15·2⁹, is below a hundredth of F.
    """
    errors = [error(steps) for steps in (8, 16, 32)]
    slopes = []
    for block in (0, 1):
        first, second = (np.linalg.norm(2.0**9 * np.atleast_1d(b[block]) - a[block]) for a, b in itertools.pairwise(errors))
        slopes.append(float(np.log2(first / second)))
    return slopes


def _forced(steps: int, backend: Any) -> tuple[Any, Any]:
    system = sw.Oscillator(OMEGA, 0.2, a=sw.Sinusoid(FORCE, DRIVE), form="physical")
    run = sw.integrate(system, "taylor", v=0.3, y=1.0, dt=END / steps, steps=steps, backend=backend)
    v, y = forced_exact(END, 0.2, 0.3, 1.0)
    return run.v[-1] - v, run.y[-1] - y


def _clover(steps: int, backend: Any) -> tuple[Any, Any]:
    """Three bodies on the unit circle, angular speed 1, after three units of time."""
    scene = sw.scenes.clover()
    run = sw.integrate(scene.system, "taylor", v=scene.v, y=scene.y, dt=3.0 / steps, steps=steps, backend=backend)
    v, y = scene.exact(np.array([3.0]))
    return run.v[-1] - v[0], run.y[-1] - y[0]


@looped("error, backend", itertools.product([_forced, _clover], ["rust", "numpy"]))
def test_the_order_is_eight(error: Callable[[int, Any], tuple[Any, Any]], backend: str) -> None:
    """Of a damped oscillator under a sinusoid, whose derivatives in time the series needs; and of bodies."""
    assert _cleaned_slopes(lambda steps: error(steps, backend)) == pytest.approx([8.0, 8.0], abs=0.1)


@pytest.mark.mutant
def test_a_wrong_order_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A term less; and an input that stays as it is at the start of the step."""
    monkeypatch.setattr(TAYLOR.steps, "ORDER", 7)
    assert _cleaned_slopes(lambda steps: _forced(steps, "numpy")) != pytest.approx([8.0, 8.0], abs=0.1)
    monkeypatch.undo()
    original = series.coefficients
    monkeypatch.setattr(TAYLOR.steps, "coefficients", lambda s, order, t, h, v, y: original(s, order, t, 0.0 * h, v, y))
    assert _cleaned_slopes(lambda steps: _forced(steps, "numpy")) != pytest.approx([8.0, 8.0], abs=0.1)


@looped("tolerance", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_order_and_step_by_the_tolerance(tolerance: float) -> None:
    """Of ẏ = y the coefficients are y/k!, so the step is known.

    It is the least of (τ·k!)^(1/k), k = p − 1 and p, times exp(−0.7/(p − 1)), where τ is the tolerance times the larger of y and
    of what ẏ makes in the step before. The logarithm to base 2 of the core has an error below 2.9e-5, of which a step gets
    ln 2/(2k), and its power of 2 one of 3.5e-6. It gets 1/k of the error of the step before, in all 1/(1 − 1/k) times its own.
    """
    order = min(math.ceil(1.0 - 0.6 * math.log(tolerance)), 20)
    assert series_pace.order_of(tolerance) == order
    run = sw.integrate(sw.system(order=1)(lambda t, y: y), "taylor", y=1.0, tolerance=tolerance, at=[5.0])
    reach = 0.01  # of the time in which y changes, to begin with
    for _ in range(int(run.paces.accepted) + 1):
        tolerated = tolerance * max(1.0, reach)
        reach = min((tolerated * math.factorial(k)) ** (1.0 / k) for k in (order - 1, order)) * math.exp(-0.7 / (order - 1))
    k = order - 1
    rough = (2.9e-5 * math.log(2.0) / (2 * k) + 3.5e-6) / (1.0 - 1.0 / k)
    assert abs(run.paces.h / reach - 1.0) < rough < 1e-5
    assert run.paces.evaluations == order * (run.paces.accepted + 1)  # the step with the saved time is held, not taken
    assert abs(run.y[-1] / math.exp(5.0) - 1.0) < (5.0 / reach + 1.0) * (2.0 * tolerance + 10 * EPS)


def test_rough_powers_and_logarithms() -> None:
    """As wrong as is said where they stand, on whole octaves, and exact where a step must not change: 2⁰ and log₂ 1."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-40.0, 40.0, 100_000)
    assert 1e-6 < np.max(abs(series_pace.rough_exp2(x) / np.exp2(x) - 1.0)) < 3.5e-6
    y = np.exp2(rng.uniform(-900.0, 900.0, 100_000))
    assert 1e-5 < np.max(abs(series_pace.rough_log2(y) - np.log2(y))) < 2.9e-5
    assert series_pace.rough_exp2(np.float64(0.0)) == 1.0
    assert series_pace.rough_log2(np.float64(1.0)) == 0.0


@looped("order", [4, 8, 12, 20])
def test_evaluations_are_operations_over_those_of_one_evaluation(order: int) -> None:
    """Of a linear system each order is its matrix once more: p evaluations.

    Of y·y, one product, the coefficient k has ⌊k/2⌋ + 1 different products and ⌊k/2⌋ sums of them; the older half of the
    coefficients is doubled. One evaluation for each order would be far too few.
    """
    for linear in (sw.Oscillator(1.3), sw.Oscillator(1.3, 0.2, form="physical")):
        assert engine.evaluations(TAYLOR, linear, order=order, paced=True) == order
    counted = sum(2 * (k // 2) + 1 for k in range(order)) + order // 2
    nonlinear = squared().for_state_shapes(None, np.zeros(()))
    assert engine.evaluations(TAYLOR, nonlinear, order=order, paced=True) == counted > order**2 / 2


def operations_of(tape: _core.Tape, values: list[Any]) -> int:
    """Operations on the state and on the time that these values are made of; a change of sign is none."""
    lines, _ = tape.operations(values)
    changes: list[bool] = []
    for name, operands, _more in lines:
        changes.append(name in ("state", "time", "sample") or any(changes[i] for i in operands))
    return sum(
        change and bool(operands) and name != "negate" and name != "sample"
        for change, (name, operands, _) in zip(changes, lines, strict=True)
    )


@looped("system", [sw.Pendulum(), sw.NBody([1.0, 0.5], force="newton"), sw.NBody(), sw.RestrictedThreeBody(0.1)])
def test_evaluations_counted_by_the_reference(system: sw.System) -> None:
    """Its operations but for the product that makes a coefficient of the state of one of the rates.

    That is the method's own, as the sums of stages are of other methods. The first is a product with 1, which is not on the tape.
    """
    tape = _core.Tape()
    tracer = Tracer(system, tape)
    v, y, _ = tracer.state()
    s, t = tracer.scaled(tape.step()), tape.time()
    rates = operations_of(tape, tracer.flat(s.dv(t, v, y), s.dy(t, v, y)))
    terms = [each for pair in series.coefficients(s, 8, t, tape.step(), v, y) for each in pair]
    every = operations_of(tape, tracer.flat(*terms)) - 7 * (v.size + y.size)
    evaluations = -(-every // rates)
    assert engine.evaluations(TAYLOR, system) == evaluations
    assert sw.stability.operations(TAYLOR, system).rate_evaluations == evaluations


def test_energy_at_rounding_level() -> None:
    """A hundred orbits of e = 0.5 at a tolerance of half a rounding: errors are roundings, which add up at random (Brouwer 1937).

    A step changes the energy by a few roundings of its largest part, the potential energy at the perihelion, here 2. With n steps
    the sum is some √n of these; 10·√n is allowed, and a drift of one rounding a step would be n.
    """
    y = np.array([[0.0, 0.0], [0.5, 0.0]])
    v = np.array([[0.0, 0.0], [0.0, math.sqrt(3.0)]])
    system = sw.NBody([1.0, 0.0], force="newton")
    run = sw.integrate(system, "taylor", v=v, y=y, tolerance=1e-16, at=2.0 * np.pi * np.arange(1, 101))
    speed, place = run.v[:, 1], run.y[:, 1]
    energy = 0.5 * (speed**2).sum(axis=1) - 1.0 / np.sqrt((place**2).sum(axis=1))
    assert np.abs(energy + 0.5).max() < 10 * math.sqrt(float(run.paces.accepted)) * 2 * EPS


def _growth_of_energy_errors(tolerance: float) -> tuple[float, float]:
    """The power of the time with which energy errors of the outer solar system grow: root mean squares of 64 turned systems.

    And the last of these, after 1600 years.
    """
    members, years = 64, np.array([25.0, 1600.0])
    rng = np.random.default_rng(1937)
    turns = np.linalg.qr(rng.normal(size=(members, 3, 3)))[0]
    v, y = (np.einsum("mij,bj->bim", turns, block) for block in solar.at_rest())
    run = sw.integrate(
        sw.NBody(solar.MASSES, force="newton", G=solar.G), "taylor", v=v, y=y, tolerance=tolerance, at=[*solar.YEAR * years]
    )
    assert not run.status.any()
    start = np.stack([solar.energy(v[None, ..., i], y[None, ..., i]) for i in range(members)], axis=-1)
    end = np.stack([solar.energy(run.v[..., i], run.y[..., i]) for i in range(members)], axis=-1)
    rms = np.sqrt(np.mean(((end - start) / start).astype(float) ** 2, axis=-1))
    return float(np.log(rms[1] / rms[0]) / np.log(years[1] / years[0])), float(rms[1])


def test_energy_errors_grow_as_the_square_root_of_the_time() -> None:
    """Of a walk at random (Brouwer 1937) the power is 1/2; of a bias, however small, it is 1 at last.

    A turned system has other roundings, so 64 of them are as many walks. A root mean square of n of them is known to
    1/√(2n) of itself, so the power between the two times, 64 apart, to √2/√(2n)/ln 64 = 0.03; four times that is allowed.

    Without compensated sums, and with coefficients multiplied by rounded reciprocals of k, the last was 4.6e-15; it is 2.5e-15,
    and known to a tenth.
    """
    power, last = _growth_of_energy_errors(2.0**-53)
    assert abs(power - 0.5) < 0.12
    assert last < 3.3e-15


@pytest.mark.mutant
def test_a_bias_of_the_energy_is_noticed() -> None:
    """At a tolerance at which the terms that are cut off count: these always err to the same side."""
    assert _growth_of_energy_errors(1e-7)[0] > 0.5 + 2 * 0.12


def test_motion_without_forces_is_exact_however_long_the_step() -> None:
    """All terms above the first vanish, so nothing but the growth of the step bounds it."""
    run = sw.integrate(sw.NBody([1.0]), "taylor", v=[[1.0, 2.0]], y=[[0.5, 0.0]], tolerance=1e-6, at=[1024.0])
    assert np.array_equal(run.y[-1], [[1024.5, 2048.0]])


PIECEWISE = "tolerance: .* chooses between values .*; use another method, such as dop853"
#: What is made of pieces, as rates of v.
PIECES: list[Callable[[Any, Any, Any], Any]] = [
    lambda t, v, y: np.where(y < 0.0, -100.0 * y, 0.0) - 1.0,
    lambda t, v, y: -np.ceil(t),
    lambda t, v, y: -np.floor(-y),
    lambda t, v, y: np.trunc(y),
    lambda t, v, y: np.rint(-y),
    lambda t, v, y: np.mod(t, 1.0),
    lambda t, v, y: np.remainder(y, 0.7),
    lambda t, v, y: (2.0 * y + t) % 1.5,
    lambda t, v, y: y // 1.0,
    lambda t, v, y: -np.sign(y),
    lambda t, v, y: np.copysign(1.0, -y),
    lambda t, v, y: (y > 0.0) * -1.0,
    lambda t, v, y: -np.maximum(y, 0.5),
    lambda t, v, y: -np.clip(y, -0.5, 0.5),
    lambda t, v, y: np.exp(-abs(y)),
]


def test_what_is_refused() -> None:
    state = np.random.default_rng(0).normal(size=(40, 2))

    def run(system: Any, **options: Any) -> sw.Run:
        return sw.integrate(system, "taylor", **{"v": 0.3, "y": 1.3} | options)

    paced: dict[str, Any] = {"tolerance": 1e-6, "at": [1.0]}
    wave, steps = sw.Oscillator(x=sw.Sinusoid(1.0, 1.0)), {"dt": 0.01, "steps": 3}
    too_long = r"about 633600 operations a step, and may have 100000; take dop853"
    assert_raises(
        (lambda: run(sw.Oscillator(x=sw.Sampled(np.arange(5.0), 0.1)), **paced), "samples of an input .* dop853"),
        (lambda: run(sw.Oscillator(), at=[1.0], tolerance=np.array([1e-3, 1e-9])), "one order for all members"),
        (lambda: run(wave, **steps, form="matrix"), "derivatives of inputs"),
        (lambda: run(sw.NBody(np.ones(40)), v=0.0 * state, y=state, **steps), too_long),
        *((lambda rates=rates: run(sw.system(rates), **paced), PIECEWISE) for rates in PIECES),
        kind=UnsupportedError,
    )
    assert run(sw.system(PIECES[0]), **steps).status == 0  # within a step the choice stays


@looped("absolute", [None, 0.0, np.array([1e-9, 1e-12])])
def test_tolerances_of_components(absolute: Any) -> None:
    """The least of a member chooses the order, which is that of a run with this for all; before they were refused as members'.

    ẏ₀ = y₁² − y₀, ẏ₁ = −3·y₁ from (1, 1): y₁ = e^(−3t), y₀ = (6·e^(−t) − e^(−6t))/5. Disturbances do not grow, so the error of
    y₁ is at most that of all steps, and that of y₀ twice that, for ∫2·y₁ < 1: twice what is estimated is allowed, tolerance·size
    in each of some steps.
    """
    decays = sw.system(order=1, shape=(2,))(lambda t, y: np.array([y[1] ** 2 - y[0], -3.0 * y[1]]))()
    relative = np.array([1e-4, 1e-9])
    tolerance = relative if absolute is None else (relative, absolute)
    run, by_reference = (
        sw.integrate(decays, "taylor", y=np.ones(2), tolerance=tolerance, at=[0.5, 1.0], backend=backend)
        for backend in ("rust", "numpy")
    )
    assert np.array_equal(run.y, by_reference.y)
    t = np.array([[0.5], [1.0]])
    exact = np.concatenate([(6.0 * np.exp(-t) - np.exp(-6.0 * t)) / 5.0, np.exp(-3.0 * t)], axis=1)
    assert (np.abs(run.y - exact) <= 4.0 * (run.paces.accepted + 1) * relative).all()

    first = sw.integrate(decays, "taylor", y=np.ones(2), tolerance=tolerance, at=[0.5])
    assert np.array_equal(sw.integrate(decays, "taylor", at=[1.0], resume=first).y[-1], run.y[-1])
    members = np.array([[1e-4, 1e-3], [1e-9, 1e-9]])
    assert sw.integrate(decays, "taylor", y=np.ones(2), tolerance=members, at=[1.0]).y.shape == (1, 2, 2)
    with pytest.raises(UnsupportedError, match=r"one order for all members.* got 1e-09 \(order 14\) to 1e-06 \(order 10\)"):
        sw.integrate(decays, "taylor", y=np.ones(2), tolerance=np.array([[1e-4, 1e-3], [1e-9, 1e-6]]), at=[1.0])


BY_TIME = {
    "doses": lambda t: sum(((t > 13.0 + 24.0 * k) & (t < 13.5 + 24.0 * k)) * 100.0 for k in range(10)),
    "ramp": lambda t: np.minimum(t, 5.0),
    "hours": lambda t: np.floor(np.sin(t) + t * t),  # which is not solved for the time
    "pulses": lambda t: t % 24.0,
    "drive": lambda t: np.where(np.cos(t) > 0.5, 1.0, 0.0),
}


@looped("name", BY_TIME)
def test_pieces_of_the_time_are_refused_with_fixed_steps(name: str) -> None:
    """Within a step they would not be seen; a World makes such steps, too. What the state chooses holds for a step."""
    system = sw.system(order=1)(lambda t, y: BY_TIME[name](t) - y)()
    with pytest.raises(UnsupportedError, match=r"dt: .* compares the time, or rounds it, .* such as dop853, whose steps end"):
        sw.integrate(system, "taylor", y=0.0, dt=1.0, steps=3)
    with pytest.raises(UnsupportedError, match=r"dt: .* compares the time"):
        sw.World(system, "taylor", y=np.zeros(1), dt=1.0)
    assert sw.integrate(system, "rk4", y=0.0, dt=1.0, steps=3).status == 0
    for smooth in (lambda t, y: np.tanh(t - 5.0) - abs(y), lambda t, y: np.exp(-((t - 5.0) ** 2)) - np.where(t > y, y, 2.0 * y)):
        assert sw.integrate(sw.system(order=1)(smooth), "taylor", y=0.5, dt=0.1, steps=3).status == 0


@looped("name", sorted({*FUNCTIONS} - {"abs"}))
def test_functions_are_no_pieces_however_they_are_signed(name: str) -> None:
    """Roundings and operations on bits within a function do not count, and its negative may be made of another one of them."""
    of_p = FUNCTIONS[name][0]

    def signed(t: Any, y: Any) -> Any:
        p = polynomial(t)
        return -of_p(p) + 0.0 * (0.0 - of_p(p)) + -1.0 * of_p(0.0 - (-p)) + 0.0 * y

    assert not sw.system(order=1)(signed)().for_state_shapes(None, np.zeros(())).chooses


#: Rates of motions that end in a singularity from y = 1 and v = 0, of first or of second order, and when.
ENDS: dict[str, tuple[Callable[..., Any], float]] = {
    "collision": (lambda t, v, y: -(y**-2), math.pi / math.sqrt(8.0)),
    "steep collision": (lambda t, v, y: -(y**-3), 1.0),
    "far from zero": (lambda t, v, y: -((y - 0.5) ** -2), 0.5**1.5 * math.pi / math.sqrt(8.0)),
    "soft collision": (lambda t, v, y: -(y**-1), math.sqrt(math.pi / 2.0)),
    "root": (lambda t, y: -0.5 * y**-1, 1.0),
    "cube root": (lambda t, y: -(y**-2), 1.0 / 3.0),
    "two thirds": (lambda t, y: -(y**-0.5), 2.0 / 3.0),
    "pole": (lambda t, y: y**2, 1.0),
    "double pole": (lambda t, y: y**1.5, 2.0),
    "root of a pole": (lambda t, y: y**3, 0.5),
    "pole of the time": (lambda t, y: 1.0 / (1.7 - 0.6 * t) ** 2, 1.7 / 0.6),
}


@looped("name, tolerance", itertools.product(ENDS, [1e-2, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15]))
def test_no_step_crosses_a_singularity(name: str, tolerance: float) -> None:
    """However small the last terms are there, and though coefficients pass all bounds of numbers.

    Each of n steps errs by less than 2τ of the largest length so far, which is 1 before the motion is fast; the time of the end
    changes by at most twice the relative error (T ~ y² of a root, y^1.5 of a collision): 4nτ, and n roundings.
    """
    rates, end = ENDS[name]
    order = rates.__code__.co_argcount - 1
    start = {"y": 1.0} | ({"v": 0.0} if order == 2 else {})
    with pytest.warns(ToleranceWarning, match=r"stopped before t = 50, at t = .*(too small to move the time|finite)"):
        run = sw.integrate(sw.system(order=order)(rates), "taylor", **start, tolerance=tolerance, at=[50.0])
    assert run.status != 0
    assert np.isnan(run.y[-1])
    steps = float(run.paces.accepted)
    assert steps < 300
    assert abs(float(run.paces.t) / end - 1.0) < 4.0 * steps * (tolerance + EPS)


@looped("tolerance, sign", itertools.product([1e-3, 1e-6, 1e-9, 1e-12], [1.0, -1.0]))
def test_one_singular_component_among_others_ends_the_run(tolerance: float, sign: float) -> None:
    """Components that are larger and move smoothly hide no pole of another, forward or backward in time: as above, 4nτ."""
    among_others = sw.system(order=1)(lambda t, y: sign * np.stack([-0.5 / y[0], 1e3 * np.cos(2.0 * t), -0.3 * y[2]]))
    with pytest.warns(ToleranceWarning, match=r"too small to move the time"):
        run = sw.integrate(among_others(), "taylor", y=[1.0, 0.0, 1.0], tolerance=tolerance, at=[sign * 1.5])
    assert run.status != 0
    steps = float(run.paces.accepted)
    assert abs(abs(float(run.paces.t)) - 1.0) < 4.0 * steps * (tolerance + EPS)


@looped("tolerance", [1e-3, 1e-9])
def test_steps_end_at_jumps_and_at_branches(tolerance: float) -> None:
    """ẏ = |t − 1.3| has the integral (t − 1.3)·|t − 1.3|/2; no step crosses 0.9 and 2.1, nor goes on behind 1.3 as before."""
    kinked = sw.system(order=1)(lambda t, y: np.sqrt((t - 1.3) ** 2) + 0.0 * y)
    at = np.array([0.5, 1.0, 1.5, 3.0])
    run = sw.integrate(kinked, "taylor", y=1.0, tolerance=tolerance, at=at, jumps=[0.9, 2.1])
    assert run.status == 0
    true = 1.0 + 0.5 * ((at - 1.3) * np.abs(at - 1.3) + 1.3**2)
    # Each of n steps errs by less than 2τ of the largest length.
    assert np.max(np.abs(run.y - true)) < 2.0 * tolerance * true.max() * float(run.paces.accepted)


@looped("tolerance, offset", itertools.product([1e-3, 1e-9, 1e-15], [0.0, 1e3]))
def test_bodies_that_collide_head_on_stop(tolerance: float, offset: float) -> None:
    """Two of mass 1 at rest at distance 1: they meet after π/√16, and neither passes through the other."""
    y = np.array([[-0.5, offset], [0.5, offset]])
    with pytest.warns(ToleranceWarning, match=r"a collision"):
        run = sw.integrate(sw.NBody([1.0, 1.0], force="newton"), "taylor", v=0.0 * y, y=y, tolerance=tolerance, at=[3.0])
    # As above, with the tolerance relative to the length of y, 1 or more.
    size = max(1.0, math.sqrt(2.0) * offset)
    assert abs(float(run.paces.t) / (math.pi / 4.0) - 1.0) < 4.0 * float(run.paces.accepted) * size * (tolerance + EPS)


@looped("octaves", [-200, -40, 300])
def test_steps_do_not_depend_on_the_unit_of_time(octaves: int) -> None:
    """A unit that is a power of two changes no bit of y, though the coefficients of order 20 differ by 2⁶⁰⁰⁰."""
    unit = 2.0**octaves
    oval = sw.system(order=1)(lambda t, y, *, rate=1.0: rate * np.stack([y[1] / np.sqrt(1.0 + y[0] * y[0]), -y[0]]))
    ask: dict[str, Any] = {"y": [1.0, 0.0], "tolerance": 1e-15}
    plain, scaled = (sw.integrate(oval(rate=1.0 / u), "taylor", at=[5.0 * u, 20.0 * u], **ask) for u in (1.0, unit))
    assert np.array_equal(plain.y, scaled.y)
    assert plain.paces.accepted == scaled.paces.accepted > 20
    assert plain.paces.h * unit == scaled.paces.h


#: Rates that are smooth along a solution although they change their branch: as a series goes on they would be others.
BRANCHED: dict[str, Callable[[Any, Any, Any], Any]] = {
    "root of a square": lambda t, v, y: -np.sqrt(y**2),
    "hypot": lambda t, v, y: -np.hypot(y, 0),
    "norm": lambda t, v, y: -np.linalg.norm(np.stack([y, 0.0 * y])),
    "sign by a root": lambda t, v, y: -y / np.sqrt(y * y),
    "cut of arctan2": lambda t, v, y: np.arctan2(np.sin(3.0 * t), np.cos(3.0 * t)),
    "two zeros in a step": lambda t, v, y: -np.sqrt(((t - 2.0) ** 2 - 0.01) ** 2),
}


@looped("name, tolerance", itertools.product(BRANCHED, [1e-3, 1e-6, 1e-9]))
def test_a_step_does_not_leave_a_branch(name: str, tolerance: float) -> None:
    """|y| as a root, and others: as right as the tolerance says.

    Each of n steps errs by less than 2τ of the largest length, 7, as does each change of branch, which is made in a step whose
    whole motion is within the tolerance. Of ÿ = −|y| an error grows less than ÿ = y makes it, in 4 units of time by cosh 4 = 27.
    """
    rates = sw.system(BRANCHED[name])
    run = sw.integrate(rates, "taylor", v=0.3, y=1.3, tolerance=tolerance, at=[4.0])
    true = sw.integrate(rates, "dop853", v=0.3, y=1.3, tolerance=1e-13, at=[4.0])
    assert run.status == 0
    assert run.paces.rejected > 0
    error = max(abs(float(run.v[-1] - true.v[-1])), abs(float(run.y[-1] - true.y[-1])))
    assert error < 2.0 * tolerance * 7.0 * 27.0 * (float(run.paces.accepted) + 1.0)
    assert error < 10.0 * tolerance  # and in fact: such errors do not all add up


@looped(
    "pair, tolerance",
    itertools.product([(np.arcsin, np.sin), (np.arccos, np.cos), (np.arctan, np.tan)], [1e-3, 1e-6, 1e-9, 1e-12]),
)
def test_a_branch_that_ends_at_a_rounding_is_right_or_said(pair: Any, tolerance: float) -> None:
    """Within 1e-8 of its turns a sine is rounded to ±1, where the inverse has no derivative and its next step no order.

    A tangent has a pole. Runs that go on end at sizes of up to 11.
    """
    rates = sw.system(lambda t, v, y: -pair[0](pair[1](2.0 * y)))
    run = quiet(rates, "taylor", v=0.3, y=1.3, tolerance=tolerance, at=[4.0])
    true = sw.integrate(rates, "dop853", v=0.3, y=1.3, tolerance=1e-13, at=[4.0])
    assert run.status != 0 or abs(run.y[-1] - true.y[-1]) < 10.0 * tolerance * max(1.0, abs(true.y[-1]))


def test_batches_are_those_of_the_reference() -> None:
    """Steps that fail at branches, and saved states within those that follow; steps that overflow and are tried again alike."""
    # The sign of a NaN, which is not the same everywhere, decides nothing.
    kinked = sw.system(lambda t, v, y: -np.hypot(y, 0.1 * v) - np.sqrt((y - 0.2) ** 2) + np.arctan2(v, y))
    paced: dict[str, Any] = {"tolerance": 1e-6, "ways": ("by the reference",)}
    run = assert_equal_ways(kinked, "taylor", v=0.3, y=np.linspace(0.5, 1.5, 9), at=np.linspace(0.1, 3.0, 40), **paced)
    assert run.paces.rejected.min() > 0
    rng = np.random.default_rng(0)
    y, v = rng.normal(size=(3, 20)), rng.normal(size=(3, 20)) * 10.0 ** rng.uniform(150, 160, 20)
    run = assert_equal_ways(sw.Pendulum3D(), "taylor", v=v, y=y, at=[1.0], max_steps=50, **paced)
    assert (run.paces.rejected > 5).any()


def test_tame_motions_meet_no_bound() -> None:
    """No step of these is rejected, at any tolerance; and from 1e-4 on none is shorter than by the tolerance alone."""
    eight = sw.scenes.figure_eight()
    arguments: list[tuple[sw.System, Any, Any]] = [
        (eight.system, eight.v, eight.y),
        (sw.Pendulum(), 0.0, 2.5),
        (sw.NBody([1.0, 0.0], force="newton"), [[0.0, 0.0], [0.0, math.sqrt(199.0)]], [[0.0, 0.0], [0.01, 0.0]]),
    ]
    for (system, v, y), tolerance in itertools.product(arguments, (1e-2, 1e-3, 1e-4, 1e-9, 1e-15)):
        run = sw.integrate(system, "taylor", v=v, y=y, tolerance=tolerance, at=[6.2])
        assert run.status == run.paces.rejected == 0


def three_bodies(members: int) -> dict[str, Any]:
    rng = np.random.default_rng(3)
    return {"v": rng.normal(size=(3, 2, members)), "y": 2.0 * rng.normal(size=(3, 2, members))}


@looped("control, fused", [(None, True), (sw.Projection(), False)])
def test_many_saved_states_of_a_batch_are_those_of_the_reference(control: Any, fused: bool) -> None:
    """Several within a step, and steps without any; a projection acts on the saved states, too, and counts its work once."""
    bodies = sw.NBody([1.0, 0.5, 0.2], force="newton", softening=0.1)
    ask: dict[str, Any] = three_bodies(5) | {"tolerance": 1e-4, "control": control, "fused": fused}
    ask["at"] = np.sort(np.random.default_rng(5).uniform(0.0, 1.0, 9))
    ours = assert_equal_ways(bodies, "taylor", **ask, ways=("by the reference", "alone"))
    if control is not None:
        assert np.array_equal(ours.work, sw.integrate(bodies, "taylor", **ask, backend="numpy").work)


@looped("own, backward", [(False, False), (True, False), (False, True)])
def test_states_within_steps_are_those_of_the_reference(own: bool, backward: bool) -> None:
    """Of each step none, one, or more than the core sums at once; at its ends, at jumps; each member at its own times."""
    sign, duffing = -1.0 if backward else 1.0, sw.system(lambda t, v, y: y - y**3 - 0.1 * v + np.cos(t))
    ask: dict[str, Any] = {"v": 0.0, "y": np.linspace(0.5, 1.5, 20), "tolerance": 1e-8, "jumps": [sign * 0.7]}
    ends = sw.integrate(duffing, "taylor", at=[sign * 1.2], every=1, max_steps=99, **ask).t[:, 0]
    ends = ends[(sign * ends > 0.0) & (sign * ends < 1.2)]
    at = np.concatenate([np.linspace(0.0, 0.6, 70), [0.7, 0.8], sign * ends, np.linspace(1.0, 1.2, 60), [6.0, 9.0]])
    at = sign * np.unique(at)
    counts = np.histogram(sign * at, np.sort(sign * ends))[0]
    assert counts.max() > 16
    if own:
        at = np.linspace(0.5, 1.0, 20) * at[:, np.newaxis]
    run = assert_equal_ways(duffing, "taylor", at=at, **ask, ways=("by the reference", "alone", "in pieces"))
    assert run.paces.rejected.max() == 0


def test_a_run_that_goes_on_finds_the_coefficients_of_its_held_step_again() -> None:
    bodies, at = sw.NBody([1.0, 0.5, 0.2], force="newton", softening=0.1), np.linspace(0.02, 3.0, 60)
    whole = sw.integrate(bodies, "taylor", **three_bodies(20), tolerance=1e-8, at=at)
    done, state = 0, three_bodies(20) | {"tolerance": 1e-8}
    for until in (1, 2, 3, 11, 30, 60):
        run = sw.integrate(bodies, "taylor", at=at[done:until], **state)
        assert np.array_equal(run.y, whole.y[done:until])
        done, state = until, {"resume": run}
    assert all(np.array_equal(a, b) for a, b in zip(run.paces, whole.paces, strict=True))


@looped("angle, tolerance", itertools.product([np.pi / 2, np.pi / 3, 1.0, 3.0], [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8]))
def test_coefficients_that_vanish_by_chance_are_not_believed(angle: float, tolerance: float) -> None:
    """At a right angle the series of a pendulum has every fourth term alone; for some orders the last two are not among them.

    The first step was then as long as a period, and the pendulum ended at 1e5 rad. Some tens of steps may each change the energy
    by some tolerances of the largest v and y, whose energy is about 1: by a thousand tolerances in all, or a hundredth.
    """
    run = sw.integrate(sw.Pendulum(1.0), "taylor", v=0.0, y=angle, tolerance=tolerance, at=[22.0])
    assert run.energy[-1] == pytest.approx(1.0 - np.cos(angle), abs=min(0.01, 1000.0 * tolerance))
