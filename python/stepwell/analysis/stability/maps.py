"""One step as a linear map: the transition matrix of a step, the matrix of the rates, and the map from slots to states.

A matrix is of shape (n, n, *members): rows and columns are the numbers of a member's v block, then those of its y block.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Blocks, Shape
from ...model.compatibility import one_state
from ...model.derivatives import traced
from ...model.methods import Method
from ...model.parameters import aligned
from ...model.systems import System
from ...runs import engine
from ...runs.engine import exact, linear

#: The step ε of derivatives by the complex step, f'(x) = Im f(x + iε)/ε. Its square is below the smallest number, so they have no
#: truncation error.
COMPLEX_STEP = 1e-200


def size(system: System) -> tuple[int, int]:
    """The number of components of each block."""
    return prod(system.v_shape), prod(system.y_shape)


def blocks(system: System, states: Array) -> tuple[Array, Array]:
    """The blocks v and y of states that are columns of numbers, shape (n, *members)."""
    n_v, members = size(system)[0], states.shape[1:]
    return states[:n_v].reshape((*system.v_shape, *members)), states[n_v:].reshape((*system.y_shape, *members))


def transition(system: System, method: Method, dt: Array) -> Array:
    """P of a linear system, of shape (n, n, *members): the unit vectors of the slots after a step.

    For one step length the core computes it; for several, the reference does so at once, with the same bits.
    """
    one_state("P", method)
    free = system.without_inputs()
    if method.is_exact:
        return exact.transition(free, dt)
    if dt.ndim == 0:
        return linear.transition(engine.Plan(free, method, free.batch, float(dt)))
    members = np.broadcast_shapes(dt.shape, free.batch)
    if method.is_implicit:  # the tape of its step serves all steps at once; its reference derives rates number by number
        return traced.stepped(free, method, *unit(free, members), dt)
    return rows(free, *_step(free, method, dt, (sum(size(free)), *members), *unit(free, members)))


def response(system: System, method: Method, dt: Array, members: Shape) -> Array:
    """Q of a linear system, of shape (n, inputs, *members): the state after a step from rest, with an input held at 1."""
    n = sum(size(system))
    if method.is_exact:
        held = aligned(exact.response(system, dt), 2, members)
        return np.array(np.broadcast_to(held, (*held.shape[:2], *members)))
    q = np.zeros((n, len(system.input_names), *members))
    for j, name in enumerate(system.input_names):
        constant = system.with_pulse(name, np.ones(1), 1.0)
        if dt.ndim == 0:
            one = linear.one_step(engine.Plan(constant, method, constant.batch, float(dt)))
            q[:, j] = one.reshape(n, *(1,) * (len(members) - one.ndim + 1), *one.shape[1:])
        elif method.is_implicit:
            v, y = (np.zeros((*shape, *members)) for shape in (system.v_shape, system.y_shape))
            q[:, j] = traced.stepped(constant, method, v, y, dt)
        else:
            v, y = (np.zeros((*shape, 1, *members)) for shape in (system.v_shape, system.y_shape))
            q[:, j] = rows(system, *_step(constant, method, dt, (1, *members), v, y))[:, 0]
    return q


def jacobian(system: System, method: Method, dt: Array, t: float, v: Array, y: Array) -> Array:
    """P of any system at the state (v, y) and time t: the exact derivative of the reference step with respect to the slots.

    It is computed by the complex step where the system's reference accepts complex numbers and the method needs no derivatives,
    else from the tape of the step. A projection of the system onto its energy is part of the step.
    """
    one_state("P", method)
    members = together(system, dt, v, y)
    slot = _started(system, method, dt, members, t, v, y) if method.carry else v
    if method.has_derivatives or not system.complex_step:
        return traced.matrix(system, "step", method, members, slot, y, t, dt)[0]
    s: Any = _scaled(system, dt, (1, *members))
    h: Any = float(dt) if dt.ndim == 0 else dt
    project: Callable[[Any, Any], Blocks] = getattr(s, "project", lambda v, y: (v, y))
    return _derivative(system, members, slot, y, lambda v, y: project(*method.steps.step(s, t, h, v, y)))


def rates(system: System, t: float = 0.0, v: Array | None = None, y: Array | None = None) -> Array:
    """The matrix of the rates: A of a linear system, else the derivative of the rates at a state."""

    def both(v: Array, y: Array) -> Blocks:
        s = _scaled(system, np.asarray(1.0), (1, *members))
        return s.dv(t, v, y), s.dy(t, v, y)

    if v is None or y is None:
        system = system.without_inputs()
        members = system.batch
        return rows(system, *both(*unit(system, members)))
    members = together(system, np.asarray(1.0), v, y)
    if not system.complex_step:
        return traced.matrix(system, "rates", None, members, v, y, t)[0]
    return _derivative(system, members, v, y, both)


def finish(
    system: System, method: Method, dt: Array, members: Shape, t: float = 0.0, v: Array | None = None, y: Array | None = None
) -> Array:
    """The linear map from slots to states: the identity for a method that carries v, else the derivative of its ``finish``.

    For a nonlinear system it is taken at the state (v, y) and time t.
    """
    n = sum(size(system))
    if not method.carry:
        return np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(members)), (n, n, *members))
    if v is None or y is None:
        free = system.without_inputs()
        slot, y = unit(free, members)
        return rows(free, method.steps.finish(_scaled(free, dt, (n, *members)), 0, 0.0, slot, y), y)
    slot = _started(system, method, dt, members, t, v, y)
    if not system.complex_step:
        return traced.matrix(system, "finish", method, members, slot, y, t, dt)[0]
    s = _scaled(system, dt, (1, *members))
    return _derivative(system, members, slot, y, lambda slot, y: (method.steps.finish(s, 0, t, slot, y), y))


def _started(system: System, method: Method, dt: Array, members: Shape, t: float, v: Array, y: Array) -> Array:
    """The slot that a method carries in place of v, where each member may have its own step."""
    v, y = checks.spread(v, system.v_shape, members), checks.spread(y, system.y_shape, members)
    return method.steps.start(_scaled(system, dt, members), 0, t, v, y)


def unit(system: System, members: Shape) -> tuple[Array, Array]:
    """Both blocks of every unit vector, one vector for each number, along the axis after the blocks'."""
    n_v, n_y = size(system)
    n = n_v + n_y
    one = np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(members)), (n, n, *members))
    return one[:n_v].reshape(*system.v_shape, n, *members), one[n_v:].reshape(*system.y_shape, n, *members)


