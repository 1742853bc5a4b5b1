"""The z-plane: transition matrices, eigenvalues, the document's words, limits from both sides, series and counts."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from typing import Any

import numpy as np
import other_methods as other
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, ShapeError, TooLargeError, UnsupportedError
from stepwell.stability import KINDS, eigen, maps, operations, series
from stepwell.stability.numbers import Polynomial
from truths import CLOSED_FORMS

METHODS = [m.name for m in sw.methods()]
EPS = float(np.finfo(float).eps)
DAMPABLE = [m for m in METHODS if not sw.method(m).needs_acceleration]

#: FACTS of the undamped oscillator: q = r₁², p, limit.
Q: dict[str, Any] = {
    "standard_euler": lambda f: 1 + f**2,
    "damped_euler": lambda f: 1.0 + 0 * f,
    "false_euler": lambda f: 1.0 + 0 * f,
    "verlet": lambda f: 1.0 + 0 * f,
    "leapfrog": lambda f: 1.0 + 0 * f,
    "standard_heun": lambda f: 1 + f**4 / 4,
    "false_heun": lambda f: 1 - f**2 / 2,
    "semi_false_heun": lambda f: 1 - f**4 / 4,
    "rk4": lambda f: 1 - f**6 / 72 + f**8 / 576,
    # |1 + z + … |² of the polynomials of truths, z = iΦ, multiplied out.
    "merson": lambda f: 1 - f**8 / 1728 + f**10 / 20736,
    "fehlberg": lambda f: 1 + 5 * f**6 / 936 - 11 * f**8 / 7488 + f**10 / 10816,
    "fehlberg_5": lambda f: 1 + 17 * f**6 / 9360 - 7 * f**8 / 12480 + 11 * f**10 / 374400 + f**12 / 4326400,
    "dop853": lambda f: np.array([(CLOSED_FORMS["dop853"](x)[0] ** 2).sum() for x in f]),
    "pefrl": lambda f: 1.0 + 0 * f,
}
P: dict[str, Any] = {
    "standard_euler": lambda f: 1 + 0 * f,
    "false_heun": lambda f: 1 - 3 * f**2 / 4 + f**4 / 4,
    "rk4": lambda f: 1 - f**2 / 2 + f**4 / 24,
    "merson": lambda f: 1 - f**2 / 2 + f**4 / 24,
    "fehlberg": lambda f: 1 - f**2 / 2 + f**4 / 24,
    "fehlberg_5": lambda f: 1 - f**2 / 2 + f**4 / 24 - f**6 / 2080,
    "dop853": lambda f: np.array([CLOSED_FORMS["dop853"](x)[0, 0] for x in f]),
    "pefrl": lambda f: np.array([CLOSED_FORMS["pefrl"](x).trace() / 2 for x in f]),
}
LIMITS = {
    "standard_euler": 0.0,
    "damped_euler": 2.0,
    "false_euler": 2.0,
    "verlet": 2.0,
    "standard_heun": 0.0,
    "false_heun": math.sqrt(2),
    "semi_false_heun": math.sqrt(2 * math.sqrt(5) - 2),
    "leapfrog": 2.0,
    "rk4": 2 * math.sqrt(2),
    "merson": 2 * math.sqrt(3),
    "fehlberg": 0.0,
    "fehlberg_5": 0.0,
    "dop853": 5.96035981170278,  # of the polynomial in truths, in 40 digits
    "pefrl": 2.989449545906729,  # where 1 + p = 0, by bisection of the product of nine shears in fractions
}
known = pytest.mark.parametrize("method", sorted(LIMITS))


# ---- analyse


@known
def test_p_q_and_eigenvalues(method: str) -> None:
    phi = np.linspace(0.05, 3.0, 60)
    a = sw.analyse(sw.Oscillator(), method, dt=phi)
    q, p = Q[method](phi), P.get(method, lambda f: 1 - f**2 / 2)(phi)
    # Elements of P up to Φ⁴/2 = 40, each of some roundings; p and q are sums and products of them.
    np.testing.assert_allclose(a.p, p, rtol=0, atol=200 * EPS)
    np.testing.assert_allclose(a.q, q, rtol=0, atol=200 * 40 * EPS)
    np.testing.assert_allclose(a.polynomial, [np.ones(60), -2 * a.p, a.q], rtol=0, atol=0)
    for i, f in enumerate(phi):
        z = np.sort_complex(np.roots([1, -2 * p[i], q[i]]))
        # Near a double root an error e of the coefficients moves it by √e.
        np.testing.assert_allclose(np.sort_complex(a.eigenvalues[:, i]), z, rtol=0, atol=3e-6 if f == 2 else 1e-7)
        assert a.radius[i] == pytest.approx(np.abs(z).max(), abs=1e-7)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("form", ["canonical", "physical"])
def test_matrix_is_that_of_the_closed_form(method: str, form: str) -> None:
    """In the slots of Verlet, (y_prev, y), P is [0, 1], [−1, 2 − Φ²]."""
    if method not in CLOSED_FORMS:
        pytest.skip("no closed form")
    omega, phi = 1.7, 0.6
    a = sw.analyse(sw.Oscillator(omega, form=form), method, dt=phi / omega)
    scale = 1.0 if form == "canonical" else omega
    true = CLOSED_FORMS[method](phi)
    true = np.array([[true[0, 0], true[0, 1] * scale], [true[1, 0] / scale, true[1, 1]]])
    if method == "verlet":
        true = np.array([[0, 1], [-1, 2 - phi**2]])
        assert a.slots == ["y_prev", "y"]
    if method == "leapfrog":  # in its slots, half a step apart, False Euler
        true = np.array([[1, -phi * scale], [phi / scale, 1 - phi**2]])
        assert a.slots == ["v_half", "y"]
    np.testing.assert_allclose(a.P, true, rtol=0, atol=20 * EPS)


@pytest.mark.parametrize("method", METHODS)
def test_arrays_of_steps_are_the_single_steps(method: str) -> None:
    """Many steps at once go through the reference, one through the core: the same bits. So do arrays of parameters."""
    dt = np.array([[0.1], [0.7], [1.9]])
    omega = np.array([0.5, 1.25])
    a = sw.analyse(sw.Oscillator(omega), method, dt=dt)
    assert a.P.shape == (2, 2, 3, 2)
    assert a.Q.shape == (2, 2, 3, 2)
    assert a.kind.shape == a.radius.shape == a.stable.shape == (3, 2)
    for i, h in enumerate(dt[:, 0]):
        row = sw.analyse(sw.Oscillator(omega), method, dt=h)
        np.testing.assert_array_equal(a.P[:, :, i], row.P)
        np.testing.assert_array_equal(a.Q[:, :, i], row.Q)
        for j, w in enumerate(omega):
            one = sw.analyse(sw.Oscillator(w), method, dt=h)
            np.testing.assert_array_equal(row.P[:, :, j], one.P)
            for field in ("radius", "angle", "true_angle", "omega", "frequency_ratio", "kind", "p", "q", "samples_per_period"):
                assert getattr(a, field)[i, j] == getattr(one, field), field
    chain = sw.Chain(3, stiffness=np.array([[1.0, 2.0]]), mass=[1.0, 2.0, 0.5])
    both = sw.analyse(chain, method, dt=[[0.1], [0.2]])
    np.testing.assert_array_equal(both.P[:, :, 1], sw.analyse(chain, method, dt=0.2).P)


@pytest.mark.parametrize("method", METHODS)
def test_input_matrix(method: str) -> None:
    """Q is what a held input makes in a step from rest; the sum over the nodes of what the matrix form takes."""
    second_order = sw.method(method).needs_acceleration
    system = sw.Oscillator(1.3, None if second_order else 0.2)
    a = sw.analyse(system, method, dt=0.4)
    assert a.inputs == ("x", "a")
    for j, name in enumerate(a.inputs):
        driven = sw.Oscillator(1.3, system.damping, **{name: 1.0})
        start = "first_order" if method == "verlet" else None  # y_prev = y₀ − h·v₀ = 0
        run = sw.integrate(driven, method, v=0.0, y=0.0, dt=0.4, steps=3, every=1, start=start)
        s = np.zeros(2)
        if method == "leapfrog":  # half a kick back from rest
            s[0] = sw.method(method).steps.start(driven.scaled(0.4, ()), 0, 0.0, s[0], s[1])
        for k in range(3):
            s = a.P @ s + a.Q[:, j]
            if not second_order:
                np.testing.assert_allclose([run.v[k + 1], run.y[k + 1]], s, rtol=0, atol=40 * EPS)
            else:
                np.testing.assert_allclose(run.y[k + 1], s[1], rtol=0, atol=40 * EPS)


def test_the_angle_is_that_of_atan2() -> None:
    """Past Ψ = π/2 the document's arctan(b/a) is wrong: −36° for 144° at Φ = 1.9. 150° a step are 2.4 samples a period."""
    a = sw.analyse(sw.Oscillator(), "false_euler", dt=1.9)
    assert math.degrees(a.angle) == pytest.approx(math.degrees(2 * math.asin(0.95)), abs=1e-12)
    assert a.angle == pytest.approx(2.50647, abs=1e-5)
    phi = 2 * math.sin(math.radians(75))
    b = sw.analyse(sw.Oscillator(3.0), "false_euler", dt=phi / 3.0)
    assert b.samples_per_period == pytest.approx(2.4, abs=1e-12)
    assert b.omega == pytest.approx(math.radians(150) / (phi / 3.0), abs=1e-12)
    assert b.frequency_ratio == pytest.approx(math.radians(150) / phi, abs=1e-12)


