"""The pendulum and the restricted problem of three bodies: what tests over all systems do not say."""

import math

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability.counted import operations
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.reference import trig
from support.calls import assert_raises
from support.for_each import for_each

METHODS = [m.name for m in sw.methods()]


@for_each("method", METHODS)
def test_below_the_pendulum_is_the_oscillator(method):
    bottom, spring = sw.Pendulum(1.3), sw.Oscillator(1.3, form="physical")
    analysis, wanted = sw.analyse(bottom, method, dt=0.4, at=(0.0, 0.0)), sw.analyse(spring, method, dt=0.4)
    np.testing.assert_allclose(analysis.P, wanted.P, rtol=0, atol=1e-14)
    np.testing.assert_allclose(analysis.eigenvalues, wanted.eigenvalues, rtol=0, atol=1e-14)
    assert analysis.kind == wanted.kind
    limit, known = sw.stability_limit(bottom, method, at=(0.0, 0.0)), sw.stability_limit(spring, method)
    assert float(limit) == pytest.approx(float(known), rel=1e-9)


def test_off_the_bottom_the_pendulum_is_softer_and_above_it_falls():
    away = sw.analyse(sw.Pendulum(), "rk4", dt=0.01, at=(0.0, 1.0))
    assert float(away.omega) == pytest.approx(math.sqrt(math.cos(1.0)), rel=1e-4)  # it moves while it steps
    assert away.true_angle == pytest.approx(0.01 * math.sqrt(math.cos(1.0)), rel=1e-13)
    top = sw.analyse(sw.Pendulum(), "rk4", dt=0.01, at=(0.0, math.pi))
    assert top.radius == pytest.approx(math.exp(0.01), rel=1e-10)
    assert not top.stable


def test_a_damped_pendulum_is_a_damped_oscillator_for_any_push():
    push = sw.Sinusoid(0.3, 2.0)
    analysis = sw.analyse(sw.Pendulum(1.3, 0.2, a=push), "false_euler", dt=0.4, at=(0.0, 0.0), t=1.7)
    wanted = sw.analyse(sw.Oscillator(1.3, 0.2, form="physical"), "false_euler", dt=0.4)
    np.testing.assert_allclose(analysis.P, wanted.P, rtol=0, atol=1e-15)


def test_a_small_push_moves_pendulum_and_oscillator_alike():
    arguments = {"v": 0.0, "y": 1e-8, "dt": 0.05, "steps": 400}
    for more in ({}, {"a": 1e-8}, {"damping": 0.1, "a": sw.Sinusoid(1e-8, 1.1)}):
        swing = sw.integrate(sw.Pendulum(1.3, **more), "rk4", **arguments)
        spring = sw.integrate(sw.Oscillator(1.3, **more, form="physical"), "rk4", **arguments)
        np.testing.assert_allclose(swing.y, spring.y, rtol=0, atol=1e-20)


def test_the_pendulum_keeps_its_energy():
    run = sw.integrate(sw.Pendulum(1.3), "rk4", v=0.0, y=2.0, dt=0.01, steps=2000, every=10)
    np.testing.assert_allclose(run.energy, 1.3**2 * (1.0 - math.cos(2.0)), rtol=1e-8)
    tiny = sw.Pendulum(2.0).energy(np.zeros(()), np.asarray(1e-12))
    assert tiny == pytest.approx(0.5 * 4.0 * 1e-24, rel=1e-12)


def test_the_sine_of_numbers_that_only_the_analysis_knows():
    x = np.linspace(-9.0, 9.0, 101)
    derivative = trig.sin(x + 1e-200j).imag / 1e-200
    np.testing.assert_allclose(derivative, trig.cos(x), rtol=4e-16)  # the product and the quotient round
    np.testing.assert_array_equal(trig.sin(x + 1e-200j).real, trig.sin(x))
    plain, swing = operations("rk4", sw.Oscillator(form="physical")), operations("rk4", sw.Pendulum())
    assert swing.rate_evaluations == plain.rate_evaluations == 4
    assert swing.multiplications - plain.multiplications == 4 * 14
    assert swing.additions - plain.additions == 4 * 12


def test_the_triangle_stands_still():
    """Lagrange's L4 makes an equilateral triangle with the two; linear stability ends at Routh's μ = 0.0385."""
    for mu, stable in ((0.0121, True), (0.038, True), (0.039, False), (0.3, False)):
        at = np.zeros(2), np.array([0.5 - mu, math.sqrt(0.75)])
        scaled = sw.RestrictedThreeBody(mu).scaled(1.0, ())
        np.testing.assert_allclose(scaled.dv(0.0, *at), 0.0, rtol=0, atol=1e-15)
        a = sw.analyse(sw.RestrictedThreeBody(mu), "rk4", dt=0.01, at=at)
        assert (a.rates.real.max() < 1e-6) == stable


def test_two_equal_bodies_are_a_mirror():
    """μ and 1 − μ change places when x and y, and so v, change their signs."""
    v, y = np.array([0.1, -0.5]), np.array([0.4, 0.3])
    one = sw.integrate(sw.RestrictedThreeBody(0.25), "rk4", v=v, y=y, dt=0.01, steps=200)
    other = sw.integrate(sw.RestrictedThreeBody(0.75), "rk4", v=-v, y=-y, dt=0.01, steps=200)
    np.testing.assert_allclose(one.y, -other.y, rtol=1e-11)


def test_forces_of_the_velocity_are_refused_by_verlet():
    for system, term in ((sw.Pendulum(damping=0.1), "damping"), (sw.RestrictedThreeBody(), "the Coriolis force")):
        with pytest.raises(UnsupportedError, match=term):
            sw.integrate(system, "verlet", v=np.zeros(system.v_shape), y=np.ones(system.y_shape), dt=0.1, steps=1)
    with pytest.raises(UnsupportedError, match="form: only linear systems"):
        sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, form="matrix")


def test_what_cannot_be_is_refused():
    three, zero = sw.RestrictedThreeBody(), np.zeros(3)
    assert_raises(
        (lambda: sw.Pendulum(0.0), "omega: expected numbers above zero"),
        (lambda: sw.Pendulum([1.0, 2.0], [0.1, 0.2, 0.3]), "omega.*damping"),
        (lambda: sw.Pendulum(a=float("inf")), "a: "),
        (lambda: sw.RestrictedThreeBody(0.0), "mu: expected shares of the mass above 0 and below 1, got 0"),
        (lambda: sw.RestrictedThreeBody([0.1, 1.0]), "mu: expected shares of the mass above 0 and below 1, got 1"),
        (lambda: sw.analyse(sw.Pendulum(), "rk4", dt=0.1), r"at: Pendulum\(omega=1.0\) is not linear"),
        (lambda: sw.integrate(three, "rk4", v=zero, y=zero, dt=0.1, steps=1), r"v: expected shape \(2, batch…\)|x and y"),
        kind=ArgumentError,
    )


def test_they_say_what_they_are():
    assert repr(sw.Pendulum(2.0, [0.1, 0.2])) == "Pendulum(omega=2.0, damping=array(2,))"
    assert repr(sw.RestrictedThreeBody()) == "RestrictedThreeBody(mu=0.012277471)"
