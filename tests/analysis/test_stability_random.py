"""Random linear systems: predictions against matrices written by hand, and against runs."""

import math
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import maps, operations, series
from support.looped import in_turn
from support.stability_cases import TAYLOR, by_hand

SECOND_ORDER = [m.name for m in sw.methods() if m.needs_acceleration]

#: Those whose P is written by hand here.
METHODS = [*TAYLOR, "false_euler", "damped_euler", "false_heun", "semi_false_heun"]


def random_system(seed: int) -> tuple[Any, Any, list[int]]:
    """A stable system of one to six states, its A in the order (v, y), and how it is split."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    a = rng.normal(size=(n, n))
    a -= np.eye(n) * (np.linalg.eigvals(a).real.max() + rng.uniform(0.05, 1.0))
    velocities = rng.permutation(n)[: rng.integers(0, n + 1)].tolist()
    order = velocities + [i for i in range(n) if i not in velocities]
    return sw.LinearSystem(a, velocities=velocities), a[np.ix_(order, order)], velocities


def radius(method: str, a: Any, n_v: int) -> Any:
    """A function of a step, or of an array of steps."""
    return lambda h: np.abs(np.linalg.eigvals(by_hand(method, np.asarray(h)[..., np.newaxis, np.newaxis] * a, n_v))).max(axis=-1)


@pytest.mark.parametrize(("seed", "method"), in_turn(range(15), METHODS))
def test_matrix_and_limit(method: str, seed: int) -> None:
    system, a, velocities = random_system(seed)
    n_v = len(velocities)
    h = 0.3 / np.abs(np.linalg.eigvals(a)).max()
    analysis = sw.analyse(system, method, dt=h)
    np.testing.assert_allclose(analysis.P, by_hand(method, h * a, n_v), rtol=0, atol=1e-13)
    assert analysis.radius == pytest.approx(radius(method, a, n_v)(h), abs=1e-9)

    limit = sw.stability_limit(system, method)
    r = radius(method, a, n_v)
    # Independent: the first step of a fine ladder at which something grows, then bisection on r₁ = 1.
    fastest = np.abs(np.linalg.eigvals(a)).max()
    ladder = np.geomspace(1e-4, 50.0, 1200) / fastest
    grows = r(ladder) > 1 + 1e-12
    if not grows.any():
        assert limit == math.inf
        return
    i = int(grows.argmax())
    if i == 0:
        assert limit == 0
        return
    low, high = ladder[i - 1], ladder[i]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if r(middle) > 1 else (middle, high)
    # Both are r₁ = 1 to some 1e-15 times the condition of the eigenvalue (here up to 1e3), over a slope of order 1.
    assert limit == pytest.approx(high, rel=1e-11)
    assert abs(limit.mode.eigenvalue) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(np.linalg.eigvals(a) - limit.mode.rate).min() < 1e-9 * fastest


@pytest.mark.parametrize(("method", "seed"), in_turn(METHODS, range(8)))
def test_runs_stay_bounded_or_grow_as_predicted(method: str, seed: int) -> None:
    """A batch of random systems of 3 states with random steps, alone in their fate: each by its own r₁."""
    rng = np.random.default_rng([seed, 77])
    b, steps = 300, 3000
    a = rng.normal(size=(3, 3, b))
    a -= np.eye(3)[:, :, np.newaxis] * (np.linalg.eigvals(np.moveaxis(a, 2, 0)).real.max(axis=1) + 0.1)
    a *= rng.uniform(0.1, 2.0, b)  # the scale of A is the step
    system = sw.LinearSystem(a, velocities=int(rng.integers(0, 4)))
    analysis = sw.analyse(system, method, dt=1.0)
    start = rng.normal(size=(3, b))
    v, y = system.split(start)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        run = sw.integrate(system, method, v=v, y=y, dt=1.0, steps=steps)
    size = np.abs(system.state(run.v[-1], run.y[-1])).max(axis=0)
    bounded = np.isfinite(size) & (size < 1e6)
    # The band: with |r₁ − 1| > 0.02, r₁ᵏ is above 6e25 or below 5e-27 after 3000 steps. The share of a random start in one of
    # three modes is above 1e-12, and what a non-normal P adds is below 1e12, but for odds of less than one in a million.
    decided = np.abs(analysis.radius - 1.0) > 0.02
    assert decided.sum() > 200
    np.testing.assert_array_equal(bounded[decided], analysis.stable[decided])
    assert 0 < analysis.stable.sum() < b or method == "standard_euler"


@pytest.mark.parametrize(("method", "seed"), in_turn(METHODS, range(6)))
def test_units_of_the_states_and_of_time_do_not_matter(seed: int, method: str) -> None:
    """A similar system, its states in units that are powers of two apart, up to 2⁴⁰, and its time too."""
    _, a, velocities = random_system(seed + 100)
    rng, n = np.random.default_rng(seed), len(a)
    units, clock = 2.0 ** rng.integers(-20, 21, n), 2.0 ** rng.integers(-20, 21)
    plain = sw.LinearSystem(a, velocities=len(velocities))
    other = sw.LinearSystem(clock * a * units / units[:, np.newaxis], velocities=len(velocities))
    limit, same = float(sw.stability_limit(plain, method)), float(sw.stability_limit(other, method)) * clock
    # Roundings are the same, but the eigenvalues of the plain one are found in units that are up to √2 off others.
    assert same == pytest.approx(limit, rel=1e-11)
    for step in (0.3, 0.999999, 1.000001) if math.isfinite(limit) else ():
        one, two = sw.analyse(plain, method, dt=step * limit), sw.analyse(other, method, dt=step * limit / clock)
        assert (one.kind, bool(one.stable)) == (two.kind, bool(two.stable))
        assert bool(one.stable) == (step < 1)
        assert two.radius == pytest.approx(one.radius, rel=1e-11)


@pytest.mark.parametrize(("seed", "method"), in_turn(range(10), SECOND_ORDER))
def test_limits_and_runs_of_random_springs(method: str, seed: int) -> None:
    """v̇ = −K·y, ẏ = c·v with frequencies over three decades: Φ of the fastest decides, and runs from both sides say so."""
    rng = np.random.default_rng([seed, 3])
    n, speed = int(rng.integers(1, 5)), float(rng.uniform(0.1, 10.0))
    squares = 10.0 ** rng.uniform(-3, 3, n)
    shapes = rng.normal(size=(n, n)) + 2 * np.eye(n)
    k = shapes @ np.diag(squares) @ np.linalg.inv(shapes)
    a = np.block([[np.zeros((n, n)), -k], [speed * np.eye(n), np.zeros((n, n))]])
    system = sw.LinearSystem(a, velocities=n)
    fastest = math.sqrt(speed * squares.max())
    limit = sw.stability_limit(system, method)
    # K is wrong by some eps of its norm times the condition of its modes, which is below 1e3 here.
    assert limit == pytest.approx(sw.method(method).limit / fastest, rel=1e-11)
    below, above = (sw.analyse(system, method, dt=f * limit) for f in (0.999, 1.001))
    assert (below.kind, bool(above.stable)) == ("harmonic", False)
    for f, bounded in ((0.999, True), (1.001, False)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.DivergenceWarning)
            run = sw.integrate(system, method, v=rng.normal(size=n), y=rng.normal(size=n), dt=f * limit, steps=3000)
        # Above, r₁ is 1.01 or more, so 3000 steps make 1e13 and more; below, an ellipse of axes 45 for a start, times conditions.
        assert (float(np.abs(run.y[-1]).max()) < 1e7) == bounded


def test_an_empty_block_and_two_equal_pairs() -> None:
    """Without velocities there is nothing to use early: False Euler is Standard Euler, and both Heuns are Heun."""
    a = np.array([[-1.0, 2.0], [-2.0, -1.0]])
    system = sw.LinearSystem(a, velocities=0)
    p = {m: sw.analyse(system, m, dt=0.1).P for m in METHODS}
    for m in ("false_euler", "damped_euler"):
        np.testing.assert_array_equal(p[m], p["standard_euler"])
    for m in ("false_heun", "semi_false_heun"):
        np.testing.assert_allclose(p[m], p["standard_heun"], rtol=0, atol=1e-16)
    # Two equal oscillators, one driving the other: a double pair on the circle grows linearly, as the exact solution does.
    # v̇₁ = −y₁, v̇₂ = −y₂ + y₁
    a = np.zeros((4, 4))
    a[2, 0] = a[3, 1] = 1.0
    a[0, 2] = a[1, 3] = -1.0
    a[1, 2] = 1.0
    analysis = sw.analyse(sw.LinearSystem(a), "false_euler", dt=0.5)
    assert (analysis.kind, bool(analysis.stable)) == ("unstable oscillation (double pair)", False)
    a[1, 2] = 0.0
    analysis = sw.analyse(sw.LinearSystem(a), "false_euler", dt=0.5)
    assert (analysis.kind, bool(analysis.stable)) == ("harmonic", True)


def test_a_system_of_one_state() -> None:
    """ẏ = −y: Euler up to 2, RK4 up to 2.785293563405282, all by one real eigenvalue."""
    decay = sw.LinearSystem([[-1.0]])
    euler = sw.stability_limit(decay, "standard_euler")
    assert euler == pytest.approx(2.0, rel=1e-14)
    assert euler.mode.eigenvalue == pytest.approx(-1.0, abs=1e-12)
    assert sw.stability_limit(decay, "rk4") == pytest.approx(2.785293563405282, rel=1e-14)
    a = sw.analyse(decay, "standard_euler", dt=[0.5, 1.0, 1.5, 2.5])
    assert a.kind.tolist() == ["monotonic stable", "monotonic stable", "damped oscillation", "unstable oscillation"]
    assert a.polynomial.tolist() == [[1.0] * 4, [-0.5, 0.0, 0.5, 1.5]]
    assert sw.analyse(sw.LinearSystem([[0.0]]), "rk4", dt=1.0).kind == "constant"
    assert sw.stability_limit(sw.LinearSystem([[0.0]]), "rk4") == math.inf
    assert sw.stability_limit(sw.LinearSystem([[0.1]]), "rk4") == 0.0


def test_the_matrices_are_in_the_order_of_the_blocks() -> None:
    """Q of an exact hold: what a step makes of each column of B, for inputs that were not even given."""
    a, b = np.array([[-1.0, 2.0], [-2.0, -1.0]]), np.array([[1.0, 0.0, 2.0], [0.5, -1.0, 0.0]])
    system = sw.LinearSystem(a, b, velocities=0)
    h = 0.2
    analysis = sw.analyse(system, "rk4", dt=h)
    assert analysis.inputs == ("x[0]", "x[1]", "x[2]")
    z = h * a
    series_of_input = h * (np.eye(2) + z / 2 + z @ z / 6 + z @ z @ z / 24) @ b
    np.testing.assert_allclose(analysis.Q, series_of_input, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(sw.analyse(system, "rk4", dt=[h, 0.3]).Q[:, :, 0], analysis.Q)
    system = sw.LinearSystem(np.diag([-1.0, -2.0, -3.0]), velocities=[2])
    analysis = sw.analyse(system, "standard_euler", dt=0.1)
    assert analysis.slots == ["v[0]", "y[0]", "y[1]"]
    np.testing.assert_allclose(np.diag(analysis.P), [0.7, 0.9, 0.8])
    assert operations("standard_euler", system).multiplications == 9
    assert maps.size(system) == (1, 2)
    assert series("rk4").p[2] == -0.5