@pytest.mark.parametrize(
    ("method", "damping", "phi", "kind", "stable"),
    [
        ("false_euler", None, 1.0, "harmonic", True),
        ("false_euler", None, 2.0, "unstable oscillation (double eigenvalue -1)", False),
        ("verlet", None, 2.0, "unstable oscillation (double eigenvalue -1)", False),
        ("false_euler", None, 2.001, "unstable oscillation", False),
        ("standard_euler", None, 0.001, "unstable oscillation", False),
        ("standard_heun", None, 0.01, "unstable oscillation", False),
        ("rk4", None, 0.5, "damped oscillation", True),
        ("false_heun", None, 1.3, "monotonic stable", True),
        ("false_heun", None, 1.5, "monotonic unstable", False),
        ("standard_euler", 2.0, 0.1, "monotonic stable", True),
        ("standard_euler", 2.0, 0.535, "damped oscillation", True),  # one negative eigenvalue: it changes its sign at every step
        ("standard_euler", 2.0, 0.6, "unstable oscillation", False),
        ("rk4", -0.5, 0.1, "unstable oscillation", False),
        ("rk4", -2.0, 0.1, "monotonic unstable", False),
    ],
)
def test_the_words_of_the_document(method: str, damping: float | None, phi: float, kind: str, stable: bool) -> None:
    a = sw.analyse(sw.Oscillator(1.0, damping), method, dt=phi)
    assert kind in KINDS
    assert (a.kind, bool(a.stable)) == (kind, stable)
    assert bool(sw.analyse(sw.Oscillator(1.0, damping), method, dt=[phi]).stable[0]) == stable


@pytest.mark.parametrize("method", ["false_euler", "damped_euler", "verlet"])
def test_at_exactly_two_the_samples_grow_linearly(method: str) -> None:
    """z₁ = z₂ = −1: y_k = (−1)ᵏ(a + b·k). Bounded at 1.999, and at 2.001 growing at the predicted rate."""
    run = sw.integrate(sw.Oscillator(), method, v=0.5, y=1.0, dt=2.0, steps=1000, every=1)
    size = np.abs(run.y)
    steps = np.diff(size[1:])
    np.testing.assert_array_equal(steps, np.full(999, steps[0]))  # whole numbers and halves: no rounding
    assert steps[0] > 0
    inside = sw.integrate(sw.Oscillator(), method, v=0.0, y=1.0, dt=1.999, steps=100_000, every=1)
    # The orbit is an ellipse v² ∓ Φvy + y² = 1 whose long axis is √(2/(2 − Φ)) = 44.7.
    assert np.abs(inside.y).max() <= math.sqrt(2 / (2 - 1.999)) * (1 + 1e-9)
    outside = sw.integrate(sw.Oscillator(), method, v=0.0, y=1.0, dt=2.001, steps=2000, every=1000)
    predicted = 1000 * math.log(sw.analyse(sw.Oscillator(), method, dt=2.001).radius)
    # After 1000 steps the other eigenvalue has 1e-54 of the growing one.
    assert math.log(abs(outside.y[-1] / outside.y[1])) == pytest.approx(predicted, abs=1000 * 50 * EPS)


def test_semi_false_heun_is_not_always_stable() -> None:
    """§11 says so. The samples are a damped oscillation below 1.5723 and grow, changing signs, above."""
    limit = sw.method("semi_false_heun").limit
    for phi, kind in ((limit - 1e-3, "damped oscillation"), (limit + 1e-3, "unstable oscillation")):
        a = sw.analyse(sw.Oscillator(), "semi_false_heun", dt=phi)
        assert a.kind == kind
        run = sw.integrate(sw.Oscillator(), "semi_false_heun", v=0.0, y=1.0, dt=phi, steps=20_000, every=10_000)
        assert math.log(abs(run.y[-1] / run.y[1])) == pytest.approx(10_000 * math.log(a.radius), abs=10_000 * 50 * EPS)
        assert a.q == pytest.approx(1 - phi**4 / 4, abs=20 * EPS)  # below 1 on both sides: r₁² = q holds for pairs only


def test_the_misprinted_matrix_of_false_heun_has_another_determinant() -> None:
    phi = 0.9
    a = sw.analyse(sw.Oscillator(), "false_heun", dt=phi)
    off = phi * (1 - phi**2 / 2)
    misprinted = (1 - phi**2 / 2) ** 2 + off**2
    assert a.q == pytest.approx(1 - phi**2 / 2, abs=8 * EPS)
    assert misprinted - a.q == pytest.approx(0.04579, abs=1e-5)