def rows(system: System, v: Array, y: Array) -> Array:
    """Both blocks as rows of a matrix whose columns are the axis after the blocks'."""
    n_v, n_y = size(system)
    rest = v.shape[len(system.v_shape) :] if n_v else y.shape[len(system.y_shape) :]
    return np.concatenate([np.broadcast_to(v, (*system.v_shape, *rest)).reshape(n_v, *rest), y.reshape(n_y, *rest)])


def _scaled(system: System, dt: Array, batch: Shape) -> Any:
    return system.scaled(float(dt) if dt.ndim == 0 else dt, batch)  # type: ignore[arg-type]


def _step(system: System, method: Method, dt: Array, batch: Shape, v: Array, y: Array) -> Blocks:
    """A step of a linear system with h = 0 in its times, so that inputs keep their values."""
    with np.errstate(all="ignore"):
        return method.steps.step(_scaled(system, dt, batch), 0.0, 0.0, v, y)


def together(system: System, dt: Array, v: Array, y: Array) -> Shape:
    """The shape to which steps, parameters and states broadcast."""
    batches = {"v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    return checks.batch_shape({"dt": dt.shape, "system": system.batch} | batches)


def _derivative(system: System, members: Shape, v: Array, y: Array, f: Callable[[Any, Any], Blocks]) -> Array:
    """The derivative of a function of both blocks with respect to each number of a state, by the complex step.

    Directions lie along the axis after the blocks'. They are taken in chunks, so that the memory suffices and Ctrl-C is noticed.
    """
    n = sum(size(system))

    def seeded(block: Array, shape: Shape, direction: Array) -> Any:
        own = block.shape[len(shape) :]
        aligned = block.reshape(*shape, 1, *(1,) * (len(members) - len(own)), *own)
        return np.broadcast_to(aligned, direction.shape) + 1j * COMPLEX_STEP * direction

    unit_v, unit_y = unit(system, members)
    derivative = np.empty((n, n, *members))
    at_once = max(1, linear.NUMBERS_AT_ONCE // max(1, n * prod(members)))
    for k in range(0, n, at_once):
        some = slice(k, k + at_once)
        along_v, along_y = (
            each[(slice(None),) * len(shape) + (some,)] for each, shape in ((unit_v, system.v_shape), (unit_y, system.y_shape))
        )
        with np.errstate(all="ignore"):
            values = rows(system, *f(seeded(v, system.v_shape, along_v), seeded(y, system.y_shape, along_y)))
            for row, of_row in zip(derivative, values, strict=True):  # the memory of all rows at once may take a second to get
                row[some] = of_row.imag / COMPLEX_STEP
    return derivative
