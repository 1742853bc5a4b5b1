"""One number of tolerance is relative to the present size of each number, however far it fell; but rounding is tolerated."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import mpmath
import numpy as np
import pytest
import stepwell as sw

EXPLICIT = ["merson", "fehlberg", "fehlberg_5", "dop853", "taylor"]
IMPLICIT = ["rodas4", "rodas5p"]
ALL = [*EXPLICIT, *IMPLICIT]


@sw.system(order=1)
def oregonator(t: Any, y: Any, *, s: Any = 77.27, w: Any = 0.161) -> Any:
    return [s * (y[1] + y[0] * (1.0 - 8.375e-6 * y[0] - y[1])), (y[2] - (1.0 + y[0]) * y[1]) / s, w * (y[0] - y[2])]


@sw.system(order=1)
def prey(t: Any, y: Any) -> Any:
    return [y[0] * (1.5 - y[1]), y[1] * (y[0] - 3.0)]


@sw.system(order=1)
def epidemic(t: Any, y: Any) -> Any:
    """The infected fall to 6e-115 before the second wave."""
    s, i, r = y
    return [0.01 - 40.0 * s * i - 0.01 * s, 40.0 * s * i - 20.01 * i, 20.0 * i - 0.01 * r]


@sw.system(order=1)
def decays(t: Any, y: Any) -> Any:
    return [-y[0], y[0] - 0.05 * y[1]]


@sw.system(order=1)
def hangs(t: Any, y: Any, *, k: Any = 100.0, c: Any = 3.0) -> Any:
    """A mass on a spring comes to rest where two forces cancel: then its velocity is their rounding."""
    return [y[1], -k * y[0] - c * y[1] - 9.81]


def error(system: Any, method: str, start: list[float], end: float, tolerance: float, true: list[float]) -> float:
    """The largest relative error at the end, over the tolerance."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", sw.AccuracyWarning)
        warnings.simplefilter("ignore", sw.StiffnessWarning)
        run = sw.integrate(system, method, y=np.array(start), tolerance=tolerance, at=[end], max_steps=100_000)
    assert not run.status
    return float(np.max(np.abs(run.y[-1] / np.array(true) - 1.0)) / tolerance)


@pytest.mark.parametrize("method", IMPLICIT)
def test_a_reaction_that_swings_over_five_orders_of_magnitude(method: str) -> None:
    """Values to 12 digits by steps of relative tolerance 1e-13."""
    for parameters, true in (
        ({}, [1.00081486946, 1228.17851961, 132.055493836]),
        ({"s": 60.21, "w": 0.1006}, [1.00154924989, 646.469724011, 18.8181453095]),
    ):
        for tolerance in (1e-3, 1e-4, 1e-6):
            assert error(oregonator(**parameters), method, [1.0, 2.0, 3.0], 360.0, tolerance, true) < 1.0


@pytest.mark.parametrize("method", ALL)
def test_populations_that_nearly_die_out(method: str) -> None:
    """Values by steps of relative tolerance 1e-13; what decays to 1e-74 has its digits, too."""
    left = [np.exp(-170.0), (np.exp(-8.5) - np.exp(-170.0)) / 0.95]
    for tolerance in (1e-4, 1e-6, 1e-8):
        assert error(prey(), method, [10.0, 5.0], 15.0, tolerance, [0.713751380, 0.0754078033]) < 60.0
        assert error(decays(), method, [1.0, 0.0], 170.0, tolerance, left) < 1000.0
        assert error(epidemic(), method, [0.99, 0.01, 0.0], 100.0, tolerance, [0.70463799, 2.0180980e-13, 0.29536201]) < 2000.0


@pytest.mark.parametrize("method", ALL)
def test_rest_where_forces_cancel_is_no_motion(method: str) -> None:
    """As long as the velocity is rounding, steps are as long as stability lets them be; relative to it they were endless."""
    for k, c, end in ((100.0, 3.0, 100.0), (100.0, 3.0, 1000.0), (1e6, 300.0, 1.0)):
        for tolerance in (1e-4, 1e-6, 1e-8):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sw.StiffnessWarning)
                run = sw.integrate(hangs(k=k, c=c), method, y=np.zeros(2), tolerance=tolerance, at=[end])
            assert not run.status
            assert run.y[-1, 0] == pytest.approx(-9.81 / k, rel=10.0 * tolerance)
            assert abs(run.y[-1, 1]) < 5.0 * tolerance * 9.81 / np.sqrt(k)
            assert run.paces.accepted + run.paces.rejected < 100.0 * end + 10_000, (k, tolerance)


