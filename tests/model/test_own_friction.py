"""Friction that sticks, of own equations: against closed forms and built-in friction, with all options, and what is refused."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, StepwellError, TraceError, UnsupportedError
from stepwell.reference import friction
from stepwell.reference.systems import equations
from support import own_systems as own
from support.calls import a_step, assert_raises
from support.looped import looped
from support.mistakes import mistaken

ABLE = [method.name for method in sw.methods() if not method.needs_acceleration]
G = 9.81


@sw.system
def block(t: Any, v: Any, y: Any, *, slope: Any = 0.0, mu: Any = 0.5) -> Any:
    """On a plane, which may slope."""
    return -G * np.sin(slope)


@block.friction
def sliding(t: Any, v: Any, y: Any, *, slope: Any, mu: Any) -> Any:
    return mu * G * np.cos(slope)


#: On a table.
puck = sw.system(shape=(2,))(lambda t, v, y, *, mu=0.5: np.zeros(2))
puck.friction(of="row")(lambda t, v, y, *, mu: mu * G)


@sw.system
def bead(t: Any, v: Any, y: Any, *, mu: Any = 0.3, g: Any = 1.0) -> Any:
    """On an upright hoop of radius 1, by its angle from below: it is pressed on the hoop by its weight and its turning."""
    return -g * np.sin(y)


@bead.friction
def on_the_hoop(t: Any, v: Any, y: Any, *, mu: Any, g: Any) -> Any:
    return mu * np.abs(v * v + g * np.cos(y))


@sw.system
def bead_while_it_rises(t: Any, v: Any, y: Any, *, mu: Any = 0.3, g: Any = 1.0) -> Any:
    """The same while its angle grows."""
    return -g * np.sin(y) - mu * np.abs(v * v + g * np.cos(y))


#: Nothing pushes it.
lifted = sw.system(lambda t, v, y: np.zeros(()))
lifted.friction(lambda t, v, y: -1.0)


@looped("method", ["false_euler", "standard_euler"])
def test_a_block_stops_where_the_built_in_one_does(method: str) -> None:
    systems = (block(), sw.Oscillator(0.0, friction=0.5 * G, form="physical"))
    run, same = (sw.integrate(each, method, v=3.0, y=0.0, dt=1 / 60, steps=60, every=1) for each in systems)
    np.testing.assert_array_equal(run.v, same.v)
    np.testing.assert_array_equal(run.y, same.y)


@looped("method", ABLE)
def test_a_slope_holds_a_block_up_to_its_angle_of_friction(method: str) -> None:
    """tan slope ≤ μ holds; steeper, v = −g(sin − μ·cos)t, which every method has but for roundings, here below 1000 · 2⁻⁵²."""
    slope = np.arctan(0.5) * np.array([-0.99, 0.99, 1.01, 1.5])
    run = sw.integrate(block(slope=slope), method, v=np.zeros(4), y=0.0, dt=0.01, steps=100)
    assert (run.v[-1, :2] == 0.0).all()
    assert (run.y[-1, :2] == 0.0).all()
    fast = -G * (np.sin(slope) - 0.5 * np.cos(slope))[2:]
    np.testing.assert_allclose(run.v[-1, 2:], fast, rtol=1e-11)


@looped("method", ["false_euler", "rk4", "merson"])
def test_a_puck_slides_straight_in_every_direction(method: str) -> None:
    """It stops after v²/2μg, but for a way of 6lh, or by Euler's method the half step ½hv more; see test_friction."""
    h, angles = 0.01, np.linspace(0.0, 2.0 * np.pi, 13)
    v = 3.0 * np.stack([np.cos(angles), np.sin(angles)])
    run = sw.integrate(puck(), method, v=v, y=np.zeros((2, 13)), dt=h, steps=100)
    assert (run.v[-1] == 0.0).all()
    way = np.hypot(*run.y[-1])
    assert (abs(way - 9.0 / G) < 0.5 * h * 3.0 * (method == "false_euler") + 6 * 0.5 * G * h * h).all()
    across = run.y[-1, 0] * np.sin(angles) - run.y[-1, 1] * np.cos(angles)
    assert (abs(across) < 1e-14).all()


def test_a_normal_force_may_depend_on_the_state() -> None:
    """While the bead rises, friction is one more force; then it turns, slides back and sticks."""
    options: dict[str, Any] = {"v": 1.5, "y": 0.0, "dt": 0.001, "every": 1}
    run = sw.integrate(bead(), "rk4", steps=20000, **options)
    rising = int(np.argmax(run.v <= 0.01))
    smooth = sw.integrate(bead_while_it_rises(), "rk4", steps=rising, **options)
    np.testing.assert_allclose(run.y[:rising], smooth.y[:rising], rtol=1e-12)
    assert (run.v[-100:] == 0.0).all()
    angle = float(run.y[-1])
    assert 0.0 < abs(np.tan(angle)) <= 0.3  # within its angle of friction


