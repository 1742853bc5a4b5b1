"""Linear systems by their transition matrix (Appendix B), and many steps at once by its powers (§4)."""

from __future__ import annotations

import time
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.calls import quiet
from support.cases import Case, cases
from support.for_each import for_each

U = np.finfo(float).eps / 2
METHODS = list(sw.methods())
MATRIX = [case for case in cases() if case.form == "matrix"]


def bound(steps: float, kappa: float, numbers: int, roundings: int = 40, size: float = 2.0) -> float:
    """How far power and direct form may be apart, relative to the state: see numerics.md.

    ``numbers`` counts those of the state and the columns of the inputs, κ bounds ‖Pʲ‖ with both, ``roundings`` those of a step
    one after another, and ``size`` is ‖Ā‖ of numerics.md.
    """
    return steps * kappa**2 * (2 * roundings * size + 3 * numbers * numbers * kappa**2) * U


def unforced(method: sw.Method) -> list[sw.System]:
    free: list[sw.System] = [sw.Oscillator(np.array([0.5, 0.8, 1.0])), sw.LinearSystem([[0.0, -0.5], [1.0, 0.0]])]
    return free if method.needs_acceleration else [*free, sw.Oscillator(1.0, np.array([0.1, 0.3]))]


def forced(method: sw.Method) -> list[sw.System]:
    damping = None if method.needs_acceleration else 0.2
    wave = sw.Sinusoid(0.7, np.array([0.3, 1.9]), 0.4)
    steady: list[sw.System] = [
        sw.Oscillator(1.0, damping, x=np.array([0.5, -2.0])),
        sw.Oscillator(0.9, damping, x=sw.Sampled([0.5, 0.5], 0.1), form="physical"),
    ]
    if method.takes_derivatives_by_time:  # it takes the derivatives of a wave, too
        return steady
    return [
        *steady,
        sw.Oscillator(1.0, damping, x=wave),
        sw.Oscillator(0.8, damping, x=wave, a=sw.Sinusoid(1.0, 2.3)),
        sw.Oscillator(1.0, damping, x=-0.3, a=wave),
    ]


@for_each("driven", [False, True])
@for_each("method", METHODS)
def test_power_and_direct_agree(method: sw.Method, driven: bool) -> None:
    """Free, damped, pushed by constants and by sinusoids, at saved states and at an odd end."""
    # Φ = 0.5 or less where the method is stable: κ < 1.3, Verlet's 2/Φ = 8 over ω₀ = 0.5; 0.05 where it grows, then by e^(NΦ²/2)
    # < 3.5 at most. Inputs add the response to one of size 1, which is below 6 off resonance.
    dt = 0.5 if method.limit else 0.05
    options: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": dt, "steps": 1003, "every": 10, "t0": 0.7, "start_step": 5}
    for system in forced(method) if driven else unforced(method):
        direct = sw.integrate(system, method, **options)
        power = sw.integrate(system, method, **options, form="power")
        apart = max(np.abs(power.v - direct.v).max(), np.abs(power.y - direct.y).max())
        size = max(np.abs(direct.v).max(), np.abs(direct.y).max(), 1.0)
        kappa = 8.0 if driven or method.carry else 3.5
        # Verlet's v is a difference divided by h·ω₀ > 0.25.
        assert apart < bound(1003, kappa, 7 if driven else 2) * size * (4 if method.carry else 1)
        assert apart > 0 or not driven  # it is another form
        np.testing.assert_array_equal(power.t, direct.t)


@for_each("case", MATRIX)
def test_direct_and_matrix_agree(case: Case) -> None:
    n = 200
    # Small steps, so that no method grows by more than 10 in 200 of them and errors are not amplified by more.
    matrix = case.run(20, steps=n, every=10, dt=0.05)
    direct = Case(case.method, case.system, "direct", case.start).run(20, steps=n, every=10, dt=0.05)
    same = np.array_equal(matrix.v, direct.v) and np.array_equal(matrix.y, direct.y)
    assert not same or case.method in ("standard_euler", "false_euler")
    size = max(np.abs(direct.y).max(initial=0.0), np.abs(direct.v).max(initial=0.0))
    # Each step of either form rounds some dozens of times (rows of P and the stages alike) relative to the largest number; n
    # steps add up n of those, times the growth. Verlet's recursion has a double root near 1: n²/2 of them, and its v divides by
    # h·ω₀ ≥ 0.025.
    steps = n * n / 2 / 0.025 if case.method == "verlet" else n
    bound = 40 * steps * 2 * U * 10 * size
    np.testing.assert_allclose(matrix.y, direct.y, rtol=0, atol=bound)
    np.testing.assert_allclose(matrix.v, direct.v, rtol=0, atol=bound)