@pytest.mark.parametrize("kind", ["mixing", "single", "swinging"])
def test_equations_that_relax_over_six_orders_of_magnitude(kind: str) -> None:
    """Random ones, with one number, against closed forms and mpmath's exponential."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        n, methods = 3, IMPLICIT
        if kind == "mixing":  # a net of reactions with rates from 1e-3 to 1e3
            rates = 10.0 ** random.uniform(-3.0, 3.0, (n, n))
            matrix = rates.T - np.diag(rates.sum(axis=1)) - np.diag([0.0, 0.0, 0.1])
            start, end = np.array([1.0, 1e-6, 0.0]), 10.0 ** random.uniform(-2.0, 2.0)
            system = sw.system(order=1, shape=(n,))(lambda t, y, *, a=matrix: np.array(a) @ y)
            with mpmath.workdps(40):
                true = [float(x) for x in mpmath.expm(mpmath.matrix(matrix.tolist()) * end) * mpmath.matrix(start.tolist())]
        elif kind == "single":  # each to what is left of it
            fast, left, end = 10.0 ** random.uniform(-1.0, 3.0, n), 10.0 ** random.uniform(-6.0, -1.0, n), 100.0
            system = sw.system(order=1, shape=(n,))(lambda t, y, *, k=fast, e=left: -k * (y - e))
            start, true = np.ones(n), (left + (1.0 - left) * np.exp(-fast * end)).tolist()
        else:
            size, turns, end = random.uniform(3.0, 7.0), random.uniform(0.5, 3.0), random.uniform(2.0, 20.0)
            system = sw.system(order=1, shape=(2,))(
                lambda t, y, *, a=size, w=turns: np.array([a * w * np.cos(w * t) * y[0], -w * y[1] * y[1]])
            )
            start, true, methods = (
                np.ones(2),
                [np.exp(size * np.sin(turns * end)), 1.0 / (1.0 + turns * end)],
                ["dop853", *IMPLICIT],
            )
        for method in methods:
            for tolerance in (1e-3, 1e-4, 1e-6, 1e-8):
                assert error(system(), method, start.tolist(), end, tolerance, true) < 100.0, (seed, method, tolerance)


@pytest.mark.parametrize("method", ALL)
def test_units_change_no_step(method: str) -> None:
    """Of powers of two: the numbers have the same bits, however far apart the units of the components are."""
    a, b = 2.0**300, 2.0**-300
    scaled = sw.system(order=1)(lambda t, y: [y[0] * (1.5 - y[1] * a), y[1] * (y[0] * b - 3.0)])
    at = [1.0, 7.0, 15.0]
    one = sw.integrate(prey(), method, y=np.array([10.0, 5.0]), tolerance=1e-6, at=at)
    other = sw.integrate(scaled(), method, y=np.array([10.0 * a, 5.0 * b]), tolerance=1e-6, at=at)
    assert np.array_equal(one.y * np.array([a, b]), other.y)


@sw.system(order=1)
def pulsed(t: Any, y: Any, *, at: Any = 60.0) -> Any:
    """It decays to e⁻⁶⁰, until a clock of its own lets a push begin, of which no time is known beforehand."""
    return [np.where(y[1] > at, 1.0, 0.0) - y[0], 1.0 + 0.0 * y[0]]


@pytest.mark.parametrize("method", ["merson", "fehlberg", "fehlberg_5", "dop853", "rodas4", "rodas5p"])
def test_a_push_begins_where_next_to_nothing_is_left(method: str) -> None:
    for tolerance in (1e-4, 1e-6, 1e-9):
        run = sw.integrate(pulsed(), method, y=np.array([1.0, 0.0]), tolerance=tolerance, at=[61.0], max_step=0.3)
        assert not run.status
        assert run.y[-1, 0] == pytest.approx(1.0 - np.exp(-1.0), rel=30.0 * tolerance)


def test_no_method_passes_the_end_of_a_solution() -> None:
    """ẏ = −1/(2y) ends at y = 0, t = y₀²: beside that, errors do not fall with the step, and are no rounding."""
    start = np.linspace(0.5, 2.0, 100)
    system = sw.system(order=1)(lambda t, y: -0.5 / y)
    for method in [*ALL, "rosenbrock23"]:
        for tolerance in (1e-3, 1e-4):
            with pytest.warns(sw.ToleranceWarning, match="stopped before"):
                run = sw.integrate(system(), method, y=start, tolerance=tolerance, at=1.5 * start[np.newaxis] ** 2)
            assert run.status.all(), (method, tolerance)
            if tolerance < 1e-3:
                np.testing.assert_allclose(run.stopped_at, start**2, rtol=3.0 * tolerance, err_msg=method)


@pytest.mark.filterwarnings("ignore::stepwell.StiffnessWarning")
def test_deviations_at_the_limit_of_stability_are_no_rounding() -> None:
    """Reactants that fall to 1e-6 erred by 500 000 tolerances. What may be rounding is 2⁻³⁹ of the largest, eight times over."""
    random = np.random.default_rng(1)
    k, e = 10.0 ** random.uniform(-1.0, 2.5, (3, 300)), 10.0 ** random.uniform(-6.0, -1.0, (3, 300))
    system, true = sw.system(order=1)(lambda t, y, *, k=k[:, 0], e=e[:, 0]: -k * (y - e)), e + (1.0 - e) * np.exp(-20.0 * k)
    for method, tolerance in itertools.product(["dopri5", "vern7", "vern9", *EXPLICIT[:-1], "tsit5"], (1e-6, 1e-8)):
        run = sw.integrate(system(k=k, e=e), method, y=np.ones((3, 300)), tolerance=tolerance, at=[20.0])
        assert np.all(np.abs(run.y[-1] - true) < 60.0 * tolerance * true + 8.0 * 2.0**-39), (method, tolerance)


def test_errors_of_a_method_of_second_order_are_in_proportion_to_the_tolerance() -> None:
    """Of random stiff linear equations: with steps that err by the tolerance they were 7 of it at 1e-3, and 160 at 1e-7."""
    for seed in range(12):
        random = np.random.default_rng(seed)
        rates, vectors = -(10.0 ** random.uniform(-1.0, 6.0, 3)), np.linalg.qr(random.normal(size=(3, 3)))[0]
        start, end = random.normal(size=3), 10.0 ** random.uniform(-2.0, 1.0)
        true = vectors @ (np.exp(rates * end) * (vectors.T @ start))
        system = sw.LinearSystem(vectors @ np.diag(rates) @ vectors.T, velocities=0)
        for tolerance in (1e-3, 1e-5, 1e-7):
            run = sw.integrate(system, "rosenbrock23", y=start, tolerance=(tolerance, 1e-3 * tolerance), at=[end])
            assert np.all(np.abs(run.y[-1] - true) < 20.0 * tolerance * (np.abs(true) + 1e-3)), (seed, tolerance)
    # Tolerances of each number and of each member are those of members alone.
    system, start = sw.LinearSystem([[-1.0, 1.0], [0.0, -50.0]], velocities=0), np.array([[1.0, 2.0, 3.0], [1.0, 0.5, 2.0]])
    for relative, absolute in (
        (1e-6, [[1e-9, 1e-8, 1e-7], [1e-8, 1e-8, 1e-9]]),
        ([1e-6, 1e-5], [[1e-9], [1e-8]]),
        ([[1e-6], [1e-5]], [1e-9, 1e-8]),
        ([[1e-6, 1e-7, 1e-4], [1e-5, 1e-6, 1e-4]], [1e-9, 1e-8]),
    ):
        pair = [np.array(each) for each in (relative, absolute)]
        run = sw.integrate(system, "rosenbrock23", y=start, tolerance=tuple(pair), at=[1.0])
        wide = [np.broadcast_to(each.reshape(*each.shape, *[1] * (2 - each.ndim)), (2, 3)) for each in pair]
        for i in range(3):
            own = tuple(each[:, i] for each in wide)
            alone = sw.integrate(system, "rosenbrock23", y=start[:, i], tolerance=own, at=[1.0])
            assert np.array_equal(alone.y[-1], run.y[-1, :, i]), (relative, absolute, i)