def test_a_negative_deceleration_is_none() -> None:
    run = sw.integrate(lifted(), "rk4", v=[1.0, -1.0, 0.0], y=0.0, dt=0.125, steps=8)
    np.testing.assert_array_equal(run.v[-1], [1.0, -1.0, 0.0])


def test_a_pole_swings_on_a_cart_that_sticks() -> None:
    """θ̈ = (g/l)·sin θ of a hinge that rests; the terms of the cart cancel but for roundings."""
    run = sw.integrate(own.cart(mu=50.0), "rk4", v=[0.0, 0.0], y=[0.5, 0.3], dt=0.01, steps=300, every=1)
    assert (run.v[:, 0] == 0.0).all()
    assert (run.y[:, 0] == 0.5).all()
    pole = sw.integrate(own.pendulum(omega=np.sqrt(2.0)), "rk4", v=0.0, y=0.3 - np.pi, dt=0.01, steps=300, every=1)
    np.testing.assert_allclose(run.y[:, 1], pole.y + np.pi, rtol=0, atol=1e-11)


def test_without_friction_a_cart_and_its_pole_go_on() -> None:
    """Friction of zero changes no bit but for the sign of a zero, and the energy stays; with some it only falls."""

    def energy(run: Any) -> Any:
        (x, w), angle = np.moveaxis(run.v, 1, 0), run.y[:, 1]
        tip = 0.05 * ((x + 0.5 * np.cos(angle) * w) ** 2 + (0.5 * np.sin(angle) * w) ** 2)
        return 0.5 * x * x + tip + 0.1 * 0.5 * np.cos(angle)

    options: dict[str, Any] = {"v": [0.3, 0.0], "y": [0.0, 0.3], "dt": 0.005, "steps": 2000, "every": 1}
    free = energy(sw.integrate(own.cart(mu=0.0), "rk4", **options))
    assert np.ptp(free) < 1e-9
    rubbed = energy(sw.integrate(own.cart(mu=0.02), "rk4", **options))
    assert (np.diff(rubbed) < 1e-9).all()
    assert rubbed[-1] < rubbed[0] - 0.01


def test_a_number_alone_changes_no_other() -> None:
    two = sw.system(lambda t, v, y: -y)
    two.friction(component=1)(lambda t, v, y: 0.4)
    run = sw.integrate(two(), "rk4", v=[0.0, 0.0], y=[1.0, 1.0], dt=0.01, steps=2000, every=1)
    built_in = sw.integrate(sw.Oscillator(1.0, friction=[0.0, 0.4]), "rk4", v=0.0, y=1.0, dt=0.01, steps=2000, every=1)
    np.testing.assert_allclose(run.y, built_in.y, rtol=0, atol=1e-11)
    assert (run.v[-1] != 0.0).tolist() == [True, False]


# ---- with other parts of the package: test_ways.py has its bits with all options


def test_a_world_takes_another_coefficient() -> None:
    world = sw.World(block(), "rk4", v=np.array([1.0]), y=np.zeros(1), dt=0.01)
    world.step(100)
    assert world.v[0] == 0.0
    world.set(slope=0.6)  # steeper than its friction holds
    world.step(100)
    assert world.v[0] < -0.5
    world.set(mu=2.0)
    world.step(100)
    assert world.v[0] == 0.0


def test_a_sweep_over_the_coefficient() -> None:
    rows = sw.sweep(lambda mu: block(mu=mu), {"mu": [0.2, 0.5, 1.0]}, "rk4", v=3.0, y=0.0, dt=0.01, steps=400)
    np.testing.assert_allclose(rows["y_last"], 4.5 / G / np.array([0.2, 0.5, 1.0]), rtol=2e-3)


