"""The matrices of the exact step of a linear system, as those of the transition-matrix form."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.inputs import Input, Sinusoid
from ...model.parameters import aligned
from ...model.systems import Sampled, System
from ...model.systems.linear import of_rates
from ...reference import exact
from .plan import Plan


def nodes_of(plan: Plan) -> tuple[float, ...]:
    """The times within a step, as shares of it, at which inputs are evaluated: both ends where one runs on straight lines."""
    if not plan.method.is_exact:
        return plan.method.nodes
    return (0.0, 1.0) if any(map(_is_line, plan.system.given_inputs().values())) else (0.0,)


def inputs_of(plan: Plan) -> list[Input]:
    """The inputs that the columns of Q belong to: beside a sinusoid of the exact method stands its cosine."""
    inputs = plan.system.given_inputs().values()
    if not plan.method.is_exact:
        return list(inputs)
    return [part for each in inputs for part in (_with_cosine(each) if isinstance(each, Sinusoid) else [each])]


def _with_cosine(each: Sinusoid) -> list[Input]:
    return [each, Sinusoid(each.amplitude, each.omega, each.phase + 0.5 * pi)]


def _is_line(each: Any) -> bool:
    return isinstance(each, Sampled) and each.interpolation == "linear" and not each.constant


def transition(system: System, dt: Any) -> Array:
    """P of shape (n, n, *members), in the order of the slots; ``dt`` may be an array."""
    A, _ = _matrices(system.without_inputs())
    return exact.held(A, np.zeros((len(A), 0)), dt)[0]


def response(system: System, dt: Any) -> Array:
    """Q of shape (n, inputs, *members) for inputs that are held."""
    return exact.held(*_matrices(system.without_inputs()), dt)[1]


def pulses(plan: Plan) -> Array:
    """Q of shape (nodes, inputs, n, *batch), with the inputs of ``inputs_of`` at the nodes of ``nodes_of``."""
    system, nodes = plan.system, nodes_of(plan)
    A, B = _matrices(system)
    names, n = list(system.input_names), len(A)
    columns: list[list[Array | None]] = []
    for name, each in system.given_inputs().items():
        j = names.index(name)
        own = B[:, [j]]
        if isinstance(each, Sinusoid):
            _, of_sine, of_cosine = exact.sinusoidal(A, own, plan.dt, each.omega[np.newaxis])
            columns += [[of_sine, None], [of_cosine, None]]
        elif _is_line(each):
            _, before, after = exact.linear(A, own, plan.dt)
            columns.append([before, after])
        else:
            columns.append([exact.held(A, own, plan.dt)[1], None])
    q = np.zeros((len(nodes), len(columns), n, *plan.batch))
    for j, column in enumerate(columns):
        for i in range(len(nodes)):
            if (part := column[i]) is not None:
                q[i, j] = np.broadcast_to(aligned(part[:, 0], 1, plan.batch), (n, *plan.batch))
    return q


def _matrices(system: System) -> tuple[Array, Array]:
    """A and B in the order of the slots."""
    part = of_rates("system", system)
    return part.A, part.B
