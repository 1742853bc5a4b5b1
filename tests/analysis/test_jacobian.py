"""Jacobians of systems and of steps at a state: against forms written by hand, differences, and the complex step."""

import copy
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import maps
from stepwell.errors import UnsupportedError
from stepwell.model.derivatives import traced
from stepwell.model.derivatives.traced import Traced
from support.differences import central
from support.families import family
from support.looped import in_turn, looped
from support.refusals import refused

EPS = np.finfo(float).eps


def kepler(v: Any, y: Any) -> Any:
    """The Jacobian of two bodies of masses 1 and 2 with G = 1, by hand: ∂a₁/∂y₁ = −m₂(I/r³ − 3·d·dᵀ/r⁵)."""
    d = y[1] - y[0]
    r = np.sqrt(d @ d)
    tide = np.eye(2) / r**3 - 3 * np.outer(d, d) / r**5
    J = np.zeros((8, 8))
    J[:4, 4:] = np.block([[-2 * tide, 2 * tide], [tide, -tide]])
    J[4:, :4] = np.eye(4)
    return J


def restricted(mu: float, y: Any) -> Any:
    """That of the restricted problem: second derivatives of Ω = ½(x² + y²) + (1 − μ)/r₁ + μ/r₂, and the Coriolis force."""
    J = np.zeros((4, 4))
    J[:2, :2] = [[0, 2], [-2, 0]]
    J[2:, :2] = np.eye(2)
    K = np.eye(2)
    for mass, place in ((1 - mu, -mu), (mu, 1 - mu)):
        d = y - [place, 0]
        r = np.sqrt(d @ d)
        K = K - mass * (np.eye(2) / r**3 - 3 * np.outer(d, d) / r**5)
    J[:2, 2:] = K
    return J


def test_jacobians_written_by_hand() -> None:
    draw = np.random.default_rng(7)
    for _ in range(20):
        v, y = draw.uniform(-2, 2, 2)
        jacobian = sw.jacobian(sw.Pendulum(1.5, 0.2), v=v, y=y)
        true = [[-2 * 0.2 * 1.5, -(1.5**2) * np.cos(y)], [1, 0]]
        np.testing.assert_allclose(jacobian.matrix, true, rtol=0, atol=4 * EPS * 2.25)
        v2, y2 = draw.uniform(-2, 2, (2, 2, 2))
        jacobian = sw.jacobian(sw.NBody([1.0, 2.0], force="newton", dim=2), v=v2, y=y2)
        true = kepler(v2, y2)
        # Some fifteen roundings of m/r³ and 3m/r³ on either side; a difference of coordinates is rounded too, and r⁻³ turns its
        # eps·4/r into three times that of the result. That again for the directions in d·dᵀ.
        r = np.hypot(*(y2[1] - y2[0]))
        np.testing.assert_allclose(jacobian.matrix, true, rtol=0, atol=EPS * (40 + 40 / r) * 8 / r**3)
        mu, y1 = draw.uniform(0.01, 0.5), draw.uniform(-1.5, 1.5, 2)
        jacobian = sw.jacobian(sw.RestrictedThreeBody(mu), v=draw.uniform(-1, 1, 2), y=y1)
        r = min(np.hypot(y1[0] + mu, y1[1]), np.hypot(y1[0] - 1 + mu, y1[1]))
        np.testing.assert_allclose(jacobian.matrix, restricted(mu, y1), rtol=0, atol=EPS * (40 + 40 / r) * 4 * (1 + 1 / r**3))
    np.testing.assert_array_equal(jacobian.vv, jacobian.matrix[:2, :2])
    np.testing.assert_array_equal(jacobian.vy, jacobian.matrix[:2, 2:])
    np.testing.assert_array_equal(jacobian.yv, np.eye(2))
    np.testing.assert_array_equal(jacobian.yy, np.zeros((2, 2)))
    assert jacobian.names == ("v[0]", "v[1]", "y[0]", "y[1]")


