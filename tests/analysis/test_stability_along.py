"""Stability limits along a run: against closed forms, against ``stability_limit``, and against runs."""

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import along
from support.looped import looped
from support.stability_cases import METHODS, OF_EACH_STRUCTURE

EPS = np.finfo(float).eps


@looped("method", ["false_euler", "leapfrog", "verlet", "pefrl", "rk4", "merson", "semi_false_heun"])
def test_the_pendulum_is_stiffest_where_it_hangs(method: str) -> None:
    """Where cos y > 0 the limit is that of an oscillator of ω₀²·cos y; the smallest is where y is nearest to 0."""
    run = sw.integrate(sw.Pendulum(1.5), "rk4", v=0.0, y=1.2, dt=0.01, steps=600, every=3)
    along = sw.stability_along(run, method)
    true = sw.method(method).limit / (1.5 * np.sqrt(np.cos(run.y)))
    # The square root halves what the cosine is off by: an ulp of 1 of 0.36 at least.
    np.testing.assert_allclose(along.limits, true, rtol=1e-9 if method in ("verlet", "rk4", "merson") else 1e-12)
    assert along.index == np.abs(run.y).argmin()
    assert along.when == run.t[along.index]
    assert along.dt == along.limits[along.index] == along.limits.min()
    assert along.mode.rate == pytest.approx(1.5j * np.sqrt(np.cos(run.y[along.index])), abs=1e-12)
    np.testing.assert_allclose(along.growth, 0.0, atol=1e-12)
    assert not along.exceeded.any()
    # The limit at the mode: half a turn by the methods that keep volumes, and by Semi-False Heun.
    if method in ("false_euler", "leapfrog", "verlet", "pefrl", "semi_false_heun"):
        assert along.mode.eigenvalue == pytest.approx(-1.0, abs=1e-6)


def test_what_grows_by_itself_does_not_count() -> None:
    """Above the horizontal the pendulum falls, and neither False Euler nor leapfrog has a limit there."""
    run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=3.0, dt=0.01, steps=200, every=10)
    along = sw.stability_along(run, "leapfrog")
    falls = np.cos(run.y) < 0
    assert falls.any()
    assert (along.limits[falls] == np.inf).all()
    np.testing.assert_allclose(along.growth[falls], np.sqrt(-np.cos(run.y[falls])), rtol=1e-12)


@looped("method", [*OF_EACH_STRUCTURE, "rosenbrock23"], long=METHODS)
def test_at_an_equilibrium_it_is_the_limit_there(method: str) -> None:
    """Damped or not, of one or of several bodies: a state that stays is one at which both ways say the same."""
    damped = None if sw.method(method).needs_acceleration else 0.1
    pendulum = sw.Pendulum(2.0, damped)
    run = sw.integrate(pendulum, "merson" if damped else method, v=0.0, y=0.0, dt=0.01, steps=2, every=1)
    along = sw.stability_along(run, method)
    there = sw.stability_limit(pendulum, method, v=0.0, y=0.0)
    # That of a step comes from its derivative, which is rounded otherwise; Verlet's in 2 − Φ².
    np.testing.assert_allclose(along.limits, float(there), rtol=1e-8)
    if along.mode is not None and 0 < there < np.inf:
        assert along.mode.kind == there.mode.kind
        assert abs(along.mode.rate - there.mode.rate) <= 1e-8 * abs(there.mode.rate)


@looped("method", OF_EACH_STRUCTURE, long=[m.name for m in sw.methods() if not m.is_implicit or m.name == "rosenbrock23"])
def test_scaled_limits_are_those_that_are_tried(method: str) -> None:
    """Of forces with an energy: one search for each direction of λ, or steps of many lengths for each state."""
    members = 1 if sw.method(method).has_series else 5  # the steps of a series go number by number
    draw = np.random.default_rng(1).normal(size=(3, 3, members))
    A = np.zeros((6, 6, members))
    A[:3, 3:] = draw + draw.swapaxes(0, 1)
    A[3:, :3] = 2.0 * np.eye(3)[:, :, np.newaxis]
    system = sw.Chain(3)  # three velocities and three coordinates
    scaled, tried = along._limits(system, sw.method(method), A), along._by_trying(sw.method(method), A, 3)
    # By trying, a pair of eigenvalues that meets at −1 leaves the circle with the square root of the excess: one sees the start
    # of it to within tolerance² of 10⁻¹³, relative; a crossing at an angle to 10⁻¹³ over its slope.
    np.testing.assert_allclose(scaled.limits, tried.limits, rtol=1e-7)


