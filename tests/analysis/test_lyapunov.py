"""Lyapunov exponents that are known: of linear systems, by symmetry, by volume; and that states are those of ``integrate``."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.dynamics import Lyapunov, exponents
from stepwell.errors import UnsupportedError
from stepwell.model.systems import System
from support.looped import looped

EPS = np.finfo(float).eps
#: Three bodies near each other.
THREE = np.array([[0.9, 0.1], [-0.5, 0.8], [-0.4, -0.9]])


@looped("method", ["standard_euler", "false_euler", "rk4", "merson", "false_heun"])
def test_of_a_linear_system_they_are_the_logarithms_of_the_eigenvalues(method: str) -> None:
    """Real rates far apart, so that vectors find their directions: ln|z|/dt of the method's own step."""
    system = sw.LinearSystem([[-1.0, 0.3, 0.1], [0.2, -2.0, 0.4], [0.1, 0.5, 0.5]], velocities=1)
    dt, transient, steps = 0.05, 1000, 600
    spectrum = sw.lyapunov(
        system, method, v=np.zeros(1), y=np.zeros(2), dt=dt, steps=steps, transient=transient, exponents="all", every=7
    )
    radii = sw.analyse(system, method, dt=dt).radii
    # After the transient, directions are off by the ratio of two radii to the power of 1000: e^(−50·1.1) at most, which is below
    # eps. Each step rounds some ten times on each number of vectors of length 1, and so does each orthonormalisation; that is
    # eps/dt of a rate, and adds up over the condition of the eigenvectors, below 2 here.
    np.testing.assert_allclose(spectrum.exponents, np.sort(np.log(radii) / dt)[::-1], rtol=0, atol=40 * EPS / dt)
    assert spectrum.history.shape == (-(-steps // 7), 3)
    assert spectrum.t[-1] == (transient + steps) * dt


def test_one_exponent_is_the_largest_of_all_and_long_steps_are_refused() -> None:
    system = sw.LinearSystem([[-1.0, 0.3], [0.2, 0.5]])
    arguments = {"v": 0.0, "y": 0.0, "dt": 0.1, "steps": 200, "transient": 400}
    every = sw.lyapunov(system, "rk4", exponents="all", **arguments).exponents
    np.testing.assert_allclose(sw.lyapunov(system, "rk4", **arguments).exponents, every[:1], rtol=0, atol=40 * EPS / 0.1)
    np.testing.assert_allclose(sw.lyapunov(system, "rk4", exponents=2, **arguments).exponents, every, rtol=0, atol=40 * EPS / 0.1)
    y = np.random.default_rng(1).random((500, 2))
    with pytest.raises(UnsupportedError, match=r"at most 100,000 operations.* about 11,000,000 for NBody"):
        sw.lyapunov(sw.NBody(np.ones(500)), "rk4", v=0.0, y=y, dt=0.1, steps=1)


@looped("method", ["false_euler", "leapfrog", "pefrl", "verlet", "rk4"])
def test_the_states_are_those_of_integrate(method: str) -> None:
    system = sw.Pendulum(np.array([1.0, 2.0]), a=sw.Sinusoid(0.5, 0.7, 0.1))
    v, y = np.array([0.3, 0.1]), np.array([[1.0], [2.0], [3.0]])
    spectrum = sw.lyapunov(system, method, v=v, y=y, dt=0.05, steps=60, transient=40, t0=2.0, every=8)
    run = sw.integrate(system, method, v=v, y=y, dt=0.05, steps=100, t0=2.0)
    np.testing.assert_array_equal(spectrum.y, run.y[-1])
    np.testing.assert_array_equal(spectrum.v, run.v[-1] if run.carry is None else run.carry)
    assert spectrum.exponents.shape == (1, 3, 2)


@pytest.mark.parametrize("method", ["false_euler", "verlet", "rk4", "taylor"])
def test_vectors_on_one_tape_and_each_beside_a_copy_of_the_state_are_the_same(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit: short steps go one way, long ones the other."""
    y = THREE[:, :, np.newaxis] * np.linspace(1.0, 1.1, 5)
    arguments: dict[str, Any] = {"v": 0.0, "y": y, "dt": 0.05, "steps": 43, "transient": 12, "exponents": 4}
    bodies = sw.NBody([1.0, 1.0, 1.0], softening=0.3)
    together = sw.lyapunov(bodies, method, **arguments)
    monkeypatch.setattr(exponents, "MAX_TOGETHER", 0)
    apart = sw.lyapunov(bodies, method, **arguments)
    for name in ("exponents", "history", "v", "y"):
        np.testing.assert_array_equal(getattr(apart, name), getattr(together, name))


@pytest.mark.parametrize("most", [20_000, 0])
@pytest.mark.parametrize("method", ["rk4", "verlet"])
def test_threads_share_members_and_change_nothing(method: str, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exponents, "MAX_TOGETHER", most)
    omega, y = np.linspace(1.0, 2.0, 4), np.linspace(0.5, 2.0, 3)[:, np.newaxis]
    pendulums = sw.Pendulum(omega, a=sw.Sinusoid(np.linspace(0.1, 0.5, 4), 0.7))
    arguments: dict[str, Any] = {"v": 0.1, "y": y, "dt": 0.05, "steps": 95, "transient": 25, "exponents": "all"}
    one = sw.lyapunov(pendulums, method, **arguments, threads=1)
    for threads in (2, 5, 100, None):
        several = sw.lyapunov(pendulums, method, **arguments, threads=threads)
        for name in ("exponents", "history", "v", "y"):
            np.testing.assert_array_equal(getattr(several, name), getattr(one, name))


def test_disturbances_obey_the_variational_equations() -> None:
    """The derivative of a step of rk4 is a step by rk4 of the variational equations, here written by hand."""

    @sw.system(order=1)
    def varied(t: Any, w: Any, *, sigma: Any = 10.0, rho: Any = 28.0, beta: Any = 8.0 / 3.0) -> Any:
        x, y, z, a, b, c = w
        rates = [sigma * (y - x), x * (rho - z) - y, x * y - beta * z]
        return [*rates, sigma * (b - a), a * (rho - z) - x * c - b, a * y + x * b - beta * c]

    y, steps, every, dt = near_the_attractor(8), 200, 10, 0.01
    spectrum = sw.lyapunov(Lorenz(), "rk4", y=y, dt=dt, steps=steps, every=every)
    start = np.cos(1.7 * np.arange(1.0, 4.0))
    w = np.concatenate([y, np.broadcast_to((start / np.linalg.norm(start))[:, np.newaxis], y.shape)])
    growth = np.zeros(8)
    for _ in range(steps // every):
        w = sw.integrate(varied(), "rk4", y=w, dt=dt, steps=every).y[-1]
        length = np.sqrt((w[3:] ** 2).sum(axis=0))
        growth, w[3:] = growth + np.log(length), w[3:] / length
    # Both sum the same numbers in other orders: some 150 roundings a step, amplified by e^(2·T) at most along so short a piece of
    # the motion, T = 2. A change of the state changes the rates of disturbances by |y| ~ 30 times as much, relatively.
    bound = 150 * steps * np.exp(4.0) * 30 * EPS
    np.testing.assert_allclose(spectrum.exponents[0], growth / (steps * dt), rtol=0, atol=bound)


def test_the_pendulums_damping_is_the_sum_and_without_it_there_is_none() -> None:
    """Volumes shrink by −2Dω₀ per unit of time. RK4 misses ln det by O(dt⁴): halving the step divides what is left by 16."""
    misses = []
    for dt in (0.025, 0.0125):
        spectrum = sw.lyapunov(sw.Pendulum(1.5, 0.1), "rk4", v=0.0, y=2.0, dt=dt, steps=round(20.0 / dt), exponents="all")
        misses.append(float(spectrum.sum) + 2 * 0.1 * 1.5)
    assert abs(misses[1]) < 1e-8
    # a·h⁴·(1 + b·h) with b of the size of some rates of the motion: b·h/2 is 0.075 for b = 4ω₀.
    assert 16 * 0.925 < misses[0] / misses[1] < 16 * 1.075
    # Its disturbances grow linearly, as the period depends on the swing: (ln T)/T and no more, and not for ever.
    spectrum = sw.lyapunov(sw.Pendulum(), "pefrl", v=0.0, y=2.0, dt=0.1, steps=4000, exponents="all", every=20)
    T = 400.0
    # Growth is at most 1 + c·T with c = |dω/dA|·A below 1 at this swing, in the norm of (v, y).
    assert abs(spectrum.exponents[0]) <= np.log(2 * T) / T
    half = spectrum.history[len(spectrum.history) // 2 - 1].max()
    assert spectrum.exponents[0] < half


def test_a_symplectic_method_keeps_pairs_and_volume() -> None:
    """Exponents of ± the same size, and a sum of zero to rounding, at any step."""
    system = sw.NBody([1.0, 1.0, 1.0], softening=0.5)
    for method in ("false_euler", "pefrl"):
        spectrum = sw.lyapunov(system, method, v=np.zeros((3, 2)), y=THREE, dt=0.05, steps=400, exponents="all", every=5)
        # A step has determinant 1, of which some 200 roundings leave eps each, and an orthonormalisation as many.
        assert abs(spectrum.sum) <= 400 * EPS / 0.05
        np.testing.assert_allclose(spectrum.history.sum(axis=1), 0.0, rtol=0, atol=400 * EPS / 0.05)
        # Pairs come out in time: a vector started as a unit one is not along its direction at once, which leaves ln(n·κ)/T.
        np.testing.assert_allclose(spectrum.exponents + spectrum.exponents[::-1], 0.0, atol=np.log(12 * 20) / 20.0)
        assert spectrum.exponents[0] > 0.05  # three bodies close together part


def test_the_carry_has_the_same_exponents_as_the_state() -> None:
    """Verlet and leapfrog are False Euler in other numbers: what one grows by in the long run the others do."""
    start: dict[str, Any] = {"v": 0.0, "y": np.array([1.0, 0.0]), "dt": 0.1, "steps": 500, "transient": 500, "exponents": "all"}
    unstable = sw.LinearSystem([[0, 0, 1.0, 0.5], [0, 0, 0.5, 2.0], [1, 0, 0, 0], [0, 1, 0, 0]])
    spectra = [sw.lyapunov(unstable, method, **start).exponents for method in ("false_euler", "leapfrog", "verlet")]
    true = np.log(sw.analyse(unstable, "false_euler", dt=0.1).radii) / 0.1
    for each in spectra:
        # Verlet divides by the step, which costs 1/dt of the digits; directions bring_to_rest as e^(−50·0.5).
        np.testing.assert_allclose(each, np.sort(true)[::-1], rtol=0, atol=1e4 * EPS / 0.1)


def test_under_a_control_volumes_change_as_the_steps_say() -> None:
    """The sum is the logarithm of the determinant of the product of all steps, as ``analyse`` finds it in another way."""
    start = {"v": 0.1 * THREE[::-1], "y": THREE, "dt": 0.05, "steps": 40}
    run = sw.integrate(sw.NBody([1.0, 1.0, 1.0], softening=0.3), "rk4", **start, every=1, control=sw.EnergyControl(0.1))
    spectrum = sw.lyapunov(run.system, "rk4", **start, exponents="all")
    np.testing.assert_array_equal(spectrum.y, run.y[-1])
    determinant = np.linalg.det(sw.analyse(run.system, "rk4", at=run).monodromy)
    # Forty products of matrices, and one determinant of a matrix whose condition is e^(2·1.1) at most: some thousand eps.
    assert float(spectrum.sum) * 2.0 == pytest.approx(np.log(determinant), abs=4000 * EPS)


def test_the_dimension_of_kaplan_and_yorke() -> None:
    def dimension(*exponents: float) -> float:
        n = len(exponents)
        system = sw.LinearSystem(np.diag(exponents))
        spectrum = Lyapunov(
            system, sw.method("rk4"), 0.1, np.ones(1), np.array(exponents), np.ones((1, n)), np.ones(1), np.ones(1)
        )
        return float(spectrum.dimension)

    assert dimension(0.9, 0.0, -14.5) == pytest.approx(2 + 0.9 / 14.5, rel=4 * EPS)
    assert dimension(-1.0, -2.0) == 0.0
    assert dimension(2.0, -1.0, -3.0) == pytest.approx(2 + 1 / 3, rel=4 * EPS)
    assert dimension(2.0, 1.0) == 2.0
    assert np.isnan(sw.lyapunov(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3).dimension)


def test_a_member_that_diverges_has_none_and_is_named() -> None:
    system = sw.Oscillator(np.array([1.0, 50.0]))
    with pytest.warns(sw.DivergenceWarning, match="1 of 2"):
        spectrum = sw.lyapunov(sw.NBody([1.0, 1.0], force="newton"), "rk4", v=0.0, y=_pairs(), dt=0.1, steps=20)
    assert np.isnan(spectrum.exponents[:, 1]).all()
    assert np.isfinite(spectrum.exponents[:, 0]).all()
    # Of a linear system the disturbances stay finite, since they are shortened, though the states overflow long before.
    spectrum = sw.lyapunov(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=1000)
    np.testing.assert_allclose(
        spectrum.exponents[0, 1], np.log(sw.analyse(sw.Oscillator(50.0), "rk4", dt=0.1).radius) / 0.1, rtol=1e-3
    )


def _pairs() -> Any:
    """Two bodies apart, and two in one place, whose force is infinite."""
    return np.array([[[0.0, 0.0], [0.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]]])


PACED: dict[str, Any] = {"tolerance": 1e-9, "at": np.arange(1.0, 41.0), "transient": 20, "exponents": "all"}


@looped("method", ["merson", "dop853", "fehlberg_5", "taylor"])
def test_with_a_tolerance_they_are_the_rates_of_a_linear_system(method: str) -> None:
    matrix = np.array([[-1.0, 0.3, 0.1], [0.2, -2.0, 0.4], [0.1, 0.5, 0.5]])
    spectrum = sw.lyapunov(sw.LinearSystem(matrix, velocities=1), method, v=np.zeros(1), y=np.ones(2), **PACED)
    rates = np.sort(np.linalg.eigvals(matrix).real)[::-1]
    # A step errs by the tolerance of what has been longest, at most e^0.5 in an interval, at whose end the smallest vector is
    # e^(−2.5) of that. Some hundred steps an interval by the method of lowest order.
    np.testing.assert_allclose(spectrum.exponents, rates, rtol=0, atol=100 * 1e-9 * np.exp(0.5 + 2.5))
    assert spectrum.t.tolist() == np.arange(21.0, 41.0).tolist()
    assert spectrum.history.shape == (20, 3)
    assert spectrum.dt is None


@looped("size", [1.0, 1e-9])
def test_with_a_tolerance_the_unit_of_the_state_does_not_matter(size: float) -> None:
    """ẏ = 50·cos(50·t)·size − y: its disturbances, e^(−t), would do with long steps, and are given lengths like that of y."""

    @sw.system(order=1)
    def swept(t: Any, y: Any, *, size: Any = 1.0) -> Any:
        return 50.0 * size * np.cos(50.0 * t) - y

    t = np.arange(1.0, 6.0)
    spectrum = sw.lyapunov(swept(size=size), "merson", y=size, tolerance=1e-9, at=t)
    swing = (2500.0 * np.sin(50.0 * 5.0) + 50.0 * np.cos(50.0 * 5.0)) / 2501.0
    right = size * ((1.0 - 50.0 / 2501.0) * np.exp(-5.0) + swing)
    # Errors of some thousand steps in each of five units of time, of which what e^(−t) leaves is one unit's.
    np.testing.assert_allclose(spectrum.y, right, rtol=0, atol=2000 * 1e-9 * size)
    np.testing.assert_allclose(spectrum.exponents, [-1.0], rtol=0, atol=2000 * 1e-9)


@looped("k", [2, "all"])
def test_with_a_tolerance_bodies_have_those_of_short_steps(k: Any) -> None:
    """Twelve disturbances make an attempt too long for one tape, two do not. Steps of 0.002 by rk4 are right to h⁴ ~ 10⁻¹¹."""
    bodies = sw.NBody([1.0, 1.0, 1.0], softening=0.5)
    at = np.arange(1.0, 11.0)
    spectrum = sw.lyapunov(bodies, "dop853", v=0.0, y=THREE, tolerance=1e-11, at=at, exponents=k)
    fixed = sw.lyapunov(bodies, "rk4", v=0.0, y=THREE, dt=0.002, steps=5000, every=500, exponents=k)
    # Some ten steps in a unit of time, whose errors grow with the motion, by e^(0.5·10).
    np.testing.assert_allclose(spectrum.history, fixed.history, rtol=0, atol=10 * 1e-11 * np.exp(5.0) + 100 * 0.002**4)


def test_with_a_tolerance_a_member_has_the_same_alone_and_a_driven_pendulum_shrinks_volumes() -> None:
    omega, y = np.array([1.0, 1.5, 2.0]), np.array([[1.0], [2.0]])
    drive = sw.Sinusoid(0.5, 0.7, 0.1)
    company = sw.lyapunov(sw.Pendulum(omega, 0.1, a=drive), "merson", v=0.1, y=y, **PACED)
    np.testing.assert_allclose(company.sum, np.broadcast_to(-2 * 0.1 * omega, (2, 3)), rtol=0, atol=100 * 1e-9 * np.exp(1.0))
    for i, k in np.ndindex(2, 3):
        alone = sw.lyapunov(sw.Pendulum(omega[k], 0.1, a=drive), "merson", v=0.1, y=y[i, 0], **PACED)
        np.testing.assert_array_equal(alone.history, company.history[:, :, i, k])
        np.testing.assert_array_equal([alone.v, alone.y], [company.v[i, k], company.y[i, k]])
    tolerance = (np.array([1e-6, 1e-8, 1e-10]), 1e-12)
    each = sw.lyapunov(sw.Pendulum(omega, 0.1), "merson", v=0.1, y=1.0, **(PACED | {"tolerance": tolerance, "dt": 0.01 * omega}))
    own = {"tolerance": (1e-8, 1e-12), "dt": 0.015}
    alone = sw.lyapunov(sw.Pendulum(1.5, 0.1), "merson", v=0.1, y=1.0, **(PACED | own))
    np.testing.assert_array_equal(alone.history, each.history[:, :, 1])


def test_with_a_tolerance_disturbances_count_where_the_motion_rests() -> None:
    """Steps of the motion alone would be held at the limit of stability by then, where disturbances do not decay.

    Near the equilibrium of ρ = 10 all decay as by its Jacobian; those of the pair of complex rates share the larger exponents.
    """
    lorenz = sw.system(order=1)(lambda t, y: [10 * (y[1] - y[0]), y[0] * (10 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])()
    c = np.sqrt(24.0)
    rates = np.linalg.eigvals(sw.jacobian(lorenz, y=np.array([c, c, 9.0])).matrix).real
    at = {"at": np.arange(0.5, 100.1, 0.5), "transient": 120}
    spectrum = sw.lyapunov(lorenz, "tsit5", y=np.array([1.0, 2.0, 3.0]), tolerance=1e-6, exponents="all", **at)
    # Over 40 units of time ln 2 of how vectors of a pair lie; and a millionth a step of some fifty a unit of time.
    np.testing.assert_allclose(spectrum.exponents[:2], np.sort(rates)[1:], rtol=0, atol=np.log(2.0) / 40.0)
    assert spectrum.exponents[2] == pytest.approx(np.min(rates), abs=50 * 1e-6)


def test_with_a_tolerance_a_member_that_stops_has_none() -> None:
    """ẏ = r·y² is infinite at t = 1/(r·y), and its disturbances grow as 2·r·y until then; for r < 0 they shrink."""

    @sw.system(order=1)
    def explosive(t: Any, y: Any, *, rate: Any = 1.0) -> Any:
        return rate * y**2

    rate = np.array([-1.0, 0.5, -2.0])
    with pytest.warns(sw.DivergenceWarning, match="1 of 3"):
        spectrum = sw.lyapunov(explosive(rate=rate), "dop853", y=1.0, tolerance=1e-9, at=np.arange(1.0, 6.0))
    assert np.isnan(spectrum.exponents[0, 1])
    assert np.isfinite(spectrum.history[0, 0, 1])  # up to t = 1 it was there
    # The derivative of 1/(1 − r·t) by the start is the square of that.
    right = -2.0 * np.log1p(-rate[[0, 2]] * 5.0) / 5.0
    np.testing.assert_allclose(spectrum.exponents[0, [0, 2]], right, rtol=0, atol=100 * 1e-9)


@looped(
    "wrong, message",
    [
        ({"steps": 10}, "steps: works with fixed steps only"),
        ({"every": 10}, "every: works with fixed steps only"),
        ({"at": None}, "at: tolerance= needs the times"),
        ({"tolerance": None}, "tolerance: at= needs the error"),
        ({"at": [1.0, 1.0]}, "at: expected times after t0 = 0, ascending"),
        ({"at": [0.0, 1.0]}, "at: expected times after t0 = 0, ascending"),
        ({"transient": 2}, "transient: expected"),
        ({"method": "rk4"}, "tolerance: rk4 does not estimate its error"),
    ],
)
def test_wrong_calls_with_a_tolerance(wrong: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"method": "merson", "v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [1.0, 2.0]}
    with pytest.raises(sw.StepwellError, match=message):
        sw.lyapunov(sw.Pendulum(), **(arguments | wrong))


def test_wrong_derivatives_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """With −sin for the derivative of the sine, the sum of a damped pendulum is no longer −2Dω₀."""
    from stepwell.reference.tape import rules

    monkeypatch.setitem(rules.PARTIALS, "sin", (lambda f, y, x: -1e-3 - f("cos")(x),))
    spectrum = sw.lyapunov(sw.Pendulum(1.5, 0.1), "false_euler", v=0.0, y=2.0, dt=0.1, steps=200, exponents="all")
    right = 2.0 * 0.1 * 1.5
    monkeypatch.undo()
    plain = sw.lyapunov(sw.Pendulum(1.5, 0.1), "false_euler", v=0.0, y=2.0, dt=0.1, steps=200, exponents="all")
    assert abs(spectrum.exponents[0] - plain.exponents[0]) > 0.1
    # A step of False Euler has determinant 1 − 2Dω₀h: that alone does not depend on the sine.
    assert float(plain.sum) == pytest.approx(np.log(1 - right * 0.1) / 0.1, abs=40 * EPS / 0.1)


class Rates:
    """The reference of Lorenz's system."""

    def __init__(self, h: float, sigma: Any, rho: Any, beta: Any) -> None:
        self.h, self.sigma, self.rho, self.beta = h, sigma, rho, beta

    def dv(self, t: float, v: Any, y: Any) -> Any:
        return self.h * v

    def dy(self, t: float, v: Any, y: Any) -> Any:
        x, y, z = y
        return self.h * np.stack([self.sigma * (y - x), x * (self.rho - z) - y, x * y - self.beta * z])


class Lorenz(System):
    """Three coordinates and no velocity: what a system must say of itself to be differentiated, and nothing of the core's."""

    kernel = "none"
    reference = Rates
    second_order = False
    v_shape, y_shape = (0,), (3,)

    def repr_arguments(self) -> list[str]:
        return []

    def equation_parameters(self, batch: tuple[int, ...]) -> dict[str, Any]:
        return {"sigma": np.array(10.0), "rho": np.array(28.0), "beta": np.array(8.0 / 3.0)}


def near_the_attractor(members: int) -> Any:
    return np.array([np.linspace(1, 2, members), np.linspace(1, 3, members), np.full(members, 20.0)])


def test_lorenz() -> None:
    """0.9056, 0 and −14.572 (Sprott 2003), whose sum is −σ − 1 − β at every point of the motion."""
    arguments: dict[str, Any] = {"y": near_the_attractor(64), "exponents": "all"}
    spectrum = sw.lyapunov(Lorenz(), "rk4", **arguments, dt=0.01, steps=3000, transient=2500)
    assert_lorenz(spectrum)
    assert spectrum.dimension.mean() == pytest.approx(2.062, abs=0.005)
    # RK4 misses the determinant by a·h⁴ per unit of time: with half the step by a sixteenth, so that (16·S(h/2) − S(h))/15 has
    # none of it. What is left is of the next order, and the averages of two motions differ a little: a third of the difference.
    finer = sw.lyapunov(Lorenz(), "rk4", **arguments, dt=0.005, steps=1000, transient=200)
    S, half = spectrum.sum.mean(), finer.sum.mean()
    assert abs((16 * half - S) / 15 + 10.0 + 1.0 + 8.0 / 3.0) < abs(S - half) / 3 < 1e-4
    # The origin and (±√(β(ρ − 1)), ±√(β(ρ − 1)), ρ − 1).
    near = np.array([[0.1, 8.0, -8.0], [0.1, 8.0, -8.0], [0.1, 27.0, 27.0]])
    equilibria = sw.equilibria(Lorenz(), near=(None, near), method="rk4", dt=0.01)
    c = np.sqrt(8 / 3 * 27)
    np.testing.assert_allclose([each.y for each in equilibria], [[0, 0, 0], [c, c, 27], [-c, -c, 27]], rtol=0, atol=27 * 20 * EPS)
    assert [each.kind for each in equilibria] == ["saddle"] * 3
    for each in equilibria:
        z = np.exp(each.eigenvalues * 0.01)  # RK4's is that to (λh)⁵/120, below 10⁻⁵ for λ up to 22.8
        np.testing.assert_allclose(np.sort_complex(each.analysis.eigenvalues), np.sort_complex(z), rtol=0, atol=1e-5)
    limit = sw.stability_limit(Lorenz(), "rk4", y=np.zeros(3))
    assert limit == 0.0  # the origin's own motion grows

    @sw.system(order=1)  # type: ignore[attr-defined]
    def lorenz(t: Any, y: Any, *, sigma: Any = 10.0, rho: Any = 28.0, beta: Any = 8.0 / 3.0) -> Any:
        return [sigma * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]]

    y = near_the_attractor(64)
    assert_lorenz(sw.lyapunov(lorenz(), "rk4", y=y, dt=0.01, steps=3000, transient=2500, exponents="all"))
    at = y[:, 0]
    np.testing.assert_array_equal(sw.jacobian(lorenz(), y=at).matrix, sw.jacobian(Lorenz(), y=at).matrix)


def assert_lorenz(spectrum: Lyapunov) -> None:
    members = spectrum.exponents.shape[1]
    mean, error = spectrum.exponents.mean(axis=1), spectrum.exponents.std(axis=1) / np.sqrt(members)
    # Members lose sight of each other within the transient, so the error of the mean is that of so many samples.
    assert (np.abs(mean - [0.9056, 0.0, -14.572]) < 5 * error + 1e-3).all()
    assert (error < 0.01).all()