DRAW = np.random.default_rng(3)
SYSTEMS: dict[str, tuple[sw.System, Any, Any]] = {
    "pendulum": (sw.Pendulum(1.3, 0.1), np.array(0.3), np.array(2.0)),
    "pendulum driven, in a batch": (
        sw.Pendulum(np.array([1.0, 2.0]), 0.1, a=sw.Sinusoid(1.0, 2.0, 0.3)),
        np.array([0.2, 0.1]),
        np.array([[1.0], [2.0], [-3.0]]),
    ),
    "bodies, 1/r": (sw.NBody([1.0, 2.0, 3.0]), DRAW.normal(size=(3, 2)), DRAW.normal(size=(3, 2))),
    "bodies in space": (sw.NBody(np.ones(3), force="newton", softening=0.1), DRAW.normal(size=(3, 3)), DRAW.normal(size=(3, 3))),
    "three bodies": (sw.RestrictedThreeBody(np.array([0.1, 0.3])), DRAW.normal(size=(2, 2)), DRAW.normal(size=(2, 2))),
    "oscillator": (sw.Oscillator(1.0, 0.1, x=1.0), np.array(0.2), np.array(1.0)),
    "chain": (sw.Chain(4), np.zeros(4), np.arange(4.0)),
    "matrix": (sw.LinearSystem([[0, 1, 2], [3, 4, 5], [6, 7, 8.0]], velocities=1), np.ones(1), np.ones(2)),
}


@looped("name", SYSTEMS)
def test_jacobians_against_differences(name: str) -> None:
    system, v, y = SYSTEMS[name]
    system = system.for_state_shapes(v, y)
    jacobian = sw.jacobian(system, v=v, y=y, t=0.3)
    members = jacobian.matrix.shape[2:]
    n_v, n_y = maps.size(system)

    def rates(z: Any, i: int) -> Any:
        state = [np.broadcast_to(row, members).copy() for row in (*rows(v, n_v), *rows(y, n_y))]
        state[i] = state[i] + z
        a, b = (
            np.array(state[:n_v]).reshape((*system.v_shape, *members)),
            np.array(state[n_v:]).reshape((*system.y_shape, *members)),
        )
        s = system.scaled(1.0, members)
        return maps.rows(system, np.asarray(s.dv(0.3, a, b)), np.asarray(s.dy(0.3, a, b)))

    def rows(block: Any, n: int) -> Any:
        return block.reshape(n, *block.shape[block.ndim - (block.ndim - len(system.v_shape if n == n_v else system.y_shape)) :])

    for i in range(n_v + n_y):
        # A rate is a sum of up to some ten forces that may cancel: no more than 10⁻² of the largest of all is left, or else the
        # bound says nothing of it, and each has some twenty roundings.
        size = np.abs(rates(0.0, i)).max()
        true, bound = central(lambda z, i=i: rates(z, i), 0.0, EPS ** (1 / 3), 0.0)
        bound = bound + 1.5 * 20 * EPS * 10 * (size + 10.0) / EPS ** (1 / 3)
        assert (np.abs(jacobian.matrix[:, i] - true) <= bound).all()
        assert bound.max() < 2e-2 * max(1.0, np.abs(jacobian.matrix).max())