def test_it_has_its_own_digest() -> None:
    plain = sw.system(lambda t, v, y, *, slope=0.0, mu=0.5: -G * np.sin(slope))
    assert plain().digest != block().digest == pickle.loads(pickle.dumps(block())).digest


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            "return np.asarray(bits.where(np.expand_dims(bits.at_most(length, self.limit), self.axis), -v, forward))",
            "return Separate(np.expand_dims(self.limit, self.axis)).reduced(v, f)",
        ),
        ("square = square + each * each", "pass"),
    ],
    ids=["each component on its own", "the first number alone for the length"],
)
def test_friction_by_components_is_noticed(old: str, new: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def is_right() -> bool:
        v = np.array([1.0, 2.0])
        run = sw.integrate(puck(), "false_euler", v=v, y=np.zeros(2), dt=0.01, steps=100, backend="numpy")
        straight = abs(run.y[-1, 0] * v[1] - run.y[-1, 1] * v[0]) < 1e-14
        return bool(straight and abs(np.hypot(*run.y[-1]) - 5.0 / G) < 0.02)

    assert is_right()
    monkeypatch.setattr(equations, "OnVectors", mistaken(friction, old, new).OnVectors)
    assert not is_right()


@pytest.mark.mutant
def test_a_pole_left_behind_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    def off() -> float:
        start: dict[str, Any] = {"y": [0.5, 0.3], "dt": 0.01, "steps": 100}
        run = sw.integrate(own.cart(mu=50.0), "false_euler", v=[0.0, 0.0], **start, backend="numpy")
        pole = sw.integrate(own.pendulum(omega=np.sqrt(2.0)), "false_euler", v=0.0, y=0.3 - np.pi, dt=0.01, steps=100)
        return float(abs(run.y[-1, 1] - pole.y[-1] - np.pi))

    assert off() < 1e-12
    wrong = mistaken(friction, "self.at, self.along = at, along", "self.at, self.along = at, None")
    monkeypatch.setattr(equations, "OnOne", wrong.OnOne)
    assert off() > 1e-3


@sw.system
def pair(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
    return -k * y


@pair.invariant
def energy(v: Any, y: Any, *, k: Any) -> Any:
    return 0.5 * v**2 + 0.5 * k * y**2


@pair.friction
def rubbing(t: Any, v: Any, y: Any, *, k: Any) -> Any:
    return 0.1 * k


def fresh(**options: Any) -> Any:
    @sw.system
    def bare(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -k * y

    return bare.friction(**options) if options else bare.friction


def declared(function: Callable[..., Any], v: Any = (0.0, 0.0), **options: Any) -> Callable[[], Any]:
    def call() -> Any:
        bare = sw.system(shape=np.shape(v))(lambda t, v, y, *, k=1.0: -k * y)
        bare.friction(**options)(function)
        return sw.integrate(bare(), "rk4", v=v, y=v, dt=0.1, steps=1)

    return call


def of_pair(*arguments: Any, **options: Any) -> Callable[[], Any]:
    return partial(a_step, pair, *arguments, **options)


DEPENDS = "has friction that sticks; what it does depends on the step"
TAKES = "from which friction takes energy for good"
REFUSALS: list[tuple[Callable[[], Any], type[StepwellError], str]] = [
    (lambda: sw.system(order=1)(lambda t, y: -y).friction(sliding), ArgumentError, "friction acts on velocities, .* has none"),
    (lambda: pair.friction(rubbing), ArgumentError, "pair: expected one function for friction, and rubbing is declared"),
    (lambda: fresh()(3), DTypeError, "bare: expected a function as friction, got int"),
    (lambda: fresh()(lambda v, y: 1.0), ArgumentError, r"expected a function \(t, v, y, \*, …\), got \(v, y\)"),
    (lambda: fresh()(lambda t, v, y, mu: 1.0), ArgumentError, "parameters of the system, got 'mu'. Known: k"),
    (lambda: fresh(of="body"), ArgumentError, "of: there is no 'body'. Known: component, row"),
    (lambda: fresh(of="row", component=0), ArgumentError, "component: one number of v is no row"),
    (declared(lambda t, v, y: 1.0, component=2), TraceError, r"component=2 is no number of a v of shape \(2,\)"),
    (declared(lambda t, v, y: 1.0, v=0.0, of="row"), TraceError, 'of="row" needs vectors along the last axis of v'),
    (declared(lambda t, v, y: np.ones(3)), TraceError, r"deceleration of shape \(2,\), or one number, got shape \(3,\)"),
    (declared(lambda t, v, y: (1.0, 2.0, 3.0), component=0), TraceError, "expected a deceleration, or a pair"),
    (declared(lambda t, v, y: None), TraceError, r"expected a deceleration of shape \(2,\), got nothing"),
    (lambda: sw.jacobian(pair(), v=0.0, y=1.0), UnsupportedError, "rates: .* has friction that sticks"),
    (of_pair("merson", dt=None, steps=None, tolerance=1e-3, at=[1.0]), UnsupportedError, f"tolerance: .* {DEPENDS}"),
    (of_pair(control=sw.Control("energy", 1.0)), UnsupportedError, f"control: .* an invariant of .*, {TAKES}; leave one out"),
    (of_pair(control=sw.Projection("energy")), UnsupportedError, TAKES),
    (of_pair(dt=-0.1), UnsupportedError, "dt: a negative step needs a unique past"),
    (of_pair("leapfrog"), UnsupportedError, "leapfrog needs .*, but .* has friction; use false_euler, or leave friction out"),
]


def test_what_does_not_go_is_refused() -> None:
    assert_raises(*REFUSALS)