def test_against_exact_powers() -> None:
    """False Euler with Φ = 1/2 has the matrix [1, −1/2; 1/2, 3/4], which is exact, and so are its powers in fractions."""
    p = [[Fraction(1), Fraction(-1, 2)], [Fraction(1, 2), Fraction(3, 4)]]
    system = sw.Oscillator(0.5)
    v, y, done = Fraction(1, 4), Fraction(1), 0
    for n in (1, 2, 3, 31, 32, 33, 1000, 2047):
        while done < n:
            v, y, done = p[0][0] * v + p[0][1] * y, p[1][0] * v + p[1][1] * y, done + 1
        run = sw.integrate(system, "false_euler", v=0.25, y=1.0, dt=1.0, steps=n, form="power")
        # P is found exactly, so nothing but the products round. κ = √(2.5/1.5).
        limit = bound(n, (2.5 / 1.5) ** 0.5, 2, roundings=0) * 2
        assert abs(Fraction(float(run.v[-1])) - v) <= limit
        assert abs(Fraction(float(run.y[-1])) - y) <= limit


def test_a_million_million_steps_exactly() -> None:
    """With Φ = 1 the matrix is [1, −1; 1, 0], whose sixth power is one: whole numbers, of which no product rounds."""
    options: dict[str, Any] = {"v": 3.0, "y": 5.0, "dt": 1.0}
    for steps in (10**12, 10**12 + 1, 10**12 + 3, 2**53 - 1):
        far = sw.integrate(sw.Oscillator(1.0), "false_euler", **options, steps=steps, form="power")
        near = sw.integrate(sw.Oscillator(1.0), "false_euler", **options, steps=steps % 6 + 6)
        assert (far.v[-1], far.y[-1]) == (near.v[-1], near.y[-1])
        assert far.t[-1] == steps


def test_a_million_million_steps_at_once() -> None:
    """False Euler keeps v² − Φvy + y²; after 10¹² steps the power form is off by what its rounding allows, and takes no time."""
    phi = np.array([0.1, 0.5, 1.2])
    begin = time.perf_counter()
    run = sw.integrate(sw.Oscillator(phi), "false_euler", v=0.0, y=1.0, dt=1.0, steps=10**12, every=25 * 10**10, form="power")
    assert time.perf_counter() - begin < 5.0  # stepping would take an hour; generous, for it is some milliseconds
    invariant = run.v**2 - phi * run.v * run.y + run.y**2
    kappa = np.sqrt((2 + phi) / (2 - phi))
    # Twice the state's error, times ‖state‖ ≤ κ and the form's norm 1 + Φ/2. It grows with Φ; it must still mean something.
    off = [bound(1e12, k, 2, roundings=4, size=1 + p + p * p) for k, p in zip(kappa, phi, strict=True)]
    limit = 2 * (1 + phi / 2) * kappa * np.array(off)
    assert (abs(invariant - 1) < limit).all()
    assert limit[0] < 0.02


# Some methods take the derivatives of the wave, which a transition matrix has not, and refuse (test_taylor.py, test_stiff.py).
SUITED = [m for m in METHODS if not (m.needs_acceleration or m.takes_derivatives_by_time)]


@for_each("method", SUITED)
def test_a_thousand_million_driven_steps(method: sw.Method) -> None:
    """Damped, so that only the last steps count: stepping the last few thousand ends in the same state."""
    system = sw.Oscillator(1.0, 0.5, x=sw.Sinusoid(1.0, 0.7, 0.3), a=0.2)
    n, last = 10**9, 3000
    power = sw.integrate(system, method, v=5.0, y=-3.0, dt=0.1, steps=n, form="power")
    direct = sw.integrate(system, method, v=0.0, y=0.0, dt=0.1, steps=last, start_step=n - last)
    # What was before has decayed by e^(−0.45·300). The angle 0.7·10⁸ is rounded three times in stepping, and in the power form at
    # each doubling, where it is half as large each time before: 3 + 2·3 times. An angle off by δ moves the state by δ times its
    # size, here below 1.5.
    limit = 9 * U * 0.7e8 * 1.5
    assert abs(power.v[-1] - direct.v[-1]) < limit
    assert abs(power.y[-1] - direct.y[-1]) < limit


