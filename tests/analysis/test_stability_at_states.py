"""Eigenvalues where rounding counts, along runs and of several modes, and what is wrong with arguments."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import eigen, limit_search
from stepwell.errors import ArgumentError, DTypeError, ShapeError, TooLargeError, UnsupportedError
from support.looped import in_turn, looped
from support.refusals import refused
from support.stability_cases import EPS


def test_growth_and_angles_are_as_exact_as_the_matrix() -> None:
    """A slow oscillator with negative damping beside a fast one on the circle: growth of 1e-10 a step decides."""
    a = np.zeros((4, 4))
    a[2, 0] = a[3, 1] = 1.0
    a[0, 2], a[1, 3] = -1.0, -(0.01**2)
    a[1, 1] = 2e-9
    analysis = sw.analyse(sw.LinearSystem(a), "false_euler", dt=0.1)
    assert (analysis.kind, bool(analysis.stable)) == ("unstable oscillation", False)
    # e^(½·2e-9·dt) a step, of which |z| has some eps times 1/|wᴴx| = 1/0.01.
    assert analysis.radius - 1 == pytest.approx(1e-10, abs=100 * 10 * EPS)
    # P has 2 − Φ², rounded to 2⁻⁵²: of Φ² a share of 2⁻⁵³·2/Φ² or less, and half of that of Ψ = 2·asin(Φ/2).
    phi = np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0])
    a = sw.analyse(sw.Oscillator(), "verlet", dt=phi)
    off = np.abs(a.angle / (2 * np.arcsin(phi / 2)) - 1)
    assert (off <= EPS / phi**2 + 4 * EPS).all()
    assert (a.kind == "harmonic").all()


@looped("method", ["false_euler", "rk4", "verlet"])
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


def test_coefficients_of_more_than_two_states_and_overflow() -> None:
    a = sw.analyse(sw.Chain(3), "rk4", dt=[0.3, 0.4])
    for i in range(2):
        np.testing.assert_allclose(a.polynomial[:, i], np.poly(a.P[:, :, i]), rtol=0, atol=1e-12)
    assert a.p is None
    assert a.q is None
    a = sw.analyse(sw.Oscillator([1.0, 1e200]), "rk4", dt=1.0)
    assert (a.kind.tolist(), a.stable.tolist()) == (["damped oscillation", "not finite"], [True, False])


@looped(
    "arguments, error, message",
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
            r"broadcast.*: dt and system \(3,\), v \(2,\)",
        ),
        ({"system": sw.Pendulum([1.0, 2.0, 3.0]), "dt": 0.1, "at": (0.0, [1.0, 1.0])}, ShapeError, r"system \(3,\), y \(2,\)"),
        ({"system": sw.Pendulum(), "dt": 0.1, "at": ([0.0] * 2, [0.0] * 3)}, ShapeError, r"v \(2,\), y \(3,\)"),
        ({"system": sw.Pendulum(), "dt": 0.1, "at": (0.0, 0.0, 0.0)}, DTypeError, r"pair \(v, y\) or a run, got 3 of them"),
        ({"dt": 0.1, "t": "noon"}, DTypeError, "t: expected real numbers, got 'noon'"),
        ({"system": sw.Chain(200), "dt": np.broadcast_to(0.1, 10**8)}, TooLargeError, "the matrices of 100000000 members need"),
    ],
)
def test_analyse_says_what_is_wrong(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    refused(error, message, sw.analyse, **({"system": sw.Oscillator(), "method": "false_euler"} | arguments))


def test_what_is_no_run_of_the_system() -> None:
    with pytest.raises(ArgumentError, match="monodromy"):
        _ = sw.analyse(sw.Oscillator(), "rk4", dt=0.1).monodromy
    run = sw.integrate(sw.Chain(3), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
    refused(ShapeError, "at: expected a run of", sw.analyse, sw.NBody(), "rk4", at=run)


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
    refused(ShapeError, r"system \(3,\), at \(2,\)", sw.analyse, sw.Pendulum([1.0, 2.0, 3.0]), "rk4", at=run)


def test_inputs_of_a_linear_system_at_states() -> None:
    """Q does not depend on the state; it has the shape of the states all the same."""
    driven = sw.Oscillator(1.3, 0.2, x=0.5)
    one = sw.analyse(driven, "rk4", dt=0.1)
    run = sw.integrate(driven, "rk4", v=0.0, y=np.zeros(2), dt=0.1, steps=2, every=1)
    for at, shape in (((np.zeros(3), np.ones(3)), (3,)), (run, (3, 2))):
        a = sw.analyse(driven, "rk4", dt=0.1, at=at)
        assert a.Q.shape == (2, 2, *shape)
        np.testing.assert_array_equal(a.Q.reshape(2, 2, -1), np.repeat(one.Q[:, :, np.newaxis], math.prod(shape), axis=2))


# ---- equations of one's own that are linear, or at rest
@sw.system(order=1)
def lags(t, y, *, time=1.0, fast=20.0, bend=0.0):
    """Equal lags in a chain, driven, and a fast one behind them."""
    slow = [(before - each) / time for before, each in zip([np.sin(t), *y[:-2]], y[:-1], strict=True)]
    return np.array([*slow, y[-2] - fast * y[-1] + bend * y[-1] ** 2])


@sw.system(order=1)
def bent(t, y, *, fast=20.0, bend=0.1):
    """The same, at rest where all are zero."""
    return np.array([-y[0], y[0] - y[1], y[1] - y[2], y[2] - fast * y[3] + bend * y[3] ** 2])


@sw.system(order=1)
def parallel(t, y, *, time=0.5, fast=30.0):
    """Equal lags under one drive, and a fast one."""
    drive = np.where(t < 1.0, 1.0, 0.0)
    return np.array([*((drive - each) / time for each in y[:-1]), y[:-1].sum() - fast * y[-1]])


@sw.system
def swings(t, v, y, *, omega=3.0):
    """Equal oscillators, each pulled by the one before it."""
    return np.array([-(omega**2) * y[0] + np.cos(t), *(before - omega**2 * each for before, each in itertools.pairwise(y))])


def as_linear(system: sw.System, v: Any, y: Any) -> sw.LinearSystem:
    return sw.LinearSystem(sw.jacobian(system, v=v, y=y).matrix, velocities=0 if v is None else len(v))


@pytest.mark.parametrize(
    ("n", "method"), in_turn([3, 4, 7], ["false_euler", "rk4", "merson", "standard_euler", "dop853", "taylor"])
)
def test_own_linear_equations_have_the_limit_of_the_linear_system(n: int, method: str) -> None:
    """Also where eigenvalues meet, which rounding would hide in the eigenvalues of a step: the fast one decides."""
    y = np.linspace(1.0, 2.0, n + 1)
    for system, fast in ((lags(), 20.0), (parallel(), 30.0)):
        limit = sw.stability_limit(system, method, y=y)
        assert limit.decided
        assert float(limit) == float(sw.stability_limit(as_linear(system, None, y), method))
        alone = sw.stability_limit(sw.LinearSystem([[-fast]], velocities=0), method)
        assert float(limit) == pytest.approx(float(alone), rel=1e-14)
        assert limit.mode.rate == pytest.approx(-fast, rel=1e-14)
        assert limit.mode.y.shape == (n + 1,)


@looped("method", ["false_euler", "leapfrog", "rk4", "verlet"])
def test_own_oscillators_that_are_equal_have_the_limit_of_one(method: str) -> None:
    limit = sw.stability_limit(swings(), method, v=np.zeros(4), y=np.ones(4))
    assert limit.decided
    assert float(limit) == pytest.approx(sw.method(method).limit / 3.0, rel=1e-12)


def test_a_batch_of_own_linear_equations() -> None:
    fast = np.array([2.0, 20.0, 200.0])
    limits = sw.stability_limit(lags(fast=fast), "rk4", y=np.ones(5))
    assert limits.decided.all()
    np.testing.assert_allclose(limits, 2.785293563405282 / fast, rtol=1e-14)
    assert [mode.y.shape for mode in limits.modes] == [(5,)] * 3


def test_what_bends_is_decided_where_it_rests() -> None:
    """All stages of a step are then at one state, so the step is a polynomial of the matrix there. Elsewhere it stays open."""
    system, rest = bent(), np.zeros(4)
    limit = sw.stability_limit(system, "rk4", y=rest)
    assert float(limit) == float(sw.stability_limit(as_linear(system, None, rest), "rk4"))
    with pytest.warns(sw.AccuracyWarning, match=r"is NaN: it is between dt = .* and .*, where rounding hides .* LinearSystem"):
        moving = sw.stability_limit(system, "rk4", y=rest + 1.0)
    assert math.isnan(moving)
    assert not moving.decided
    assert 0.0 <= moving.stable < moving.grows
    assert "not decided" in repr(moving)


@sw.system(shape=(4,))
def coupled(t: Any, v: Any, y: Any, *, k: Any = 0.1) -> Any:
    return (np.roll(y, 1) + np.roll(y, -1)) * k - np.sin(y)


@pytest.mark.parametrize(("of_each", "method"), in_turn([False, True], ["rk4", "verlet", "fehlberg"]))
def test_only_members_whose_limit_is_sought_are_searched(method: str, of_each: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the bits and modes that all of them had together."""
    # A member that grows by itself takes the eigenvalues of its rates, and of two steps for its mode. One that is sought takes
    # those of 562 rungs and 60 bisections at most, and of 16 steps around the crossing; members go when half of those left are
    # found, so up to as many again are computed with it.
    random = np.random.default_rng(4)
    y = np.where(np.arange(60) < 6, 0.3, 3.0) * random.uniform(0.5, 1.0, (4, 60))  # the sixth part hang, the others stand
    system = coupled(k=np.linspace(0.05, 0.15, 60)) if of_each else coupled()
    computed: list[int] = []
    of_matrices = eigen.eigen
    monkeypatch.setattr(eigen, "eigen", lambda m, *rest: computed.append(m[0, 0].size) or of_matrices(m, *rest))
    limits = sw.stability_limit(system, method, v=np.zeros(4), y=y)
    assert (limits[6:] == 0.0).all()
    assert sum(computed) <= 3 * 60 + 2 * 6 * (562 + 60 + 16)
    monkeypatch.setattr(limit_search.Search, "of", lambda self, members: (self, ...))
    whole = sw.stability_limit(system, method, v=np.zeros(4), y=y)
    np.testing.assert_array_equal(limits, whole)
    np.testing.assert_array_equal(limits.grows, whole.grows)
    assert limits.modes.tolist() == whole.modes.tolist()