@pytest.mark.parametrize(("method", "name"), in_turn([m.name for m in sw.methods()], list(SYSTEMS)))
def test_a_step_has_the_derivative_that_the_complex_step_finds(name: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two ways that share no line: numbers with an infinitesimal imaginary part, and the differentiated tape."""
    system, v, y = SYSTEMS[name]
    record = sw.method(method)
    if record.needs_acceleration and (not system.second_order or system.velocity_term is not None):
        with pytest.raises(UnsupportedError):
            sw.analyse(system, method, dt=0.05, v=v, y=y)
        return
    dt = [0.05, 0.1, 0.2]
    one = sw.analyse(system, method, dt=np.reshape(dt, (3, 1, 1)), v=v, y=y, t=0.2)
    monkeypatch.setattr(type(system), "complex_step", False)
    other = sw.analyse(system, method, dt=np.reshape(dt, (3, 1, 1)), at=(v, y), t=0.2)
    # Both round some hundred times in up to twelve stages, relative to the largest element of P and of what made it; where
    # positions are nearly equal in Verlet's velocities, that is over the step.
    size = max(1.0, float(np.abs(one.P).max()))
    np.testing.assert_allclose(one.P, other.P, rtol=0, atol=400 * EPS * size)


@pytest.mark.parametrize("name", family(SYSTEMS, lambda name: name.startswith(("pendulum d", "bodies, 1/r", "three", "matrix"))))
def test_a_long_tape_is_differentiated_along_all_changes_at_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system, v, y = SYSTEMS[name]
    arguments = {"method": "rk4", "dt": 0.1, "v": v, "y": y, "t": 0.2}
    monkeypatch.setattr(type(system), "complex_step", False)
    whole, rates = sw.analyse(system, **arguments), sw.jacobian(system, v=v, y=y)
    monkeypatch.setattr(traced, "MAX_WHOLE", 0)
    along = sw.analyse(copy.copy(system), **arguments)
    # The same sums in another order, some hundred roundings of the largest element.
    np.testing.assert_allclose(along.P, whole.P, rtol=0, atol=200 * EPS * max(1.0, float(np.abs(whole.P).max())))
    other = sw.jacobian(copy.copy(system), v=v, y=y)
    np.testing.assert_allclose(other.matrix, rates.matrix, rtol=0, atol=200 * EPS * max(1.0, float(np.abs(rates.matrix).max())))
    np.testing.assert_array_equal(other.rates, rates.rates)


def test_states_are_given_in_one_way_and_limits_come_from_the_tape_too(monkeypatch: pytest.MonkeyPatch) -> None:
    for ask in (
        lambda **k: sw.analyse(sw.Pendulum(), "rk4", dt=0.1, **k),
        lambda **k: sw.stability_limit(sw.Pendulum(), "rk4", **k),
    ):
        refused(sw.errors.ArgumentError, "got v alone", ask, v=0.0)
        refused(sw.errors.ArgumentError, "v: expected the velocities", ask, y=0.0)
        refused(sw.errors.ArgumentError, "both", ask, v=0.0, y=0.0, at=(0.0, 0.0))
    plain = sw.stability_limit(sw.Pendulum(1.0, 0.1), "rk4", v=0.1, y=1.0)
    monkeypatch.setattr(sw.Pendulum, "complex_step", False)
    traced = sw.stability_limit(sw.Pendulum(1.0, 0.1), "rk4", at=(0.1, 1.0))
    assert traced == pytest.approx(plain, rel=1e-14)


def test_a_large_state_has_the_same_jacobian_by_the_complex_step() -> None:
    n = 20  # 80 numbers
    v, y = np.zeros((n, 2)), np.random.default_rng(0).normal(size=(n, 2))
    system = sw.NBody(np.ones(n), softening=0.3).for_state_shapes(v, y)
    jacobian = sw.jacobian(system, v=v, y=y)
    tape = Traced(system, "rates")
    assert tape.length == 80
    values = np.array([np.broadcast_to(each, ()) for each in tape.jacobian()([*tape.rows(v, y), np.zeros(())])])
    # Each element is a sum of twenty of size 1/0.3² at most, with some twenty roundings each.
    np.testing.assert_allclose(jacobian.matrix.reshape(-1), values[:6400], rtol=0, atol=40 * EPS * 20 / 0.09)
    np.testing.assert_allclose(jacobian.rates, values[6400:], rtol=0, atol=40 * EPS * 20 / 0.3)


def test_equal_operations_are_derived_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """With other numbers and inputs, too; a function that reads another number of its own is derived again."""
    known: dict[str, Any] = {}
    derived: list[int] = []
    derive = traced.jacobian
    monkeypatch.setattr(traced, "_jacobians", known)
    monkeypatch.setattr(traced, "jacobian", lambda *arguments: derived.append(1) or derive(*arguments))
    stiffness = 2.0

    @sw.system
    def spring(t: Any, v: Any, y: Any, *, c: Any = 0.1, u: Any = 0.0) -> Any:
        return u - stiffness * np.sin(y) - c * v

    def slopes(**numbers: Any) -> Any:
        return sw.jacobian(spring(**numbers), v=0.0, y=0.5).matrix

    for c in (0.1, 0.2, 0.3):
        np.testing.assert_array_equal(slopes(c=c), [[-c, -2.0 * np.cos(0.5)], [1.0, 0.0]])
    assert len(derived) == 1
    for first in (1.0, -1.0):  # what an input is does not change its operations, and it has its own samples
        slopes(u=sw.Sampled([first, 0.0], 0.1))
    assert len(derived) == 2
    stiffness = 3.0  # a constant on the tape
    np.testing.assert_array_equal(slopes()[0, 1], -3.0 * np.cos(0.5))
    assert len(derived) == 3
    for _ in range(traced.MAX_CACHED):
        stiffness += 1.0
        slopes()
    assert len(known) <= traced.MAX_CACHED