@for_each("every", [None, 1, 7, 1000])
def test_who_diverged_and_when(every: int | None) -> None:
    """Found by halving, and right but for the rounding of numbers near the end of the range; neighbours do not notice."""
    phi = np.array([[0.5, 2.5, 1.9], [3.0, 1.0, 2.01]])
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 1.0, "steps": 8000, "every": every, "start_step": 40}
    direct = quiet(sw.Oscillator(phi), "false_euler", **options)
    with pytest.warns(sw.DivergenceWarning, match=r"3 of 6 members diverged; the first was member \(1, 0\) at step"):
        power = sw.integrate(sw.Oscillator(phi), "false_euler", **options, form="power")
    np.testing.assert_array_equal(power.status, direct.status)
    np.testing.assert_array_equal(power.first_bad_step[phi < 2], -1)
    # A term of a product may be larger than the state by some κ², κ = √((Φ + 2)/(Φ − 2)), and then overflows some steps before
    # it; a member grows by Φ²/2 − 1 + √(…) a step.
    over = phi[phi > 2]
    growth = np.log(over**2 / 2 - 1 + np.sqrt((over**2 / 2 - 1) ** 2 - 1))
    early = np.log((over + 2) / (over - 2)) / growth + 1
    assert (abs(power.first_bad_step - direct.first_bad_step)[phi > 2] <= early).all()
    alone = sw.integrate(sw.Oscillator(1.9), "false_euler", **options, form="power")
    np.testing.assert_array_equal(alone.y, power.y[:, 0, 2])


@for_each("every", [None, 1, 7, 1000, 5000])
def test_the_first_bad_step_is_exact_where_nothing_rounds(every: int | None) -> None:
    """ṡ = s by Standard Euler with dt = 1 doubles s: 2¹⁰²⁴ is the first that is no number."""
    start = np.array([[1.0, 2.0**10, 2.0**1023, 0.75]])
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(
            sw.LinearSystem([[1.0]]), "standard_euler", v=0, y=start, dt=1, steps=6000, every=every, start_step=9, form="power"
        )
    # Three quarters overflow a step later, if no power of P did so before: 2¹⁰²⁴ is in a leap of 1024 steps and more.
    late = 1025 if every in (1, 7, 1000) else 1024
    assert run.first_bad_step.tolist() == [9 + 1024, 9 + 1014, 9 + 1, 9 + late]


def test_a_run_goes_on_after_somebody_diverged() -> None:
    system = sw.Oscillator(np.array([1.0, 2.1, 5.0]))
    options: dict[str, Any] = {"dt": 1.0, "every": 50, "form": "power"}
    whole, first = (quiet(system, "false_euler", v=0.0, y=1.0, steps=steps, **options) for steps in (3000, 500))
    assert np.count_nonzero(first.status) == 1
    with pytest.warns(sw.DivergenceWarning, match="^1 of 3 member"):
        second = sw.integrate(system, "false_euler", steps=2500, **options, resume=first)
    np.testing.assert_array_equal(second.first_bad_step, whole.first_bad_step)
    np.testing.assert_array_equal(second.y, whole.y[10:])


def test_a_power_that_overflows_is_a_member_that_diverged() -> None:
    """Stepping from rest stays at rest; the power form has lost what to multiply it with, and says so."""
    options: dict[str, Any] = {"v": 0.0, "y": 0.0, "dt": 1.0, "steps": 10**6}
    assert sw.integrate(sw.Oscillator(3.0), "false_euler", **options).status == sw.Status.OK
    with pytest.warns(sw.DivergenceWarning):
        assert sw.integrate(sw.Oscillator(3.0), "false_euler", **options, form="power").status == sw.Status.DIVERGED


def test_progress() -> None:
    from stepwell.runs import engine

    shares: list[float] = []
    plan = engine.Plan(sw.Oscillator(), sw.method("rk4"), (), 0.1, steps=100, every=25, form="power", progress=shares.append)
    engine.advance(plan, np.zeros(()), np.ones(()))
    assert shares == [0.2, 0.4, 0.6, 0.8, 1.0]