@pytest.mark.parametrize("method", ["standard_euler", "standard_heun", "rk4", "merson", "fehlberg", "fehlberg_5"])
def test_growth_over_thousands_of_steps(method: str) -> None:
    """The energy of the canonical oscillator is multiplied by r₁² each step, because P is r₁ times a rotation.

    Fehlberg's results pump energy in, Merson's and RK4's take it out.
    """
    phi = np.array([0.01, 0.1, 0.3, 1.0])
    a = sw.analyse(sw.Oscillator(phi), method, dt=1.0)
    np.testing.assert_allclose(a.radius**2, Q[method](phi), rtol=0, atol=20 * EPS)
    run = sw.integrate(sw.Oscillator(phi), method, v=0.0, y=1.0, dt=1.0, steps=1000)
    np.testing.assert_allclose(np.log(2 * run.energy[-1]), 1000 * np.log(Q[method](phi)), rtol=0, atol=1000 * 40 * EPS)
    assert ((a.radius > 1) == (method in ("standard_euler", "standard_heun", "fehlberg", "fehlberg_5")))[1:].all()


@pytest.mark.parametrize("method", METHODS)
def test_derivative_of_the_reference_is_the_matrix_of_the_core(method: str) -> None:
    """At any state of a linear system the complex step gives what unit vectors give, to rounding."""
    chain = sw.Chain(3, stiffness=[1.0, 2.0, 0.5, 0.0])
    rng = np.random.default_rng(1)
    at = rng.normal(size=(2, 3))
    exact = sw.analyse(chain, method, dt=0.3)
    derived = sw.analyse(chain, method, dt=0.3, at=(at[0], at[1]))
    np.testing.assert_allclose(derived.P, exact.P, rtol=0, atol=30 * EPS)
    np.testing.assert_allclose(np.abs(derived.rates), np.abs(exact.rates), rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_derivative_of_a_step_that_is_not_linear(method: str) -> None:
    """Against differences of steps, whose error is the square of the difference times the third derivative: ≲ 1e-9 here."""
    scene = sw.scenes.clover()
    a = sw.analyse(scene.system, method, dt=0.1, at=(scene.v, scene.y))
    steps = sw.method(method).steps
    s = scene.system.scaled(0.1, ())
    slot = steps.start(s, 0, 0.0, scene.v, scene.y) if sw.method(method).carry else scene.v
    flat = np.concatenate([slot.ravel(), scene.y.ravel()])
    d = 1e-5
    for j in range(12):
        ends = []
        for sign in (1, -1):
            moved = flat.copy()
            moved[j] += sign * d
            v, y = steps.step(s, 0.0, 0.1, moved[:6].reshape(3, 2), moved[6:].reshape(3, 2))
            ends.append(np.concatenate([v.ravel(), y.ravel()]))
        np.testing.assert_allclose(a.P[:, j], (ends[0] - ends[1]) / (2 * d), rtol=0, atol=1e-8)


@pytest.mark.parametrize("force", ["logarithmic", "newton", "printed"])
@pytest.mark.parametrize(
    "control",
    [
        sw.EnergyControl(0.3, target=-0.2),
        sw.EnergyControl(0.3, form="printed", target=-0.2),
        sw.Projection(target=-0.2),
        sw.Projection("nacozy", target=-0.2),
    ],
    ids=repr,
)
def test_control_belongs_to_the_step(control: Any, force: str) -> None:
    """P of what is controlled or set back is the derivative of that run, by differences: d⁴ = 1e-16, and rounding 1e-16/d."""
    scene = sw.scenes.energy_control()
    options: dict[str, Any] = {"dt": 0.01, "steps": 1, "control": control}
    start = np.concatenate([scene.v.ravel(), scene.y.ravel()])

    def end(state: Any) -> Any:
        v, y = state[:6].reshape(3, 2), state[6:].reshape(3, 2)
        run = sw.integrate(sw.NBody(force=force), "false_euler", v=v, y=y, **options)
        return run.system, np.concatenate([run.v[-1].ravel(), run.y[-1].ravel()])

    a = sw.analyse(end(start)[0], "false_euler", dt=0.01, at=(scene.v, scene.y))
    d = 1e-4
    for j, one in enumerate(d * np.eye(12)):
        near, far = (end(start + k * one)[1] - end(start - k * one)[1] for k in (1, 2))
        np.testing.assert_allclose(a.P[:, j], (8 * near - far) / (12 * d), rtol=0, atol=1e-11)
    counted = operations("false_euler", end(start)[0])
    assert counted.additions > operations("false_euler", sw.NBody(force=force)).additions


@pytest.mark.parametrize("method", METHODS)
def test_each_eigenvalue_of_two_continues_its_own_rate(method: str) -> None:
    """Two real rates: z = e^(λ·dt) but for some (λ·dt)²; taken for each other they would be off by 0.02 and more."""
    dt = 0.01
    if sw.method(method).needs_acceleration:
        systems = [(sw.LinearSystem([[0.0, 3.0], [1.0, 0.0]], velocities=1), [3**0.5, -(3**0.5)])]
    else:
        systems = [
            (sw.Oscillator(1.0, np.array([1.5, 2.0])), [[-1.5 - 1.25**0.5, -2 - 3**0.5], [-1.5 + 1.25**0.5, -2 + 3**0.5]]),
            (sw.LinearSystem(np.diag([-1.0, -4.0]), velocities=1), [-1.0, -4.0]),
            (sw.LinearSystem([[-1.0, 1e6], [0.0, -4.0]], velocities=1), [-1.0, -4.0]),
        ]
    for system, rates in systems:
        a = sw.analyse(system, method, dt=dt)
        np.testing.assert_allclose(np.sort(a.rates.real, axis=0), np.sort(rates, axis=0), rtol=1e-12)
        np.testing.assert_allclose(a.eigenvalues.real, np.exp(a.rates.real * dt), rtol=0, atol=4 * (4 * dt) ** 2 / 2)
        assert (a.radius == np.abs(a.eigenvalues).max(axis=0)).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("omega", [2.0**-40, *(pytest.param(2.0**k, marks=pytest.mark.long) for k in (-20, 20)), 2.0**40])
def test_units_do_not_matter(method: str, omega: float) -> None:
    """Rad per microsecond or per year: all scaled by powers of two, so what is found is the same to the bit, or nearly."""
    phi = np.array([0.01, 0.1, 0.5, 1.0, 1.5, 1.9, 2.1, 3.0])
    own = sw.analyse(sw.Oscillator(1.0, form="physical"), method, dt=phi)
    a = sw.analyse(sw.Oscillator(omega, form="physical"), method, dt=phi / omega)
    assert a.kind.tolist() == own.kind.tolist()
    np.testing.assert_array_equal(a.radius, own.radius)
    np.testing.assert_array_equal(a.frequency_ratio, own.frequency_ratio)
    limit = sw.stability_limit(sw.Oscillator(omega, form="physical"), method) * omega
    assert limit == pytest.approx(sw.method(method).limit, rel=1e-14)
    three = sw.analyse(sw.Chain(3), method, dt=phi)
    a = sw.analyse(sw.Chain(3, stiffness=omega**2), method, dt=phi / omega)
    assert a.kind.tolist() == three.kind.tolist()
    np.testing.assert_allclose(np.abs(a.rates) / omega, np.abs(three.rates), rtol=1e-12)
    assert sw.stability_limit(sw.Chain(3, stiffness=omega**2), method) * omega == pytest.approx(
        float(sw.stability_limit(sw.Chain(3), method)), rel=1e-13
    )


def test_small_growth_is_seen_beside_what_is_on_the_circle() -> None:
    """A slow oscillator with negative damping beside a fast one on the circle: growth of 1e-10 a step decides."""
    a = np.zeros((4, 4))
    a[2, 0] = a[3, 1] = 1.0
    a[0, 2], a[1, 3] = -1.0, -(0.01**2)
    a[1, 1] = 2e-9
    found = sw.analyse(sw.LinearSystem(a), "false_euler", dt=0.1)
    assert (found.kind, bool(found.stable)) == ("unstable oscillation", False)
    # e^(½·2e-9·dt) a step, of which |z| has some eps times 1/|wᴴx| = 1/0.01.
    assert found.radius - 1 == pytest.approx(1e-10, abs=100 * 10 * EPS)


def test_the_angle_of_verlet_is_as_exact_as_its_matrix() -> None:
    """P has 2 − Φ², rounded to 2⁻⁵²: of Φ² a share of 2⁻⁵³·2/Φ² or less, and half of that of Ψ = 2·asin(Φ/2)."""
    phi = np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0])
    a = sw.analyse(sw.Oscillator(), "verlet", dt=phi)
    off = np.abs(a.angle / (2 * np.arcsin(phi / 2)) - 1)
    assert (off <= EPS / phi**2 + 4 * EPS).all()
    assert (a.kind == "harmonic").all()


