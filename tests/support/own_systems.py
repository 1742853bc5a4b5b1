"""Systems of one's own, for the tests: every way to write one, at the top of a module so that they can be pickled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import stepwell as sw

ONES, THREE, EYE = np.ones(3), np.array([1.0, 2.0, 3.0]), np.eye(3)


@sw.system
def duffing(t: Any, v: Any, y: Any, *, alpha=-1.0, beta=1.0, delta=0.3, gamma=0.5, omega=1.2) -> Any:  # type: ignore[no-untyped-def]
    """A spring that hardens, damped and driven."""
    return gamma * np.cos(omega * t) - delta * v - alpha * y - beta * y**3


@sw.system(order=1)
def lorenz(t: Any, y: Any, *, sigma: Any = 10.0, rho: Any = 28.0, beta: Any = 8 / 3) -> Any:
    """Three numbers that never repeat."""
    return np.array([sigma * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]])


@sw.system(order=1)
def lotka_volterra(t: Any, y: Any, *, a: Any = 1.5, b: Any = 3.0) -> Any:
    """Prey and predators, neither of which becomes negative."""
    return np.array([a * y[0] - y[0] * y[1], y[0] * y[1] - b * y[1]])


@lotka_volterra.invariant
def cycle(y: Any, *, a: Any, b: Any) -> Any:
    """What a cycle of them keeps."""
    return y[0] - b * np.log(y[0]) + y[1] - a * np.log(y[1])


@sw.system
def pendulum(t: Any, v: Any, y: Any, *, omega: Any = 1.0) -> Any:
    """The built-in one, written by oneself."""
    return -(omega * omega) * np.sin(y)


@pendulum.invariant
def energy(v: Any, y: Any, *, omega: Any) -> Any:
    """Of the pendulum."""
    return 0.5 * v**2 + omega**2 * (1.0 - np.cos(y))


@sw.system
def springs(t: Any, v: Any, y: Any, *, k: Any = 1.0, rest: Any = 0.4) -> Any:
    """A ring of points with a spring between neighbours, in the plane or in space: a state of any shape."""
    d = np.roll(y, -1, axis=0) - y
    length = np.sqrt((d * d).sum(axis=1, keepdims=True))
    pull = k * (1.0 - rest / length) * d
    return pull - np.roll(pull, 1, axis=0)


@sw.system
def attracted(t: Any, v: Any, y: Any, *, masses: Any = ONES, softening: Any = 0.3) -> Any:
    """Bodies, pair by pair; a parameter with an axis of its own."""
    pulls = []
    for i in range(len(masses)):
        pull: Any = 0.0
        for j in range(len(masses)):
            if i != j:
                d = y[j] - y[i]
                r2 = np.dot(d, d) + softening**2
                pull = pull + masses[j] * d / (r2 * np.sqrt(r2))
        pulls.append(pull)
    return np.stack(pulls)


@sw.system(blocks=2)
def top(t: Any, w: Any, q: Any, *, inertia: Any = THREE) -> Any:
    """Euler's equations and a quaternion: blocks of two lengths."""
    turning = np.cross(inertia * w, w) / inertia
    scalar, vector = q[0], q[1:]
    return turning, 0.5 * np.concatenate([[-np.dot(vector, w)], scalar * w + np.cross(vector, w)])


@top.invariant
def norm(w: Any, q: Any) -> Any:
    """The square of the quaternion's length."""
    return np.dot(q, q)


@sw.system
def pushed(t: Any, v: Any, y: Any, *, k: Any = 1.0, x: Any = 0.0) -> Any:
    """A parameter that may be an input or a function of the time."""
    return -k * y + x


def turning(t: Any) -> Any:
    """A function of the time, in the place of a parameter."""
    return np.sin(2.0 * t)


@sw.system
def bouncing(t: Any, v: Any, y: Any, *, stiffness: Any = 100.0, gravity: Any = 1.0) -> Any:
    """A choice between two forces, without an ``if``."""
    return np.where(y < 0.0, -stiffness * y, 0.0) - gravity


def _saturated(x: Any) -> Any:
    return x / math.sqrt(1.0 + x * x)


@sw.system(order=1)
def network(t: Any, y: Any, *, weights: Any = EYE) -> Any:
    """A matrix of parameters; a function of the module, and ``math`` in it."""
    return [_saturated(each) - value for each, value in zip(weights @ y, y, strict=True)]


@sw.system(order=1)
def scipys(t, y):  # type: ignore[no-untyped-def]
    """As ``solve_ivp`` takes it."""
    a, b = y
    return [b, -a]


@sw.system
def sloping(t: Any, v: Any, y: Any, *, slope: Any = 0.3, mu: Any = 0.2, g: Any = 1.0) -> Any:
    """A block on a slope that turns to and fro."""
    return -g * np.sin(slope * np.cos(t))


@sloping.friction
def on_the_slope(t: Any, v: Any, y: Any, *, slope: Any, mu: Any, g: Any) -> Any:
    """The normal force depends on the time."""
    return mu * g * np.cos(slope * np.cos(t))


@sw.system(shape=(3, 2))
def pucks(t: Any, v: Any, y: Any, *, k: Any = 1.0, mu: Any = 0.1) -> Any:
    """Bodies on a table, each on a spring to the middle."""
    return -k * y


@pucks.friction(of="row")
def on_the_table(t: Any, v: Any, y: Any, *, mu: Any) -> Any:
    """Against the direction of each body."""
    return mu


@sw.system
def cart(t: Any, v: Any, y: Any, *, mu: Any = 0.05, pole: Any = 0.1, length: Any = 0.5, g: Any = 1.0) -> Any:
    """A cart of mass 1 with a pole on a hinge, as of Barto, Sutton and Anderson but for the pole's inertia: place and angle."""
    sine, cosine = np.sin(y[1]), np.cos(y[1])
    forward = pole * sine * (length * v[1] ** 2 - g * cosine) / (1.0 + pole * sine * sine)
    return np.stack([forward, (g * sine - forward * cosine) / length])


@cart.friction(component=0)
def on_the_rail(t: Any, v: Any, y: Any, *, mu: Any, pole: Any, length: Any, g: Any) -> Any:
    """The pole goes with the cart."""
    sine = np.sin(y[1])
    return mu * (1.0 + pole) * g / (1.0 + pole * sine * sine), np.stack([1.0, -np.cos(y[1]) / length])
