"""The order that each method declares is the one that it has: on linear, driven and nonlinear systems, in both blocks."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError

METHODS = sw.methods()


def five_bodies() -> tuple[sw.System, Any, Any]:
    rng = np.random.default_rng(8)
    return (
        sw.NBody(rng.uniform(0.2, 1.0, 5), force="newton", softening=0.5),
        0.4 * rng.normal(size=(5, 3)),
        rng.normal(size=(5, 3)),
    )


#: System, start, and end time: no whole or half period, at which an error might vanish.
PROBLEMS: dict[str, tuple[sw.System, Any, Any, float]] = {
    "oscillator": (sw.Oscillator(1.3), 0.4, 1.0, 2.3),
    "damped": (sw.Oscillator(1.3, 0.2, form="physical"), 0.4, 1.0, 2.3),
    "forced": (sw.Oscillator(1.3, a=sw.Sinusoid(0.8, 2.1, 0.3), form="physical"), 0.4, 1.0, 2.3),
    "forced and damped": (sw.Oscillator(1.3, 0.2, x=sw.Sinusoid(0.8, 2.1, 0.3)), -0.7, 0.5, 2.9),
    "pendulum": (sw.Pendulum(1.3, a=sw.Sinusoid(0.8, 2.1, 0.3)), 0.4, 1.5, 2.9),
    "turning frame": (sw.RestrictedThreeBody(0.1), np.array([0.1, 0.9]), np.array([0.7, 0.3]), 1.1),
    "chain": (sw.Chain(4), np.linspace(0.1, 0.5, 4), np.linspace(-1.0, 0.5, 4) ** 2, 2.3),
    "ellipse": (
        sw.NBody([1.0, 0.5], force="newton"),
        np.array([[0.0, -0.3], [0.0, 0.6]]),
        np.array([[-0.4, 0.0], [0.8, 0.1]]),
        2.3,
    ),
    "clover": (sw.scenes.clover().system, 0.9 * sw.scenes.clover().v, sw.scenes.clover().y, 1.7),
    "five bodies": (*five_bodies(), 1.1),
}


def ends(name: str, method: str, steps: int) -> tuple[Any, Any]:
    system, v, y, end = PROBLEMS[name]
    run = sw.integrate(system, method, v=v, y=y, dt=end / steps, steps=steps)
    return run.v[-1], run.y[-1]


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_the_order_is_the_declared_one(name: str, method: sw.Method) -> None:
    """Halving the step divides the error of v and that of y by 2ᵖ.

    E(h) = C·hᵖ + D·hᵖ⁺¹ + …, vectors. Fehlberg's C is so small that the next power rules until rounding does. So that power is
    taken away first: F(h) = 2ᵖ⁺¹·E(h/2) − E(h) = C·hᵖ + O(hᵖ⁺²). Were the order lower than declared, F would have that lower one.
    The slope of F is taken at the shortest steps at which rounding, some 1e-16 in each of some hundred steps, times 2ᵖ⁺¹, is a
    few per cent of it.
    """
    true = ends(name, "fehlberg_5", 20_000)
    try:
        ends(name, method.name, 4)
    except UnsupportedError:
        assert method.needs_acceleration
        return
    p = method.order
    slopes = []
    for v_or_y in (0, 1):
        errors = [ends(name, method.name, 2**k)[v_or_y] - true[v_or_y] for k in range(3, 17 - p)]
        cleaned = [np.linalg.norm(np.atleast_1d(2 ** (p + 1) * fine - coarse)) for coarse, fine in itertools.pairwise(errors)]
        usable = [size for size in cleaned if size > 2e-12 * 2**p]
        slopes.append(float(np.log2(usable[-2] / usable[-1])))
    assert slopes == pytest.approx([p, p], abs=0.1)
