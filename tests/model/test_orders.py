"""The order that each method declares is the one that it has: on linear, driven and nonlinear systems, in both blocks."""

from __future__ import annotations

import decimal
import itertools
from collections.abc import Callable, Iterator
from decimal import Decimal
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from stepwell.reference import tableau
from support import dop853
from support.for_each import for_each

#: Sixteen digits show orders up to 5: of higher ones the error is rounding before its first power rules.
METHODS = [m for m in sw.methods() if m.order <= 5]
HIGH = {"dop853": dop853}


#: By how much the masses of ``fading`` fall at the start, in their own units per unit of time.
LOSS = 0.2
FADING_MASSES = np.array([0.5, 0.3, 0.2])


@sw.system
def fading(t: Any, v: Any, y: Any, *, masses: Any = FADING_MASSES, loss: Any = LOSS) -> Any:
    """Bodies under Newton's law whose masses are m/(1 + loss·t)."""
    rates = []
    for i in range(len(masses)):
        rate = 0.0 * y[i]
        for j in range(len(masses)):
            if i != j:
                d = y[j] - y[i]
                r2 = d[0] * d[0] + d[1] * d[1]
                rate = rate + (masses[j] / (1.0 + loss * t)) * d / (r2 * np.sqrt(r2))
        rates.append(rate)
    return np.stack(rates)