def test_a_linear_system_has_one_limit_and_a_batch_one_for_each_member() -> None:
    system = sw.LinearSystem([[-2.0, 1.0, 0.0], [0.0, -3.0, 1.0], [1.0, 0.0, -1.0]], velocities=1)
    run = sw.integrate(system, "rk4", v=np.ones(1), y=np.ones(2), dt=0.1, steps=3, every=1)
    for method in ("rk4", "merson", "false_euler"):
        along = sw.stability_along(run, method)
        np.testing.assert_allclose(along.limits, float(sw.stability_limit(system, method)), rtol=1e-9)
    omega = np.array([1.0, 3.0])
    run = sw.integrate(sw.Pendulum(omega), "rk4", v=0.0, y=np.array([[0.5], [1.0], [1.4]]), dt=0.01, steps=300, every=10)
    along = sw.stability_along(run, "false_euler")
    assert along.dt.shape == along.index.shape == along.when.shape == along.mode.shape == (3, 2)
    for i in range(3):
        for j in range(2):
            alone = sw.integrate(sw.Pendulum(omega[j]), "rk4", v=0.0, y=run.y[0, i, j], dt=0.01, steps=300, every=10)
            one = sw.stability_along(alone, "false_euler")
            assert along.dt[i, j] == pytest.approx(one.dt, rel=1e-12)
            assert along.index[i, j] == one.index
            assert along.mode[i, j].rate == pytest.approx(one.mode.rate, rel=1e-12)


def test_the_limit_of_an_orbit_is_at_its_pericentre_and_past_a_limit_runs_grow() -> None:
    scene = sw.scenes.kepler()
    run = scene.run("leapfrog", 0.001, steps=7000, every=7)
    along = sw.stability_along(run)
    d = run.y[:, 0] - run.y[:, 1]
    r = np.sqrt((d * d).sum(axis=1))
    assert along.index == r.argmin()
    # Across the line between the bodies the force is M/r³ times the distance, with M the sum of G·m.
    M = float(np.sum(scene.system.masses * scene.system.G))
    np.testing.assert_allclose(along.limits, 2.0 / np.sqrt(M / r**3), rtol=1e-9)
    np.testing.assert_allclose(along.growth, np.sqrt(2.0 * M / r**3), rtol=1e-9)
    # A stiff pendulum that hangs almost still: below the limit it stays, above it does not.
    start = {"v": 0.0, "y": 1e-6}
    run = sw.integrate(sw.Pendulum(1.0, 0.3), "false_euler", **start, dt=0.01, steps=10, every=1)
    limit = float(sw.stability_along(run).dt)
    below, above = (sw.integrate(sw.Pendulum(1.0, 0.3), "false_euler", **start, dt=limit * by, steps=2000) for by in (0.99, 1.01))
    assert abs(below.y[-1]) < 1e-6
    assert abs(above.y[-1]) > 1e-3


def test_what_has_no_limit() -> None:
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(sw.LinearSystem([[1e200]], velocities=0), "rk4", v=np.zeros(0), y=np.ones(1), dt=1.0, steps=3, every=1)
    assert sw.stability_along(run).limits.shape == (4,)
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(sw.NBody([1.0, 1.0]), "rk4", v=0.0, y=np.zeros((2, 2)), dt=0.1, steps=2, every=1)
    along = sw.stability_along(run)
    assert np.isnan(along.limits[1:]).all()
    with pytest.raises(sw.errors.DTypeError, match="run: expected what integrate returns"):
        sw.stability_along(sw.Pendulum())  # type: ignore[arg-type]
    run = sw.integrate(sw.Pendulum(1.0, 0.1), "rk4", v=0.0, y=1.0, dt=0.1, steps=2)
    with pytest.raises(sw.errors.UnsupportedError):
        sw.stability_along(run, "verlet")
    adaptive = sw.integrate(sw.Pendulum(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[0.0, 1.0])
    with pytest.raises(sw.errors.ArgumentError, match="fixed step"):
        _ = sw.stability_along(adaptive).exceeded
