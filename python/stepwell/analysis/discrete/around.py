"""A system in the loop of its own sampled controller, linearised over a period: whether the loop decays or grows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from ..._core import Tape
from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...errors import ArgumentError
from ...model.compatibility import one_state
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import System
from ...model.systems.base import a_system
from ...reference.marks import Marks, recording
from ...reference.tape.evaluate import Evaluation
from ...reference.tape.modes import jacobian
from ...reference.traced import Tracer
from ...runs.options import Options
from ...runs.request import Request
from ..stability import eigen
from .response import Complex

#: The most steps of a period.
MOST_STEPS = 100_000


@dataclass(frozen=True, eq=False)
class LinearisedLoop(ValueEquality):
    """The linearisation of a system with its controller over a period; ``linearised_loop`` returns it.

    Attributes:
        method: the name of the method.
        dt: its step.
        period: the time from one sample to the next; of several controllers that after which all of them sample together again.
        P: the derivative of the state after a period by that before, shape (n, n, *batch): v, y, the controller's own state, its
            results that wait, and what it holds.
    """

    method: str
    dt: float
    period: float
    P: Array

    @cached_property
    def eigenvalues(self) -> Complex:
        """The eigenvalues of P, shape (n, *batch), largest first: the loop decays if all are within the unit circle."""
        z = eigen.eigenvalues(self.P)
        return np.take_along_axis(z, np.argsort(-np.abs(z), axis=0, kind="stable"), axis=0)

    @property
    def radius(self) -> Any:
        """r₁, the largest magnitude of an eigenvalue: a number, or an array over the batch."""
        return np.abs(self.eigenvalues[0])[()]

    def __repr__(self) -> str:
        worst = f"{np.max(self.radius):.6g}"
        return f"<loop over a period of {self.period:g} by {self.method} with dt = {self.dt:g}, largest radius {worst}>"


def linearised_loop(system: System, method: str | Method, *, dt: float, y: Any, v: Any = None, t0: float = 0.0) -> LinearisedLoop:
    """A system and its sampled controller near a state, over a period: the steps of the method, after a sample.

    The derivatives are exact, along the steps that the loop makes from this state. The controller begins with its state at the
    start, so take the state and that so that the loop rests; where it saturates, its output does not change with what it sees.
    The result says what the simulation does: with short steps that is the loop itself, and with longer ones the method.

    Args:
        system: a system with a controller around it: ``system.surrounded(controller)``.
        method: its name, or what ``stepwell.method`` returns.
        dt: the step, a whole part of the period.
        y: the coordinates, shape (*block, *batch).
        v: the velocities, likewise; None for a system without velocities.
        t0: the time of the sample.

    Returns:
        A ``LinearisedLoop``: ``P`` over a period, ``eigenvalues``, and ``radius``, which is below 1 if the loop decays.

    Raises:
        ArgumentError: if there is no controller, or an argument is wrong.
        UnsupportedError: if the method keeps more than the state, or an operation has no derivative.

    Example:
        >>> @sw.system
        ... def mass(t, v, y, *, u=0.0):
        ...     return 4.0 * u - 0.4 * v
        >>> @sw.controller
        ... def held(t, v, y, *, gain=0.8):
        ...     return gain * (1.0 - y)
        >>> for period in (0.1, 0.2, 0.3):
        ...     loop = mass().surrounded(held(period=period))
        ...     print(round(float(sw.linearised_loop(loop, "rk4", dt=period / 10, v=0.0, y=1.0).radius), 4))
        0.9881
        0.9919
        1.0099
    """
    method, system = find_method(method), a_system(system)
    one_state("linearised_loop", method)
    if system.controller is None:
        raise ArgumentError(
            f"system: expected one with a sampled controller around it, system.surrounded(…), got {system!r}; its steps alone "
            f"are analysed by stepwell.analyse"
        )
    request = Request.of(system, method, Options(v=v, y=y, dt=dt, t0=t0, steps=1))
    plan, memory = request.plan, request.plan.memory
    assert memory is not None
    steps = plan.system.controller.cycle
    if steps > MOST_STEPS:
        raise ArgumentError(f"dt: expected at most {MOST_STEPS} steps in a period, got {steps}")
    tape, marks = Tape(), Marks()
    tracer = Tracer(plan.system, tape)
    with recording(marks):
        roots = tracer.step(method, plan.choice)
    n, batch = len(roots), plan.batch
    checks.fits("system: the matrices of a step", 4.0 * n * n, batch, "take a smaller system")
    rows = jacobian(tape, roots, [tape.state(i) for i in range(n)], marks)
    evaluation = Evaluation(tape, [each for row in rows for each in row] + roots, dict(enumerate(tracer.numbers)), tracer.tables)
    blocks = ((request.v, plan.system.v_shape), (request.y, plan.system.y_shape))
    z: list[Any] = [row for block, shape in blocks for row in np.reshape(block, (prod(shape), *batch))]
    z += list(memory)
    whole = np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(batch)), (n, n, *batch))
    with np.errstate(all="ignore"):
        for k in range(steps):
            made = evaluation(z, plan.t0 + k * plan.dt, plan.dt)
            matrix = np.stack([np.broadcast_to(each, batch) for each in made[: n * n]]).reshape(n, n, *batch)
            whole = np.einsum("ij...,jk...->ik...", matrix, whole)
            z = list(made[n * n :])
    counts = [n - len(memory) + i for i in plan.system.controller.counters(plan.system)]  # of steps: they depend on nothing else
    P = np.delete(np.delete(whole, counts, axis=0), counts, axis=1)
    return LinearisedLoop(method.name, plan.dt, steps * abs(plan.dt), P)