@pytest.mark.parametrize("method", ["false_euler", "rk4", "verlet"])
def test_along_a_run(method: str) -> None:
    """The product of the steps' matrices is the derivative of the end with respect to the start (in slots)."""
    scene = sw.scenes.clover()
    run = scene.run(method, 0.05, steps=20, every=1)
    a = sw.analyse(scene.system, method, at=run)
    assert a.P.shape == (12, 12, 21)
    assert a.dt.tolist() == [0.05] * 21
    one = sw.analyse(scene.system, method, dt=0.05, at=(run.v[7], run.y[7]))
    np.testing.assert_array_equal(a.P[:, :, 7], one.P)
    product = a.monodromy
    if method != "verlet":
        d = 1e-6
        for j in (0, 5, 8):
            ends = []
            for sign in (1, -1):
                flat = np.concatenate([scene.v.ravel(), scene.y.ravel()])
                flat[j] += sign * d
                v, y = flat[:6].reshape(3, 2), flat[6:].reshape(3, 2)
                moved = sw.integrate(scene.system, method, v=v, y=y, dt=0.05, steps=20)
                ends.append(np.concatenate([moved.v[-1].ravel(), moved.y[-1].ravel()]))
            np.testing.assert_allclose(product[:, j], (ends[0] - ends[1]) / (2 * d), rtol=0, atol=1e-7)
    with pytest.raises(ArgumentError, match="every=1"):
        _ = sw.analyse(scene.system, method, at=scene.run(method, 0.05, steps=20, every=2)).monodromy
    # Volumes are kept by the methods that exchange blocks (their P is a product of shears).
    if method != "rk4":
        assert np.linalg.det(product) == pytest.approx(1.0, abs=1e-9)


def test_modes_of_a_chain() -> None:
    """Each mode is an oscillator of its own: Ψ = 2·asin(Φ/2) by False Euler, also where angles are nearly equal."""
    n, dt = 12, 0.9
    exact = 2 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1)))
    for method in ("false_euler", "verlet", "rk4"):
        a = sw.analyse(sw.Chain(n), method, dt=dt)
        phi = np.abs(a.rates.imag) * dt
        assert sorted(phi) == pytest.approx(sorted(np.repeat(exact * dt, 2)), abs=1e-12)
        angle = (
            np.abs(np.angle(1 - phi**2 / 2 + phi**4 / 24 + 1j * (phi - phi**3 / 6)))
            if method == "rk4"
            else 2 * np.arcsin(phi / 2)
        )
        np.testing.assert_allclose(a.angles, angle, rtol=0, atol=1e-9)
        np.testing.assert_allclose(a.frequency_ratios, angle / phi, rtol=0, atol=1e-8)
        if method != "rk4":
            assert a.true_angle == pytest.approx(exact[-1] * dt, abs=1e-12)  # of equal ones the fastest decides
            assert a.kind == "harmonic"


def test_a_chain_that_floats_has_a_double_eigenvalue_one() -> None:
    """No spring holds it: the exact solution drifts, and so do the samples."""
    free = sw.Chain(3, stiffness=[0.0, 1.0, 1.0, 0.0])
    a = sw.analyse(free, "false_euler", dt=0.3)
    assert (a.kind, bool(a.stable)) == ("monotonic unstable (double eigenvalue +1)", False)
    two = sw.analyse(sw.Chain(2, stiffness=[1.0, 0.0, 1.0]), "false_euler", dt=0.3)
    assert (two.kind, bool(two.stable)) == ("harmonic", True)  # twice the same oscillator, apart: no growth
    at_two = sw.analyse(sw.Chain(2, stiffness=[1.0, 0.0, 1.0]), "false_euler", dt=2.0)
    assert at_two.kind == "unstable oscillation (double eigenvalue -1)"


def test_coefficients_of_more_than_two_states() -> None:
    a = sw.analyse(sw.Chain(3), "rk4", dt=[0.3, 0.4])
    for i in range(2):
        np.testing.assert_allclose(a.polynomial[:, i], np.poly(a.P[:, :, i]), rtol=0, atol=1e-12)
    assert a.p is None
    assert a.q is None


