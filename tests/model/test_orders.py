"""The order that each method declares is the one that it has: on linear, driven and nonlinear systems, in both blocks."""

from __future__ import annotations

import itertools
import math
import operator
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from support.for_each import for_each
from support.trees import Tree, density, trees

TABLEAUX = [m for m in sw.methods() if hasattr(m.steps, "ROWS")]
#: Sixteen digits show orders up to 4: of higher ones the error is rounding before its first power rules. The conditions of order
#: show those of tableaux. That of a series is in ``test_taylor.py``: it takes fewer and longer steps than these tests make.
METHODS = [m for m in sw.methods() if m.order <= 4 or not (m in TABLEAUX or m.has_series)]


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
    masses = rng.uniform(0.2, 1.0, 5)
    return sw.NBody(masses, force="newton", softening=0.5), 0.4 * rng.normal(size=(5, 3)), rng.normal(size=(5, 3))


def two_rods(control: sw.Projection | None = None) -> tuple[sw.System, Any, Any]:
    """A double pendulum, its velocities along circles."""
    rods = sw.Rods([1.0, 0.5], [((0.0, 0.0), 0), (0, 1)], 1.0)
    v, y = np.array([[[0.4, 0.3], [0.1, 0.7]], [[0.6, -0.8], [1.4, -0.2]]])
    return rods if control is None else rods.under(control, ()), v, y


TORQUES: list[Any] = [[0.1, sw.Sinusoid(0.8, 2.1, 0.3), None], [None, 0.3, 0.2]]
#: System, start, and end time: no whole or half period, at which an error might vanish.
PROBLEMS: dict[str, tuple[sw.System, Any, Any, float]] = {
    "oscillator": (sw.Oscillator(1.3), 0.4, 1.0, 2.3),
    "damped": (sw.Oscillator(1.3, 0.2, form="physical"), 0.4, 1.0, 2.3),
    "forced": (sw.Oscillator(1.3, a=sw.Sinusoid(0.8, 2.1, 0.3), form="physical"), 0.4, 1.0, 2.3),
    "forced and damped": (sw.Oscillator(1.3, 0.2, x=sw.Sinusoid(0.8, 2.1, 0.3)), -0.7, 0.5, 2.9),
    "pendulum": (sw.Pendulum(1.3, a=sw.Sinusoid(0.8, 2.1, 0.3)), 0.4, 1.5, 2.9),
    "turning frame": (sw.RestrictedThreeBody(0.1), np.array([0.1, 0.9]), np.array([0.7, 0.3]), 1.1),
    "rigid body": (sw.RigidBody([1.0, 1.4, 2.0], *TORQUES, 0.2), [0.7, 1.0, -0.4], [0.5, 0.1, -0.7, 0.5], 1.7),
    "heavy top": (sw.RigidBody([1.0, 1.2, 1.9], weight=1.5, centre=[0.1, 0.2, 0.8]), [0.7, 0.3, 1.4], [0.8, 0.6, 0, 0], 1.7),
    "chain": (sw.Chain(4), np.linspace(0.1, 0.5, 4), np.linspace(-1.0, 0.5, 4) ** 2, 2.3),
    "ellipse": (sw.NBody([1.0, 0.5], force="newton"), [[0.0, -0.3], [0.0, 0.6]], [[-0.4, 0.0], [0.8, 0.1]], 2.3),
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


# ---- of explicit tableaux every condition of order, by their numbers as they are

#: Numbers of a tableau are whole multiples of 1/WHOLE, and products of p of them of 1/WHOLEᵖ.
WHOLE = 1 << 120


def whole(numbers: Any) -> list[int]:
    exact = [Fraction(number) * WHOLE for number in numbers]
    assert all(each.denominator == 1 for each in exact)
    return [int(each) for each in exact]


class Conditions:
    """The conditions of order of an explicit tableau: of each tree a sum, over the stages, of products of as many numbers."""

    def __init__(self, rows: Any, weights: Any) -> None:
        self.rows, self.weights = [whole(row) for row in rows], whole(weights)
        self.found: dict[Tree, list[int]] = {}

    def stages(self, tree: Tree) -> list[int]:
        """Of each stage the product, over what hangs from the root, of the sums over the stages before it."""
        if tree not in self.found:
            branches = [self.stages(branch) for branch in tree]
            self.found[tree] = [math.prod(sum(map(operator.mul, row, branch)) for branch in branches) for row in self.rows]
        return self.found[tree]

    def of(self, tree: Tree) -> int:
        """The sum for the result: 1 over the density of the tree if it has that order."""
        return sum(map(operator.mul, self.weights, self.stages(tree)))


def order_of(steps: Any, weights: Any, exact: int = 1) -> int:
    """The order of the result of these weights, or with ``exact`` 0 the one up to which an estimate vanishes.

    A condition of order p is a sum of products of p numbers. Each is rounded by a part of 2⁻⁵³ at most, so the sum is off by no
    more than p·2⁻⁵³ times that of the sizes. The first that does not hold is off by a million times that.
    """
    numbers, sizes = Conditions(steps.ROWS, weights), Conditions([map(abs, row) for row in steps.ROWS], map(abs, weights))
    for order in itertools.count(1):
        ratios = []
        for tree in trees(order):
            off, rounding = abs(numbers.of(tree) * density(tree) - exact * WHOLE**order), order * sizes.of(tree) * density(tree)
            ratios.append(float(Fraction(off << 53, rounding)) if rounding else math.inf if off else 0.0)
        if max(ratios) > 1.0:
            assert max(ratios) > 1e6
            return order - 1
    raise AssertionError


#: The order up to which the estimate vanishes, where it is not the one below that of the record: Merson's is one of fifth order
#: for linear equations alone, and DOP853 has two, which together are as one of eighth.
ESTIMATED = {"merson": 3, "dop853": 5}


@for_each("method", TABLEAUX)
def test_a_tableau_has_the_declared_order(method: sw.Method) -> None:
    """Result and estimate satisfy all conditions of their orders and not all of the next. Nodes are the sums of the rows."""
    assert [len(trees(p)) for p in range(1, 11)] == [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]
    steps, order = method.steps, method.error_order
    assert order is not None
    assert order_of(steps, steps.WEIGHTS) == method.order
    assert order_of(steps, steps.ERROR, 0) == ESTIMATED.get(method.name, order - 1)
    if method.name == "dop853":
        assert order_of(steps, steps.COARSE, 0) == 3
    for node, row in zip(steps.NODES, steps.ROWS, strict=True):
        assert abs(Fraction(node) - sum(map(Fraction, row))) <= 2.0**-53 * (node + sum(map(abs, row)))
