"""The methods against truths that do not come from this library: closed forms, the document's own programs, exact solutions.

Bit equality shows that two spellings agree. This file shows that what they agree on is right; ``test_mutants.py`` shows that it
would notice if it were not. The methods of the document have their closed forms here; orders and limits are tested for every
method that there is, from its record.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import stepwell as sw
from support.for_each import for_each
from support.truths import CLOSED_FORMS, PROGRAMS, WEIGHTS, forced_error, matrix_of, quadrature_error, slope

METHODS = [m.name for m in sw.methods()]
PHIS = (1e-3, 0.1, 0.7, 1.2, 1.9)
C = np.sqrt(0.75)
CLOVER = {"v": np.array([[-0.5, C], [-0.5, -C], [1.0, 0.0]]), "y": np.array([[-C, -0.5], [C, -0.5], [0.0, 1.0]])}


@for_each("form", ["canonical", "physical"])
@for_each("method", CLOSED_FORMS)
def test_transition_matrix_is_the_closed_form(method: str, form: str) -> None:
    for phi in PHIS:
        # A few dozen roundings of numbers that are at most Φ⁴ in size, here 13: 50 ulp of it.
        # Verlet's v is a difference of two y divided by Φ, and so is its rounding.
        bound = 50 * np.finfo(float).eps * max(1.0, phi**4, 1 / phi if sw.method(method).carry else 0.0)
        np.testing.assert_allclose(matrix_of(method, phi, form), CLOSED_FORMS[method](phi), rtol=0, atol=bound)


@for_each("method", WEIGHTS)
def test_stage_times_and_weights(method: str) -> None:
    """Where only a(t) acts, a method is a rule of quadrature: a wrong stage time or weight shows at once."""
    assert quadrature_error(method) < 1e-12
    assert set(WEIGHTS[method]) <= {*sw.method(method).nodes, 1.0}


@for_each("method", sorted(PROGRAMS))
def test_the_documents_own_program(method: str) -> None:
    """Appendix B, transcribed line by line: same y after 200 steps up to rounding, at three angles per step."""
    for phi in (0.05, 0.5, 1.0):
        start = "first_order" if method == "verlet" else None
        run = sw.integrate(sw.Oscillator(1.0), method, v=0.0, y=1.0, dt=phi, steps=200, every=1, start=start)
        theirs = PROGRAMS[method](phi, 200)
        # Each of 200 steps rounds a handful of times by eps/2 relative to the amplitude, and for the stable methods errors add
        # up linearly, or quadratically for the two-step Verlet (its double root at Φ → 0): n² eps at most.
        size = np.abs(theirs).max()
        np.testing.assert_allclose(run.y, theirs, rtol=0, atol=200**2 * np.finfo(float).eps * size)


# The error of a series in v all but vanishes at some of these steps: test_taylor.py measures its order on the same system.
@for_each("method", [m for m in METHODS if not sw.method(m).has_series])
@for_each("block", ["v", "y"])
def test_order_on_a_forced_system(method: str, block: str) -> None:
    """A damped oscillator (undamped for Verlet) driven by a sinusoid: a wrong stage time costs the order here."""
    measured, order = slope(lambda dt: forced_error(method, dt, block)), sw.method(method).order
    if method in ("tsit5", "vern7", "vern9"):  # the next power rules until rounding does; their conditions: test_orders.py
        assert measured > order - 0.1
    else:
        assert measured == pytest.approx(order, abs=0.2 if method == "rodas5p" else 0.1)


@for_each("start", sw.method("verlet").starts)
def test_order_of_each_start_of_verlet(start: str) -> None:
    expected = {"second_order": 2, "first_order": 1}[start]
    for block in ("v", "y"):
        assert slope(lambda dt: forced_error("verlet", dt, block, start=start)) == pytest.approx(expected, abs=0.1)  # noqa: B023


def test_clover_stays_bounded_by_false_euler() -> None:
    """The document's figure: T = 0.3, stable ad infinitum; the radius stays within [0.914, 1.127] for 100 000 steps."""
    run = sw.integrate(sw.NBody(), "false_euler", **CLOVER, dt=0.3, steps=100_000, every=1)
    radius = np.linalg.norm(run.y, axis=-1)
    assert radius.min() > 0.914
    assert radius.max() < 1.127