def test_overflow_is_said() -> None:
    a = sw.analyse(sw.Oscillator([1.0, 1e200]), "rk4", dt=1.0)
    assert a.kind.tolist() == ["damped oscillation", "not finite"]
    assert a.stable.tolist() == [True, False]


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"system": 1, "dt": 0.1}, DTypeError, "system: expected a stepwell system"),
        ({"method": "eular", "dt": 0.1}, ArgumentError, "method: there is no 'eular'"),
        ({}, ArgumentError, "dt: expected the step, in units of time, got None"),
        ({"dt": -1.0}, ArgumentError, "dt: expected numbers above zero"),
        ({"dt": "a"}, DTypeError, "dt: expected real numbers"),
        ({"system": sw.NBody(), "dt": 0.1}, ArgumentError, "at: .* is not linear"),
        ({"system": sw.NBody(), "dt": 0.1, "at": 3}, DTypeError, r"at: expected a pair \(v, y\) or a run"),
        ({"system": sw.NBody(), "dt": 0.1, "at": (0.0, np.zeros(3))}, ShapeError, r"y: expected shape \(3, 2 or 3"),
        ({"system": sw.Oscillator(1.0, 0.1), "method": "verlet", "dt": 0.1}, UnsupportedError, "damping"),
        ({"system": sw.Oscillator([1.0, 2.0]), "dt": [0.1, 0.2, 0.3]}, ShapeError, "broadcast"),
        (
            {"system": sw.Pendulum(), "dt": [0.1, 0.2, 0.3], "at": ([0.0, 0.0], 0.0)},
            ShapeError,
            r"broadcast.*: dt \(3,\), v \(2,\)",
        ),
        ({"system": sw.Pendulum([1.0, 2.0, 3.0]), "dt": 0.1, "at": (0.0, [1.0, 1.0])}, ShapeError, r"system \(3,\), y \(2,\)"),
        ({"system": sw.Pendulum(), "dt": 0.1, "at": ([0.0] * 2, [0.0] * 3)}, ShapeError, r"v \(2,\), y \(3,\)"),
        ({"system": sw.Pendulum(), "dt": 0.1, "at": (0.0, 0.0, 0.0)}, DTypeError, r"pair \(v, y\) or a run, got 3 of them"),
        ({"dt": 0.1, "t": "noon"}, DTypeError, "t: expected real numbers, got 'noon'"),
        ({"system": sw.Chain(200), "dt": np.broadcast_to(0.1, 10**8)}, TooLargeError, "the matrices of 100000000 members need"),
    ],
)
def test_analyse_says_what_is_wrong(arguments: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        sw.analyse(**({"system": sw.Oscillator(), "method": "false_euler"} | arguments))
    with pytest.raises(ArgumentError, match="monodromy"):
        _ = sw.analyse(sw.Oscillator(), "rk4", dt=0.1).monodromy


def test_along_runs_that_say_less() -> None:
    """What can be asked along a run that was made by another method, with another step, or with steps of its own choice."""
    pendulum = sw.Pendulum([1.0, 2.0])
    run = sw.integrate(pendulum, "rk4", v=0.0, y=1.0, dt=0.1, steps=4, every=1)
    assert sw.analyse(pendulum, "rk4", at=run).monodromy.shape == (2, 2, 2)
    for arguments in ({"method": "rk4", "dt": 0.2}, {"method": "false_euler", "dt": None}):
        a = sw.analyse(pendulum, at=run, **arguments)
        with pytest.raises(ArgumentError, match="monodromy: expected an analysis with the run's own method and step"):
            _ = a.monodromy
    steps = sw.analyse(pendulum, "rk4", at=run, dt=np.array([[0.1], [0.2]]))
    assert steps.P.shape == (2, 2, 5, 2, 2)
    assert steps.rates.shape == (2, 5, 2, 2)
    np.testing.assert_array_equal(steps.P[:, :, :, 1], sw.analyse(pendulum, "rk4", at=run, dt=0.2).P)
    paced = sw.integrate(sw.Pendulum(), "fehlberg_5", v=0.0, y=1.0, tolerance=1e-6, at=[1.0, 2.0])
    with pytest.raises(ArgumentError, match=r"dt: expected the step.* since the run has chosen its own"):
        sw.analyse(sw.Pendulum(), "fehlberg_5", at=paced)
    assert sw.analyse(sw.Pendulum(), "fehlberg_5", at=paced, dt=0.1).radius.shape == (2,)
    with pytest.raises(ShapeError, match=r"system \(3,\), at \(2,\)"):
        sw.analyse(sw.Pendulum([1.0, 2.0, 3.0]), "rk4", at=run)


def test_inputs_of_a_linear_system_at_states() -> None:
    """Q does not depend on the state; it has the shape of the states all the same."""
    driven = sw.Oscillator(1.3, 0.2, x=0.5)
    one = sw.analyse(driven, "rk4", dt=0.1)
    run = sw.integrate(driven, "rk4", v=0.0, y=np.zeros(2), dt=0.1, steps=2, every=1)
    for at, shape in (((np.zeros(3), np.ones(3)), (3,)), (run, (3, 2))):
        a = sw.analyse(driven, "rk4", dt=0.1, at=at)
        assert a.Q.shape == (2, 2, *shape)
        np.testing.assert_array_equal(a.Q.reshape(2, 2, -1), np.repeat(one.Q[:, :, np.newaxis], math.prod(shape), axis=2))


def test_a_run_of_another_system_is_refused() -> None:
    run = sw.integrate(sw.Chain(3), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
    with pytest.raises(ShapeError, match="at: expected a run of"):
        sw.analyse(sw.NBody(), "rk4", at=run)


# ---- stability_limit


@known
def test_limits_of_the_undamped_oscillator(method: str) -> None:
    limit = sw.stability_limit(sw.Oscillator(), method)
    assert limit == pytest.approx(LIMITS[method], rel=1e-14)
    assert limit.dt == float(limit)
    assert sw.stability_limit(sw.Oscillator(7.3, form="physical"), method) == pytest.approx(LIMITS[method] / 7.3, rel=1e-13)


@pytest.mark.parametrize("method", METHODS)
def test_the_record_has_the_limit(method: str) -> None:
    assert sw.stability_limit(sw.Oscillator(), method) == pytest.approx(sw.method(method).limit, rel=1e-12)


@pytest.mark.parametrize(
    ("method", "limit"),
    [
        (other.MERSON_4, 2 * math.sqrt(3)),
        (other.FEHLBERG_4, 0.0),
        (other.FEHLBERG_5, 0.0),
        (other.DORMAND_PRINCE_5, 0.997189),
        (other.FOREST_RUTH, 1.573401947),
        (other.PEFRL, 2.989449546),
        (other.KUTTA_3, math.sqrt(3)),
    ],
)
def test_limits_of_methods_that_are_not_in_the_catalogue(method: Any, limit: float) -> None:
    """Known elsewhere to as many digits as are written here."""
    digits = 1e-12 if limit in (2 * math.sqrt(3), math.sqrt(3), 0.0) else 10.0 ** -len(str(limit).split(".")[1])
    assert sw.stability_limit(sw.Oscillator(), method) == pytest.approx(limit, abs=digits)


#: Blanes and Moan 2002, table 2, S₆ of order 4.
_A, _B = (0.0792036964311957, 0.353172906049774, -0.0420650803577195), (0.209515106613362, -0.143851773179818)


@pytest.mark.parametrize(
    ("kicks", "drifts"),
    [
        ((*_B, 0.5 - sum(_B), 0.5 - sum(_B), *_B[::-1]), (*_A, 1 - 2 * sum(_A), *_A[::-1])),
        ((0.49, 0.51), (0.245, 0.5, 0.255)),
        ((0.2, 0.199, 0.202, 0.199, 0.2), (0.1, 0.1995, 0.2005, 0.2005, 0.1995, 0.1)),
    ],
    ids=["Blanes-Moan", "two uneven halves", "five uneven fifths"],
)
def test_growth_for_less_than_a_rung_is_found(kicks: Any, drifts: Any) -> None:
    """Compositions grow in a narrow window where ½·trace passes ±1 for a moment: of the third from 3.0898 to 3.0905 only.

    The first of these by the trace of a product of shears, on steps of Φ that are 500 times finer, and bisection.
    """

    def half_trace(phi: Any) -> Any:
        v = y = np.stack([np.ones_like(phi), np.zeros_like(phi)]), np.stack([np.zeros_like(phi), np.ones_like(phi)])
        v, y = v
        for i, drift in enumerate(drifts):
            y = y + drift * phi * v
            v = v - (kicks[i] if i < len(kicks) else 0.0) * phi * y
        return 0.5 * (v[0] + y[1])

    phi = np.arange(1, 200_001) * 4e-5
    high = phi[np.abs(half_trace(phi)) > 1 + 1e-12][0]
    low = high - 4e-5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if abs(half_trace(middle)) > 1 else (middle, high)
    method = other.method(other.composed(kicks, drifts))
    # The trace has some roundings, and passes 1 with a slope of 0.1 or more where it has not turned yet.
    assert sw.stability_limit(sw.Oscillator(), method) == pytest.approx(high, rel=1e-13)
    batch = sw.stability_limit(sw.Oscillator(np.array([0.5, 1.0])), method)
    assert batch == pytest.approx([2 * high, high], rel=1e-13)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 8))])
