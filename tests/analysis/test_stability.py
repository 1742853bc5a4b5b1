"""Transition matrices, their eigenvalues and what is said of them, against closed forms."""

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import KINDS, operations
from support.looped import looped
from support.stability_cases import DEAR, EPS, METHODS, OF_EACH_STRUCTURE, QUICK
from support.truths import CLOSED_FORMS


def closed(method: str, phi: Any) -> tuple[Any, Any]:
    """p and q of the closed form: half the trace of a step, and its determinant."""
    steps = np.array([CLOSED_FORMS[method](x) for x in phi])
    return np.trace(steps, axis1=1, axis2=2) / 2, steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0]


@looped("method", CLOSED_FORMS)
def test_p_q_and_eigenvalues(method: str) -> None:
    phi = np.linspace(0.05, 3.0, 60)
    a = sw.analyse(sw.Oscillator(), method, dt=phi)
    p, q = closed(method, phi)
    # Elements of P up to Φ⁴/2 = 40, each of some roundings; p and q are sums and products of them.
    np.testing.assert_allclose(a.p, p, rtol=0, atol=200 * EPS)
    np.testing.assert_allclose(a.q, q, rtol=0, atol=200 * 40 * EPS)
    np.testing.assert_allclose(a.polynomial, [np.ones(60), -2 * a.p, a.q], rtol=0, atol=0)
    for i, f in enumerate(phi):
        z = np.sort_complex(np.roots([1, -2 * p[i], q[i]]))
        # Near a double root an error e of the coefficients moves it by √e.
        np.testing.assert_allclose(np.sort_complex(a.eigenvalues[:, i]), z, rtol=0, atol=3e-6 if f == 2 else 1e-7)
        assert a.radius[i] == pytest.approx(np.abs(z).max(), abs=1e-7)


@looped("method", METHODS)
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


@looped("method", METHODS)
def test_input_matrix(method: str) -> None:
    """Q is what a held input makes in a step from rest; the sum over the nodes of what the matrix form takes."""
    second_order = sw.method(method).needs_acceleration
    system = sw.Oscillator(1.3, None if second_order else 0.2)
    a = sw.analyse(system, method, dt=0.4)
    assert a.inputs == ("x", "a")
    assert a.slots == [sw.method(method).carry or "v", "y"]
    for j, name in enumerate(a.inputs):
        driven = sw.Oscillator(1.3, system.damping, **{name: 1.0})
        start = "first_order" if method == "verlet" else None  # y_prev = y₀ − h·v₀ = 0
        run = sw.integrate(driven, method, v=0.0, y=0.0, dt=0.4, steps=3, every=1, start=start)
        s = np.zeros(2)
        if method in ("leapfrog", "wisdom_holman"):  # half a kick back from rest
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


@looped(
    "method, damping, phi, kind, stable",
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


@looped("method", ["false_euler", "damped_euler", "verlet"])
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


def test_what_the_document_says_wrongly_of_the_false_heuns() -> None:
    """§11 says so. The samples are a damped oscillation below 1.5723 and grow, changing signs, above."""
    limit = sw.method("semi_false_heun").limit
    for phi, kind in ((limit - 1e-3, "damped oscillation"), (limit + 1e-3, "unstable oscillation")):
        a = sw.analyse(sw.Oscillator(), "semi_false_heun", dt=phi)
        assert a.kind == kind
        run = sw.integrate(sw.Oscillator(), "semi_false_heun", v=0.0, y=1.0, dt=phi, steps=20_000, every=10_000)
        assert math.log(abs(run.y[-1] / run.y[1])) == pytest.approx(10_000 * math.log(a.radius), abs=10_000 * 50 * EPS)
        assert a.q == pytest.approx(1 - phi**4 / 4, abs=20 * EPS)  # below 1 on both sides: r₁² = q holds for pairs only
    phi = 0.9
    a = sw.analyse(sw.Oscillator(), "false_heun", dt=phi)
    off = phi * (1 - phi**2 / 2)
    misprinted = (1 - phi**2 / 2) ** 2 + off**2
    assert a.q == pytest.approx(1 - phi**2 / 2, abs=8 * EPS)
    assert misprinted - a.q == pytest.approx(0.04579, abs=1e-5)


@looped("method", ["standard_euler", "standard_heun", "rk4", "merson", "fehlberg", "fehlberg_5", "taylor"])
def test_growth_over_thousands_of_steps(method: str) -> None:
    """The energy of the canonical oscillator is multiplied by r₁² each step, because P is r₁ times a rotation."""
    # Fehlberg's results pump energy in, Merson's and RK4's take it out.
    phi = np.array([0.01, 0.1, 0.3, 1.0])
    a = sw.analyse(sw.Oscillator(phi), method, dt=1.0)
    _, q = closed(method, phi)
    np.testing.assert_allclose(a.radius**2, q, rtol=0, atol=20 * EPS)
    run = sw.integrate(sw.Oscillator(phi), method, v=0.0, y=1.0, dt=1.0, steps=1000)
    np.testing.assert_allclose(np.log(2 * run.energy[-1]), 1000 * np.log(q), rtol=0, atol=1000 * 40 * EPS)
    assert ((a.radius > 1) == (method in ("standard_euler", "standard_heun", "fehlberg", "fehlberg_5")))[1:].all()


@looped("method", [*QUICK, "rosenbrock23"], long=[m for m in DEAR if m != "rosenbrock23"])
def test_derivative_of_the_reference_is_the_matrix_of_the_core(method: str) -> None:
    """At any state of a linear system the complex step gives what unit vectors give, to rounding."""
    chain = sw.Chain(3, stiffness=[1.0, 2.0, 0.5, 0.0])
    rng = np.random.default_rng(1)
    at = rng.normal(size=(2, 3))
    exact = sw.analyse(chain, method, dt=0.3)
    derived = sw.analyse(chain, method, dt=0.3, at=(at[0], at[1]))
    np.testing.assert_allclose(derived.P, exact.P, rtol=0, atol=30 * EPS)
    np.testing.assert_allclose(np.abs(derived.rates), np.abs(exact.rates), rtol=0, atol=1e-12)


@looped("force", ["logarithmic", "newton", "printed"])
@looped(
    "control",
    [
        sw.EnergyControl(0.3, target=-0.2),
        sw.EnergyControl(0.3, form="printed", target=-0.2),
        sw.Projection(target=-0.2),
        sw.Projection("nacozy", target=-0.2),
    ],
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


@looped("method", METHODS)
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


@looped("method", OF_EACH_STRUCTURE, long=METHODS)
@looped("omega", [2.0**-40, 2.0**40])
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