@for_each("method", METHODS)
def test_chain_follows_its_modes(method: str) -> None:
    """n equal masses and springs: mode j oscillates with ω = 2 sin(jπ/2(n+1)), as an oscillator of that ω does."""
    n, j, dt = 9, 4, 0.3
    omega = 2 * np.sin(j * np.pi / (2 * (n + 1)))
    shape = np.sin(j * np.pi * np.arange(1, n + 1) / (n + 1))
    chain = sw.integrate(sw.Chain(n), method, v=0.3 * shape, y=shape, dt=dt, steps=50)
    single = sw.integrate(sw.Oscillator(omega, form="physical"), method, v=0.3, y=1.0, dt=dt, steps=50)
    # 50 steps of some 10 roundings each, amplified at most by the method's growth (r₁ < 1.06 a step for the worst here).
    np.testing.assert_allclose(chain.y[-1], single.y[-1] * shape, rtol=0, atol=1e-11)
    np.testing.assert_allclose(chain.v[-1], single.v[-1] * shape, rtol=0, atol=1e-11)


def test_damped_euler_in_both_forms() -> None:
    """The document's damped form, D = Φ/2, against the exchanged blocks: the same sequence up to rounding."""
    from stepwell.reference.steppers.damped_euler import damped_form

    phi, v, y = 0.9, 0.2, 1.0
    run = sw.integrate(sw.Oscillator(phi), "damped_euler", v=v, y=y, dt=1.0, steps=500, every=1)
    for k in range(501):
        # |P^k| ≤ 3 for this Φ (the ellipse's axes), 4 roundings a step of at most eps: 12 k eps.
        assert abs(run.v[k] - v) <= 12 * (k + 1) * np.finfo(float).eps
        assert abs(run.y[k] - y) <= 12 * (k + 1) * np.finfo(float).eps
        v, y = damped_form(phi, v, y)


def test_verlet_of_first_order_is_false_euler() -> None:
    """The seed's start makes Verlet's y False Euler's, up to the rounding of a two-step recursion (n² eps)."""
    arguments = {"v": 0.4, "y": 1.0, "dt": 0.5, "steps": 100, "every": 1}
    verlet = sw.integrate(sw.Oscillator(1.0), "verlet", start="first_order", **arguments)
    euler = sw.integrate(sw.Oscillator(1.0), "false_euler", **arguments)
    np.testing.assert_allclose(verlet.y, euler.y, rtol=0, atol=100**2 * np.finfo(float).eps)
    np.testing.assert_allclose(verlet.v, euler.v, rtol=0, atol=100**2 * np.finfo(float).eps / 0.5)


@for_each("method", [m for m in METHODS if 0.0 < sw.method(m).limit < math.inf])
def test_each_limit_from_both_sides(method: str) -> None:
    """Bounded a thousandth below the recorded limit, growing a thousandth above."""
    limit = sw.method(method).limit
    phi = limit * np.array([0.999, 1.001])
    # As many steps as let the amplitude grow above by e⁹, though it may turn and some of it be out of sight: 16 000 by a series
    # of order 8, whose radius is 1.0006 (test_taylor.py).
    growing = float(sw.analyse(sw.Oscillator(), method, dt=phi[1]).radius)
    steps = max(4000, 100 * math.ceil(0.09 / math.log(growing)))
    if steps < 20_000:
        run = sw.integrate(sw.Oscillator(phi), method, v=0.0, y=1.0, dt=1.0, steps=steps, every=100)
        size = np.abs(run.y).max(axis=0)
    else:  # 10¹⁰ by tsit5, which grows by 1e-9 a step: powers of its matrix, whose roundings are less by far
        steps_of = (sw.analyse(sw.Oscillator(), method, dt=each).P for each in phi)
        size = np.array([np.abs(np.linalg.matrix_power(each, steps)).max() for each in steps_of])
    # Below, the axes of the ellipse of False Euler are in the ratio √((2+Φ)/(2−Φ)) < 45. Above, an eigenvalue passes 1 by at
    # least 1e-3·|dz/dlnΦ|; the flattest of these methods grows by more than e⁷ in so many steps.
    assert size[0] < 50
    assert size[1] > 1e3