def test_limits_of_chains_with_soft_and_stiff_springs(seed: int, method: str) -> None:
    """Eight decades of stiffness, four of mass, with walls and without: the fastest mode decides, by the matrix K/√mm."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    stiffness, mass = 10.0 ** (rng.uniform(-4, 4, n + 1) + rng.uniform(-3, 6)), 10.0 ** rng.uniform(-2, 2, n)
    if seed % 2:
        stiffness[0] = stiffness[-1] = 0.0  # it floats: a double eigenvalue 1
    k = np.diag(stiffness[:-1] + stiffness[1:]) - np.diag(stiffness[1:-1], 1) - np.diag(stiffness[1:-1], -1)
    fastest = math.sqrt(np.linalg.eigvalsh(k / np.sqrt(np.outer(mass, mass))).max())
    limit = sw.stability_limit(sw.Chain(n, stiffness=stiffness, mass=mass), method)
    # eigvalsh: some eps of the fastest, and the limit some 1e-14 of its own.
    assert limit == pytest.approx(sw.method(method).limit / fastest, rel=1e-12)


@pytest.mark.parametrize(
    "method", ["false_euler", *(pytest.param(m, marks=pytest.mark.long) for m in ("verlet", "pefrl", "rk4"))]
)
def test_limits_of_a_long_chain(method: str) -> None:
    n = 40
    fastest = 2 * math.sin(n * math.pi / (2 * (n + 1)))
    assert sw.stability_limit(sw.Chain(n), method) == pytest.approx(LIMITS[method] / fastest, rel=1e-13)


def _independent(method: str, damping: float) -> float:
    """The limit of v̇ = −2Dv − y, ẏ = v by Jury's conditions, from p and q written by hand, by bisection."""
    d = damping

    def stable(f: float) -> bool:
        a = np.array([[-2 * d, -1.0], [1.0, 0.0]]) * f
        one = np.eye(2)
        kick, drift = np.array([[1 - 2 * d * f, -f], [0, 1]]), np.array([[1, 0], [f, 1]])
        matrix = {
            "standard_euler": one + a,
            "standard_heun": one + a + a @ a / 2,
            "rk4": one + a + a @ a / 2 + a @ a @ a / 6 + a @ a @ a @ a / 24,
            "false_euler": drift @ kick,
            "damped_euler": kick @ drift,
        }[method]
        trace, det = matrix.trace(), np.linalg.det(matrix)
        return bool(abs(trace) <= 1 + det and det <= 1)

    ladder = np.arange(1e-4, 5.0, 1e-3)
    high = next(f for f in ladder if not stable(f))
    low = high - 1e-3
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


@pytest.mark.parametrize("method", ["standard_euler", "standard_heun", "rk4", "false_euler", "damped_euler"])
@pytest.mark.parametrize("damping", [0.05, 0.3, 0.7, 1.7])
def test_limits_of_the_damped_oscillator(method: str, damping: float) -> None:
    # The independent value loses digits where q crosses 1 at a small angle: an eps of the determinant over the slope.
    assert sw.stability_limit(sw.Oscillator(1.0, damping), method) == pytest.approx(_independent(method, damping), rel=1e-12)


@pytest.mark.parametrize(
    ("method", "limit"),
    [
        ("standard_euler", 2.0),
        ("standard_heun", 2.0),
        ("rk4", 2.785293563405282),
        ("merson", 3.548322344234674),
        ("fehlberg", 3.0200175439705026),
        ("fehlberg_5", 3.6777066213218954),
        ("false_euler", 2 * math.sqrt(2) - 2),
    ],
)
def test_limits_at_critical_damping(method: str, limit: float) -> None:
    """A double rate −1: the limits of the real axis (of RK4, the root of z³ + 4z² + 12z + 24 = 0), by bisection in fractions."""
    assert sw.stability_limit(sw.Oscillator(1.0, 1.0), method) == pytest.approx(limit, rel=1e-12)


@pytest.mark.parametrize("damping", [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 0.99])
def test_standard_euler_is_stable_up_to_twice_the_damping(damping: float) -> None:
    """r₁² = 1 − 2DΦ + Φ² (§6). However light the damping, the limit keeps its digits."""
    limit = sw.stability_limit(sw.Oscillator(1.0, damping), "standard_euler")
    assert limit == pytest.approx(2 * damping, rel=1e-12)
    assert limit.mode.kind == "unstable oscillation"
    assert limit.mode.angle == pytest.approx(math.atan2(2 * damping * math.sqrt(1 - damping**2), 1 - 2 * damping**2), abs=1e-8)


@pytest.mark.parametrize("damping", [0.1, 0.5, 2.0])
def test_false_euler_damped_has_its_limit_where_an_eigenvalue_passes_minus_one(damping: float) -> None:
    """1 + 2p + q = 4 − 4DΦ − Φ² = 0."""
    limit = sw.stability_limit(sw.Oscillator(2.0, damping), "false_euler")
    assert limit == pytest.approx((2 * math.sqrt(1 + damping**2) - 2 * damping) / 2.0, rel=1e-13)
    assert limit.mode.eigenvalue == pytest.approx(-1.0, abs=1e-6)