def fading_orbit(t: float) -> tuple[Any, Any]:
    """Lagrange's triangle with a side of 1, of which s = 1 + loss·t is the length at time t.

    With y = s·ρ and dτ = dt/s² Newton's equations with masses m/s are those of ρ in τ with masses m (Meshchersky 1893):
    ÿ = ρ''/s³, and the force is (1/s)·(1/s²) of that of ρ. There the triangle turns by ω = √(Σm/1³) = 1, and τ = t/s.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    rho = corners - FADING_MASSES @ corners
    s = 1.0 + LOSS * t
    turn = np.array([[np.cos(t / s), -np.sin(t / s)], [np.sin(t / s), np.cos(t / s)]])
    aside = np.array([[0.0, -1.0], [1.0, 0.0]])
    y = rho @ turn.T
    return LOSS * y + (y @ aside.T) / s, s * y


def five_bodies() -> tuple[sw.System, Any, Any]:
    rng = np.random.default_rng(8)
    return (
        sw.NBody(rng.uniform(0.2, 1.0, 5), force="newton", softening=0.5),
        0.4 * rng.normal(size=(5, 3)),
        rng.normal(size=(5, 3)),
    )


def two_rods(control: sw.Projection | None = None) -> tuple[sw.System, Any, Any]:
    """A double pendulum, its velocities along circles."""
    rods = sw.Rods([1.0, 0.5], [((0.0, 0.0), 0), (0, 1)], 1.0)
    y = np.array([[0.6, -0.8], [1.4, -0.2]])
    v = np.array([[0.4, 0.3], [0.1, 0.7]])
    return rods if control is None else rods.under(control, ()), v, y


#: System, start, and end time: no whole or half period, at which an error might vanish.
PROBLEMS: dict[str, tuple[sw.System, Any, Any, float]] = {
    "oscillator": (sw.Oscillator(1.3), 0.4, 1.0, 2.3),
    "damped": (sw.Oscillator(1.3, 0.2, form="physical"), 0.4, 1.0, 2.3),
    "forced": (sw.Oscillator(1.3, a=sw.Sinusoid(0.8, 2.1, 0.3), form="physical"), 0.4, 1.0, 2.3),
    "forced and damped": (sw.Oscillator(1.3, 0.2, x=sw.Sinusoid(0.8, 2.1, 0.3)), -0.7, 0.5, 2.9),
    "pendulum": (sw.Pendulum(1.3, a=sw.Sinusoid(0.8, 2.1, 0.3)), 0.4, 1.5, 2.9),
    "turning frame": (sw.RestrictedThreeBody(0.1), np.array([0.1, 0.9]), np.array([0.7, 0.3]), 1.1),
    "rigid body": (
        sw.RigidBody([1.0, 1.4, 2.0], [0.1, sw.Sinusoid(0.8, 2.1, 0.3), None], [None, 0.3, 0.2], 0.2),
        np.array([0.7, 1.0, -0.4]),
        np.array([0.5, 0.1, -0.7, 0.5]),
        1.7,
    ),
    "heavy top": (
        sw.RigidBody([1.0, 1.2, 1.9], weight=1.5, centre=[0.1, 0.2, 0.8]),
        np.array([0.7, 0.3, 1.4]),
        np.array([0.8, 0.6, 0.0, 0.0]),
        1.7,
    ),
    "chain": (sw.Chain(4), np.linspace(0.1, 0.5, 4), np.linspace(-1.0, 0.5, 4) ** 2, 2.3),
    "ellipse": (
        sw.NBody([1.0, 0.5], force="newton"),
        np.array([[0.0, -0.3], [0.0, 0.6]]),
        np.array([[-0.4, 0.0], [0.8, 0.1]]),
        2.3,
    ),
    "clover": (sw.scenes.clover().system, 0.9 * sw.scenes.clover().v, sw.scenes.clover().y, 1.7),
    "five bodies": (*five_bodies(), 1.1),
    "two rods": (*two_rods(), 1.3),
    "two rods, lengths reset": (*two_rods(sw.Projection("length")), 1.6),
}


@cache
def ends(name: str, method: str, steps: int) -> tuple[Any, Any]:
    system, v, y, end = PROBLEMS[name]
    run = sw.integrate(system, method, v=v, y=y, dt=end / steps, steps=steps)
    return run.v[-1], run.y[-1]


@pytest.mark.filterwarnings("ignore:the run has another energy")
@pytest.mark.parametrize("name", PROBLEMS)
@for_each("method", METHODS)
def test_the_order_is_the_declared_one(name: str, method: sw.Method) -> None:
    """Halving the step divides the error of v and that of y by 2ᵖ.

    E(h) = C·hᵖ + D·hᵖ⁺¹ + …, vectors. Fehlberg's C is so small that the next power rules until rounding does. So that power is
    taken away first: F(h) = 2ᵖ⁺¹·E(h/2) − E(h) = C·hᵖ + O(hᵖ⁺²). Were the order lower than declared, F would have that lower one.
    The slope of F is taken at the shortest steps at which rounding, some 1e-16 in each of some hundred steps, times 2ᵖ⁺¹, is a
    few per cent of it.
    """
    true = ends(name, "fehlberg_5", 20_000)
    if (name, method.name) == ("ellipse", "wisdom_holman"):  # two bodies alone, on Kepler's orbit, in one step
        assert max(np.abs(end - exact).max() for end, exact in zip(ends(name, method.name, 1), true, strict=True)) < 1e-12
        return
    try:
        ends(name, method.name, 4)
    except UnsupportedError:
        assert method.needs_acceleration
        return
    p = method.order
    slopes: list[float] = []
    first, least = (1, 2e-10) if method.name == "rodas5p" else (3, 2e-12)
    for v_or_y in (0, 1):
        errors = [ends(name, method.name, 2**k)[v_or_y] - true[v_or_y] for k in range(first, 17 - p)]
        cleaned = [np.linalg.norm(np.atleast_1d(2 ** (p + 1) * fine - coarse)) for coarse, fine in itertools.pairwise(errors)]
        usable = [size for size in cleaned if size > least * 2**p]
        slopes.append(float(np.log2(usable[-2] / usable[-1])))
    if method.name == "rodas5p":  # two powers above the fifth rule here until rounding does; its own conditions: test_stiff.py
        assert min(slopes) > p - 0.2
        return
    assert slopes == pytest.approx([p, p], abs=0.1)


def test_bodies_that_lose_mass_move_as_derived() -> None:
    """The formula is that of the equations: rounding of some thousand steps is left."""
    for method in ("fehlberg_5", "dop853"):
        for steps, bound in ((40, 1e-3), (4000, 1e-12)):
            v, y = fading_orbit(2.3)
            run = sw.integrate(fading(), method, v=fading_orbit(0.0)[0], y=fading_orbit(0.0)[1], dt=2.3 / steps, steps=steps)
            assert max(np.abs(run.v[-1] - v).max(), np.abs(run.y[-1] - y).max()) < bound
    # With masses that stay, or that fall at another rate, it is another motion.
    for loss in (0.0, 0.25):
        run = sw.integrate(fading(loss=loss), "dop853", v=fading_orbit(0.0)[0], y=fading_orbit(0.0)[1], dt=0.01, steps=230)
        assert np.abs(run.y[-1] - y).max() > 0.01


@for_each("method", METHODS)
def test_the_order_on_bodies_that_lose_mass_by_the_formula(method: sw.Method) -> None:
    """Halving the step divides the error by 2ᵖ: a force at a time that is wrong by a share of a step makes it 1."""
    v, y = fading_orbit(2.3)
    errors = []
    for steps in [64, 128, 256] if method.order < 4 else [16, 32, 64]:
        run = sw.integrate(fading(), method, v=fading_orbit(0.0)[0], y=fading_orbit(0.0)[1], dt=2.3 / steps, steps=steps)
        errors.append(np.hypot(np.linalg.norm(run.v[-1] - v), np.linalg.norm(run.y[-1] - y)))
    slopes = [float(np.log2(a / b)) for a, b in itertools.pairwise(errors)]
    # The slope approaches the order like h.
    assert 2 * slopes[1] - slopes[0] == pytest.approx(method.order, abs=0.25)


def test_a_force_at_the_time_of_the_start_is_of_first_order() -> None:
    """So the test above can fail: Runge-Kutta 4 whose stages take the masses of the start of the step."""
    v, y = fading_orbit(2.3)
    system = fading().for_state_shapes(*fading_orbit(0.0))

    class Frozen:
        def __init__(self, h: float) -> None:
            self.s, self.now = system.reference_at_step(h, ()), 0.0

        def dv(self, t: float, v: Any, y: Any) -> Any:
            return self.s.dv(self.now, v, y)

        def dy(self, t: float, v: Any, y: Any) -> Any:
            return self.s.dy(self.now, v, y)

    errors = []
    for steps in (64, 128):
        h, (w, x) = 2.3 / steps, fading_orbit(0.0)
        s: Any = Frozen(h)
        for k in range(steps):
            s.now = k * h
            w, x = sw.method("rk4").steps.step(s, k * h, h, w, x)
        errors.append(np.linalg.norm(x - y) + np.linalg.norm(w - v))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


# ---- orders above 5, in 50 digits


@pytest.fixture
def fifty_digits() -> Iterator[None]:
    with decimal.localcontext(prec=50):
        yield


def sine(x: Decimal) -> Decimal:
    total, term, k = Decimal(0), x, 1
    while abs(term) > Decimal("1e-50"):
        total += term
        term = -term * x * x / ((k + 1) * (k + 2))
        k += 2
    return total


def spring(t: Decimal, v: Any, y: Any) -> Any:
    return -Decimal("1.69") * y - Decimal("0.4") * v


def pushed(t: Decimal, v: Any, y: Any) -> Any:
    return -Decimal("1.69") * y + Decimal("0.8") * sine(Decimal("2.1") * t + Decimal("0.3"))


def pendulum(t: Decimal, v: Any, y: Any) -> Any:
    return np.array([-sine(angle) for angle in y])


def ellipse(t: Decimal, v: Any, y: Any) -> Any:
    r2 = y[0] * y[0] + y[1] * y[1]
    return -y / (r2 * r2.sqrt())


def losing_mass(t: Decimal, v: Any, y: Any) -> Any:
    return ellipse(t, v, y) / (1 + t / 5)


class Scaled:
    """A system of second order, scaled to a step, on numbers of any kind."""

    def __init__(self, rate: Callable[[Decimal, Any, Any], Any], h: Decimal) -> None:
        self.rate, self.h = rate, h

    def dv(self, t: Decimal, v: Any, y: Any) -> Any:
        return self.h * self.rate(t, v, y)

    def dy(self, t: Decimal, v: Any, y: Any) -> Any:
        return self.h * v


def high_end(method: ModuleType, rate: Any, steps: int) -> tuple[Any, Any]:
    v, y = np.array([Decimal("0.4"), Decimal("0.9")]), np.array([Decimal("1.1"), Decimal("0.2")])
    h = Decimal(1) / steps
    s: Any = Scaled(rate, h)
    for k in range(steps):
        increments = tableau.stages(method.NODES, method.ROWS, s, k * h, h, v, y)  # type: ignore[arg-type]
        v, y = tableau.plus(v, y, method.WEIGHTS, increments)
    return v, y


@pytest.mark.usefixtures("fifty_digits")
@for_each("rate", [spring, pushed, pendulum, ellipse, losing_mass])
@for_each("name", HIGH)
def test_a_high_order_is_the_declared_one(name: str, rate: Any) -> None:
    """Halving the step divides what a halving still changes by 2ᵖ, in both blocks; the next power leaves half each time."""
    ends = [high_end(HIGH[name], rate, steps) for steps in (8, 16, 32, 64, 128)]
    for block in (0, 1):
        changes = [float(sum(d * d for d in fine[block] - coarse[block]).sqrt()) for coarse, fine in itertools.pairwise(ends)]
        first, second = np.log2(changes[1] / changes[2]), np.log2(changes[2] / changes[3])
        assert 2 * second - first == pytest.approx(sw.method(name).order, abs=0.1)


@pytest.mark.usefixtures("fifty_digits")
@pytest.mark.parametrize("name", HIGH)
def test_the_tableau_is_the_printed_one(name: str) -> None:
    """Every number of it, rounded once. Its nodes are the sums of its rows, and a step without rates stays where it is."""
    printed, ours = HIGH[name], sw.method(name).steps
    for part in ("NODES", "WEIGHTS", "ERROR"):
        assert getattr(ours, part) == tuple(map(float, getattr(printed, part))), part
    assert tuple(tuple(map(float, row)) for row in printed.ROWS) == ours.ROWS
    assert tuple(float(a - b) for a, b in zip(printed.WEIGHTS, printed.LOWER, strict=True)) == ours.COARSE
    for node, row in zip(printed.NODES, printed.ROWS, strict=True):
        assert abs(sum(row) - node) < Decimal("1e-27")
    assert abs(sum(printed.WEIGHTS) - 1) < Decimal("1e-27")


def test_every_method_has_its_order_measured() -> None:
    """That of a series is in ``test_taylor.py``: of order 8, it takes fewer and longer steps than these tests make."""
    series = {m.name for m in sw.methods() if m.has_series}
    assert {m.name for m in METHODS} | set(HIGH) | series == {m.name for m in sw.methods()}
