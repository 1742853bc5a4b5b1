"""Derivatives of runs as columns beside the state: those of the computed steps, for every method."""

from typing import Any

import mpmath
import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from stepwell.model.derivatives.columns import Columns
from stepwell.model.derivatives.traced import Traced

EPS = np.finfo(float).eps
ONE_STEP = [method for method in sw.methods() if not method.splits and not method.is_exact]
METHODS = [method.name for method in ONE_STEP]
#: Methods whose steps are sums of rates, in which numbers may be of any precision.
EXPLICIT = [
    method.name
    for method in ONE_STEP
    if not (method.is_implicit or method.has_series or method.needs_acceleration or method.kept or method.carry)
]


@sw.system(order=1, shape=(3,))
def lorenz(t: Any, y: Any, *, sigma: Any = 10.0, rho: Any = 28.0, beta: Any = 8.0 / 3.0) -> Any:
    """Three equations of first order."""
    return np.array([sigma * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]])


@sw.system(shape=(2,))
def springs(t: Any, v: Any, y: Any, *, k: Any = (1.0, 2.0), stiffening: Any = 0.5) -> Any:
    """Two masses in a line, whose forces do not depend on the velocity."""
    return np.array([-k[0] * y[0] - stiffening * (y[0] - y[1]) ** 3, -k[1] * y[1] + stiffening * (y[0] - y[1]) ** 3])


@sw.system
def duffing(t: Any, v: Any, y: Any, *, beta: Any = 1.0, delta: Any = 0.3, omega: Any = 1.2) -> Any:
    """With sine, exponential and a choice, of which derivatives know more than operations."""
    return 0.5 * np.cos(omega * t) - delta * v + y - beta * y**3 - 0.1 * np.exp(-(y**2)) + np.maximum(0.2 - y, 0.0)


def made(system: Any, method: str, by: tuple[str, ...], v: Any, y: Any, **options: Any) -> tuple[Any, Any, Columns]:
    """The run of the system with columns, its blocks and derivatives apart, and the system with columns."""
    batch = system.batch
    columns = Columns(system.for_state_shapes(v, y), by)
    begin_v, begin_y = columns.beside(np.zeros(0) if v is None else np.asarray(v, float), np.asarray(y, float), batch)
    run = sw.integrate(columns, method, v=begin_v, y=begin_y, **options)
    return run, columns.apart(run.v, run.y), columns


@pytest.mark.parametrize("method", EXPLICIT)
def test_derivatives_are_those_of_the_scheme(method: str) -> None:
    """In 50 digits, by differences of 10⁻²⁰, whose error is 10⁻⁴⁰, by every parameter and every number of the start."""
    start, numbers, steps, dt = [1.0, 2.0, 20.0], {"sigma": 10.0, "rho": 28.0, "beta": 8.0 / 3.0}, 8, 0.01
    _, (_, _, found), _ = made(lorenz(), method, ("sigma", "rho", "beta", "y"), None, np.array(start), dt=dt, steps=steps)
    of = sw.method(method).steps

    def stepped(y: Any, **parameters: Any) -> Any:
        def rates(y: Any) -> Any:
            return lorenz.function(0.0, y, **{name: mpmath.mpf(each) for name, each in (numbers | parameters).items()})

        class Scaled:
            dv = staticmethod(lambda t, v, y: v)
            dy = staticmethod(lambda t, v, y: dt * rates(y))

        v, y = np.zeros(0, object), np.array([mpmath.mpf(each) for each in y], object)
        for _ in range(steps):
            v, y = of.step(Scaled, 0.0, dt, v, y)[:2]
        return y

    with mpmath.workdps(50):
        small = mpmath.mpf(10) ** -20
        for name, number in numbers.items():
            up, down = (stepped(start, **{name: mpmath.mpf(number) + sign * small}) for sign in (1, -1))
            true = np.array([float(each) for each in (up - down) / (2 * small)])
            # Some 30 operations a stage, of up to 16 stages, each of which rounds once, in 8 steps.
            np.testing.assert_allclose(found[name][1][-1], true, rtol=0, atol=1e-13 * max(1.0, abs(true).max()))
        for j in range(3):
            moved = [[mpmath.mpf(each) + sign * small * (i == j) for i, each in enumerate(start)] for sign in (1, -1)]
            true = np.array([float(each) for each in (stepped(moved[0]) - stepped(moved[1])) / (2 * small)])
            np.testing.assert_allclose(found["y"][1][-1][:, j], true, rtol=0, atol=1e-13 * max(1.0, abs(true).max()))