@pytest.mark.parametrize("method", [m for m in METHODS if sw.method(m).limit])
def test_limits_of_a_chain_are_those_of_its_fastest_mode(method: str) -> None:
    n = 9
    fastest = 2 * math.sin(n * math.pi / (2 * (n + 1)))
    limit = sw.stability_limit(sw.Chain(n), method)
    assert limit == pytest.approx(sw.method(method).limit / fastest, rel=1e-12)
    mode = limit.mode
    assert mode.rate == pytest.approx(1j * fastest, abs=1e-12)
    shape = np.sin(n * np.pi * np.arange(1, n + 1) / (n + 1))
    np.testing.assert_allclose(mode.y / mode.y[0], shape / shape[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(mode.v / mode.v[0], shape / shape[0], rtol=0, atol=1e-6)


def test_a_chain_that_floats_is_limited_by_what_swings() -> None:
    limit = sw.stability_limit(sw.Chain(3, stiffness=[0.0, 1.0, 1.0, 0.0]), "false_euler")
    assert limit == pytest.approx(2 / math.sqrt(3), rel=1e-12)
    assert limit.mode.y == pytest.approx(limit.mode.y[1] * np.array([-0.5, 1, -0.5]), abs=1e-6)
    lone = sw.stability_limit(sw.Chain(1, stiffness=0.0), "rk4")
    assert (float(lone), lone.mode) == (math.inf, None)  # a free mass: no step is too large


def test_limits_of_a_batch() -> None:
    omega = np.linspace(0.5, 20.0, 50)
    limits = sw.stability_limit(sw.Oscillator(omega, 0.1), "rk4")
    assert limits.shape == limits.modes.shape == (50,)
    for i in (0, 20, 49):
        one = sw.stability_limit(sw.Oscillator(omega[i], 0.1), "rk4")
        assert limits[i] == one
        assert limits.modes[i].rate == one.mode.rate
    mixed = sw.stability_limit(sw.Oscillator(1.0, np.array([-0.1, 0.0, 0.1])), "standard_heun")
    assert mixed[0] == mixed[1] == 0.0 < mixed[2]
    assert mixed.modes[0].kind == "unstable oscillation of the exact solution too"
    assert mixed.modes[1].kind == "unstable oscillation"
    assert (2 * limits).modes is None


def test_inputs_do_not_matter() -> None:
    driven = sw.Oscillator(1.3, 0.2, x=sw.Sinusoid(1.0, 3.0), a=0.5)
    assert sw.stability_limit(driven, "rk4") == sw.stability_limit(sw.Oscillator(1.3, 0.2), "rk4")


@pytest.mark.parametrize("method", DAMPABLE)
@pytest.mark.parametrize("damping", [0.02, 0.4])
def test_limits_from_both_sides(method: str, damping: float) -> None:
    """A thousandth below, samples die away; a thousandth above, they grow at the predicted rate."""
    limit = sw.stability_limit(sw.Oscillator(1.0, damping), method)
    assert limit > 0
    phi = float(limit) * np.array([0.999, 1.001])
    a = sw.analyse(sw.Oscillator(phi, damping), method, dt=1.0)
    assert a.radius[0] < 1 < a.radius[1]
    steps = int(20 / abs(math.log(a.radius[1])))
    run = sw.integrate(sw.Oscillator(phi, damping), method, v=0.3, y=1.0, dt=1.0, steps=2 * steps, every=steps)
    size = np.hypot(run.v, run.y)
    assert size[2, 0] < 1 < size[2, 1]
    grown = np.log(size[2, 1] / size[1, 1])
    # e²⁰ of growth; the direction within the ellipse of the growing mode may change the length by its ratio of axes (≤ 50).
    assert grown == pytest.approx(steps * math.log(a.radius[1]), abs=math.log(50))


@pytest.mark.parametrize("method", METHODS)
def test_limits_of_a_pendulum_and_of_a_libration_point(method: str) -> None:
    """Hanging, it is an oscillator; standing, it falls. At L4 two oscillations, of which the frame couples velocities."""
    pendulum = sw.Pendulum(3.0)
    undamped = sw.method(method).limit
    assert sw.stability_limit(pendulum, method, at=(0.0, 0.0)) == pytest.approx(undamped / 3, rel=1e-13)
    if sw.method(method).evaluations == 1:  # others look at angles that the swing comes to within the step
        swung = sw.stability_limit(pendulum, method, at=(0.0, np.array([0.0, 1.0])))  # ω² = 9·cos y
        assert swung == pytest.approx(undamped / 3 / np.sqrt(np.cos([0.0, 1.0])), rel=1e-13)
    assert sw.stability_limit(pendulum, method, at=(0.0, math.pi)) == 0.0
    if method in ("rk4", "merson"):
        mu = 0.012277471
        at = np.zeros(2), np.array([0.5 - mu, math.sqrt(0.75)])
        # ω⁴ − ω² + 27μ(1 − μ)/4 = 0; all four rates are imaginary, and both methods are functions of the rates.
        fastest = math.sqrt(0.5 + math.sqrt(0.25 - 6.75 * mu * (1 - mu)))
        limit = sw.stability_limit(sw.RestrictedThreeBody(mu), method, at=at)
        assert limit == pytest.approx(undamped / fastest, rel=1e-12)


def test_a_limit_at_a_state() -> None:
    """A system that is not linear, taken for linear at a state; bodies that attract each other leave it by themselves."""
    with pytest.raises(UnsupportedError, match="is not linear; give"):
        sw.stability_limit(sw.NBody(), "rk4")
    with pytest.raises(DTypeError, match=r"at: expected a pair \(v, y\) of blocks, got Run"):
        sw.stability_limit(sw.Pendulum(), "rk4", at=sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1))
    with pytest.raises(ShapeError, match=r"v \(2,\), y \(3,\)"):
        sw.stability_limit(sw.Pendulum(), "rk4", at=(np.zeros(2), np.zeros(3)))
    scene = sw.scenes.clover()
    limit = sw.stability_limit(scene.system, "false_euler", at=(scene.v, scene.y))
    assert limit == 0.0
    assert limit.mode.kind.endswith("of the exact solution too")
    same = sw.stability_limit(sw.Chain(2), "false_euler", at=(np.zeros(2), np.ones(2)))
    assert same == pytest.approx(float(sw.stability_limit(sw.Chain(2), "false_euler")), rel=1e-12)


# ---- series and counts

RATIOS = {
    "standard_euler": ((2, "-1/3"),),
    "damped_euler": ((2, "1/24"), (4, "3/640")),
    "false_euler": ((2, "1/24"), (4, "3/640")),
    "verlet": ((2, "1/24"), (4, "3/640")),
    "leapfrog": ((2, "1/24"), (4, "3/640")),
    "standard_heun": ((2, "1/6"), (4, "-1/20")),
    "false_heun": ((2, "-11/96"),),
    "semi_false_heun": ((2, "-1/12"), (4, "7/160")),
    # The imaginary part of ln(R(z)·e⁻ᶻ), z = iΦ.
    "rk4": ((4, "-1/120"), (6, "1/336")),
    "merson": ((4, "-1/720"), (6, "-1/2016")),
    "fehlberg": ((4, "1/780"), (6, "-1/546")),
    "fehlberg_5": ((6, "-31/43680"), (8, "5/67392")),
}
RADII = {
    "standard_euler": ((2, "1"),),
    "damped_euler": (),
    "false_euler": (),
    "verlet": (),
    "leapfrog": (),
    "standard_heun": ((4, "1/4"),),
    "false_heun": ((2, "-1/2"),),
    "semi_false_heun": ((4, "-1/4"),),
    "rk4": ((6, "-1/72"), (8, "1/576")),
    "merson": ((8, "-1/1728"), (10, "1/20736")),
    "fehlberg": ((6, "5/936"), (8, "-11/7488"), (10, "1/10816")),
    "fehlberg_5": ((6, "17/9360"), (8, "-7/12480"), (10, "11/374400"), (12, "1/4326400")),
}


@pytest.mark.parametrize("method", sorted(RATIOS))
def test_series_are_those_of_computer_algebra(method: str) -> None:
    found = series(method)
    assert found.ratio_terms(len(RATIOS[method])) == [(k, Fraction(c)) for k, c in RATIOS[method]]
    assert found.radius_terms(9) == [(k, Fraction(c)) for k, c in RADII[method]]


@pytest.mark.parametrize(
    ("method", "radius", "ratio"),
    [
        (other.MERSON_4, (8, -1 / 1728), (4, -1 / 720)),
        (other.FEHLBERG_4, (6, 5.342e-3), None),
        (other.FEHLBERG_5, (6, 1.816e-3), (6, -7.1e-4)),
        (other.DORMAND_PRINCE_5, (6, -1 / 1800), (6, 1 / 2100)),
        (other.FOREST_RUTH, None, (4, -6.614e-2)),
        (other.PEFRL, None, (4, -6.054e-5)),
    ],
)
def test_series_of_methods_that_are_not_in_the_catalogue(method: Any, radius: Any, ratio: Any) -> None:
    found = series(method)
    if radius is None:
        assert found.radius_terms() == []  # a product of shears: the determinant is 1, whatever the coefficients
    else:
        assert found.radius_terms(1)[0] == pytest.approx(radius, rel=1e-3)
    if ratio is not None:
        assert found.ratio_terms(1)[0] == pytest.approx(ratio, rel=1e-2)


@pytest.mark.parametrize("method", METHODS)
def test_series_approach_the_exact_values(method: str) -> None:
    """With terms up to Φ¹² the rest is some Φ¹⁴ = 6e-8 at Φ = 0.3, and less for the exact r₁²."""
    found = series(method)
    a = sw.analyse(sw.Oscillator(), method, dt=0.3)
    assert a.frequency_ratio == pytest.approx(found.ratio(0.3), abs=1e-7)
    assert a.q == pytest.approx(found.q(0.3), abs=20 * EPS)
    assert a.p == pytest.approx(found.p(0.3), abs=20 * EPS)


@pytest.mark.parametrize(
    ("method", "counts"),
    [
        # Two products with Φ and two sums (§8: "two multiplications and two additions per step").
        ("standard_euler", (2, 2, 0, 0, 1, 1)),
        ("damped_euler", (2, 2, 0, 0, 1, 1)),
        ("false_euler", (2, 2, 0, 0, 1, 1)),
        # 2y − y_prev + Φ·(Φ·y): two sums, three products.
        ("verlet", (2, 3, 0, 0, 1, 1)),
        # Four increments, of a product each; two predictions, two means of two, two sums; two halves.
        ("standard_heun", (6, 6, 0, 0, 2, 2)),
        # Eight increments; six predictions, half of them of half an increment, two sums; each mean 3 sums and 3 products.
        ("rk4", (14, 18, 0, 0, 4, 4)),
    ],
)
def test_operations_counted_by_hand(method: str, counts: tuple[int, ...]) -> None:
    assert tuple(operations(method)) == counts


def test_operations_of_other_systems() -> None:
    """Three bodies: a pair has 2 differences, 2 squares, 2 sums, 1 quotient, 6 products, 4 sums; a body 6 sums and 2 products."""
    o = operations("false_euler", sw.NBody())
    assert (o.additions, o.multiplications, o.divisions) == (3 * (2 + 2 + 4) + 3 * 6 + 12, 3 * (2 + 6) + 6, 3)
    assert operations("rk4", sw.NBody()).rate_evaluations == sw.method("rk4").evaluations
    with pytest.raises(ShapeError, match="one member"):
        operations("rk4", sw.Oscillator([1.0, 2.0]))
    with pytest.raises(UnsupportedError):
        operations("verlet", sw.Oscillator(1.0, 0.1))


@pytest.mark.parametrize("method", METHODS)
def test_the_record_has_the_evaluations(method: str) -> None:
    o = operations(method)
    assert o.rate_evaluations == sw.method(method).evaluations
    # PEFRL begins and ends with a drift: one more of the rate that costs nothing.
    assert o.rate_evaluations_y == sw.method(method).evaluations + (method == "pefrl")


def test_polynomials() -> None:
    x = Polynomial(0, 1)
    p = (1 + x) * (2 - x) / 2 - x * 0.25
    assert p.coefficients == (Fraction(1), Fraction(1, 4), Fraction(-1, 2))
    assert p(Fraction(2)) == Fraction(-1, 2)
    assert p(2.0) == -0.5
    assert Polynomial(1 / 6)[0] == Fraction(1, 6)  # what a float stands for
    assert Polynomial(math.pi)[0] == Fraction(math.pi)  # where it stands for itself
    assert (x - x).coefficients == ()
    assert (x * x - 2).root_near(1.4) == math.sqrt(2)
    assert Polynomial(1).root_near(0.5) == math.inf


def test_eigenvalues_that_meet() -> None:
    """The elements of a double root are told apart by rounding alone: ((a − d)/2)² + bc is 0 to some eps, not its root."""
    a = sw.analyse(sw.Oscillator(), "false_euler", dt=np.nextafter(2.0, 1.0))
    assert np.abs(a.eigenvalues + 1).max() < 1e-7
    z = eigen.eigenvalues(np.array([[1.0, 1.0], [0.0, 1.0]]))
    assert z.tolist() == [1, 1]
    assert eigen.eigenvalues(np.array([[0.0, 0.0], [0.0, 0.0]])).tolist() == [0, 0]
    assert eigen.eigenvalues(np.array([[-0.5]])).tolist() == [-0.5]
    small = eigen.eigenvalues(np.array([[1e8, 1.0], [1.0, 2e-8]]))  # the small root keeps its digits: det/far = 1/1e8
    assert small[1].real == pytest.approx(1e-8, rel=1e-7)


# ---- criteria


def test_criteria() -> None:
    found = sw.criteria(phi=[0.5, 1.0])
    assert [c.method for c in found] == list(sw.methods())
    by_name = {c.method.name: c for c in found}
    euler = by_name["false_euler"]
    assert euler.samples_per_period == pytest.approx(math.pi)
    assert euler.at[1].deviation == pytest.approx(math.pi / 3 - 1, abs=1e-12)  # Ψ = 2·asin(½) at Φ = 1
    assert euler.at[1].deviation_series == pytest.approx(1 / 24 + 3 / 640)
    assert by_name["standard_heun"].at[0].r1_squared == pytest.approx(1 + 0.5**4 / 4, abs=1e-14)
    assert by_name["standard_heun"].r1_squared == "Φ⁴/4"
    assert by_name["false_heun"].deviation == "−11Φ²/96 − 597Φ⁴/10240"
    assert by_name["standard_euler"].samples_per_period == math.inf
    rows = found.rows()
    assert json.loads(json.dumps(rows)) == rows
    assert rows[0]["samples_per_period"] is None
    text = found.markdown()
    assert text.count("\n") == 2 + len(found)
    for c in found:
        assert f"| {c.method.title} |" in text


def test_criteria_file(tmp_path: Any) -> None:
    found = sw.criteria(["rk4"], phi=0.3)
    found.to_json(tmp_path / "c.json")
    assert json.loads((tmp_path / "c.json").read_text(encoding="utf-8")) == json.loads(json.dumps(found.rows()))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"methods": "rk4"}, "expected a list of names"),
        ({"methods": []}, "methods: expected at least one"),
        ({"methods": ["rk5"]}, "there is no 'rk5'"),
        ({"phi": 0.0}, "phi: expected numbers above zero"),
        ({"phi": [[1.0]]}, "phi: expected a list"),
    ],
)
def test_criteria_say_what_is_wrong(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        sw.criteria(**arguments)


def test_maps_of_finish() -> None:
    """Verlet's slots (y_prev, y) to states: the velocity of the present instant."""
    chain = sw.Chain(2)
    dt = np.asarray(0.3)
    to_state = maps.finish(chain, sw.method("verlet"), dt, ())
    run = sw.integrate(chain, "verlet", v=[0.1, 0.2], y=[1.0, -1.0], dt=0.3, steps=5)
    assert run.carry is not None
    state = to_state @ np.concatenate([run.carry, run.y[-1]])
    np.testing.assert_allclose(state, np.concatenate([run.v[-1], run.y[-1]]), rtol=0, atol=20 * EPS)