@pytest.mark.parametrize("method", METHODS)
def test_derivatives_are_those_of_the_tape_of_the_step(method: str) -> None:
    """One step, differentiated operation by operation: elimination, series and choices, too."""
    system = (springs if sw.method(method).needs_acceleration else duffing)().for_state_shapes(0.2, np.full((2,), 0.7))
    if system.y_shape == ():
        system = duffing().for_state_shapes(0.2, 0.7)
    v, y = np.broadcast_to(0.2, system.v_shape), np.broadcast_to(0.7, system.y_shape)
    if sw.method(method).carry is not None or sw.method(method).kept:
        pytest.skip("the state of a step is not that of the run")
    n = v.size + y.size
    _, (_, _, found), _ = made(system, method, ("v", "y"), v, y, dt=0.05, steps=1)
    traced = Traced(system, "step", sw.method(method))
    rows = [*traced.rows(np.array(v), np.array(y)), np.zeros(())]
    for j in range(n):
        change = [np.array(float(i == j)) for i in range(n)]
        values = traced.tangent()([*rows, *change], 0.0, 0.05)
        true = np.array([float(each) for each in values[n:]])
        name, place = ("v", j) if j < v.size else ("y", j - v.size)
        both = [each[-1].reshape(-1, (v if name == "v" else y).size)[:, place] for each in found[name]]
        np.testing.assert_allclose(np.concatenate(both), true, rtol=0, atol=1e-13)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("steps", [{"dt": 0.03, "steps": 12, "every": 5}, {"tolerance": 1e-6, "at": [0.2, 0.5]}])
def test_both_backends_agree_and_steps_are_those_without_columns(method: str, steps: dict[str, Any]) -> None:
    if "tolerance" in steps and sw.method(method).error_order is None:
        return
    needs = sw.method(method).needs_acceleration
    system = springs(stiffening=np.array([0.5, 0.7])) if needs else duffing(beta=np.array([1.0, 1.3]))
    if "tolerance" in steps and sw.method(method).has_series:  # which does not see a choice within a step
        with pytest.raises(UnsupportedError, match="chooses between values"):
            made(system, method, ("beta",), 0.2, 0.8, **steps)
        needs, system = True, springs(stiffening=np.array([0.5, 0.7]))
    y: Any = np.array([0.3, -0.4]) if needs else 0.8
    v: Any = np.array([0.1, 0.2]) if needs else 0.2
    by = ("stiffening", "k", "y") if needs else ("beta", "omega", "v")
    v, y = (np.repeat(np.asarray(each)[..., np.newaxis], 2, axis=-1) for each in (v, y))
    run, (own_v, own_y, found), columns = made(system, method, by, v, y, **steps)
    begin_v, begin_y = columns.beside(v, y, (2,))
    by_numpy = sw.integrate(columns, method, v=begin_v, y=begin_y, backend="numpy", **steps)
    assert (run.v.tobytes(), run.y.tobytes()) == (by_numpy.v.tobytes(), by_numpy.y.tobytes())
    plain = sw.integrate(system, method, v=v, y=y, **steps)
    if "tolerance" in steps and sw.method(method).is_implicit:  # whose systems are solved with the columns in them
        np.testing.assert_allclose(own_y, plain.y, rtol=0, atol=1e-12)
    else:
        assert (own_v.tobytes(), own_y.tobytes()) == (plain.v.tobytes(), plain.y.tobytes())
    shapes = {name: found[name][1].shape[1:] for name in by}
    block = system.for_state_shapes(v, y).y_shape
    assert shapes[by[0]] == (*block, 2)
    assert not needs or shapes["k"] == (2, 2, 2)


def test_a_switch_of_the_time_ends_steps_as_it_does_without_columns() -> None:
    @sw.system(order=1)
    def dosed(t: Any, y: Any, *, rate: Any = 1.5, dose: Any = 2.0) -> Any:
        return np.where(t < 0.3, dose, 0.0) - rate * y

    steps = {"tolerance": 1e-8, "at": [0.2, 1.0]}
    _, (_, own_y, found), _ = made(dosed(), "dop853", ("dose", "rate"), None, 0.0, **steps)
    assert own_y.tobytes() == sw.integrate(dosed(), "dop853", y=0.0, **steps).y.tobytes()
    # y = (dose/rate)(1 − e^(−rate·0.3))·e^(−rate·(t − 0.3)), and linear in the dose.
    true = (1.0 - np.exp(-1.5 * 0.3)) / 1.5 * np.exp(-1.5 * 0.7)
    assert abs(found["dose"][1][-1] - true) < 1e-8


def test_what_is_not_made_of_rates_is_refused() -> None:
    bodies = sw.NBody([1.0, 1.0], dim=2)
    for system in (bodies.under(sw.EnergyControl(0.1), ()), sw.Particles([1.0], dim=2, floor=sw.Floor())):
        with pytest.raises(UnsupportedError, match="expected a system whose steps are made of its rates alone"):
            Columns(system, ("y",))
