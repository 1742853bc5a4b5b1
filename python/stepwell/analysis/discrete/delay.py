"""Dead time of the inputs of a sampled system: whole samples are shifted, and what is left over divides a step in two."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import TooLargeError, UnsupportedError
from ...model.inputs import Sampled
from ...model.methods import Method
from ...model.parameters import aligned
from ...model.systems import LinearSystem
from ...reference import exact
from ...reference.product import product
from ...runs.execution import quietly

#: A dead time that is nearer to whole samples than this share of one is that of whole samples.
WHOLE = 1e-9


#: The most samples of dead time.
MOST_SAMPLES = 10_000


class Parts(NamedTuple):
    """The matrices of a step by the sample that they belong to: 0 for x of this sample, −1 of the next, 1, 2, … of those before.

    Attributes:
        P: the transition matrix.
        of_state: what a sample adds to the next state.
        of_output: what it adds to the output.
    """

    P: Array
    of_state: dict[int, Array]
    of_output: dict[int, Array]


def samples_of(delay: float, dt: float) -> tuple[int, float]:
    """Dead time as whole samples and the rest of it, below dt."""
    share = delay / dt
    if not share <= MOST_SAMPLES:
        raise TooLargeError(
            f"delay, dt: expected a dead time of at most {MOST_SAMPLES} samples, each of them a state, got {share:g}"
        )
    whole = round(share)
    if abs(share - whole) > WHOLE:
        whole = int(share)
        return whole, delay - whole * dt
    return whole, 0.0


def shifted(P: Array, Q: Array, after: Array, D: Array, whole: int) -> Parts:
    """The parts of a step whose inputs are so many samples late."""
    return Parts(P, {whole: Q, whole - 1: after}, {whole: D})


def divided(system: LinearSystem, P: Array, D: Array, way: str, between: str | None, dt: float, late: tuple[int, Any]) -> Parts:
    """The parts of an exact step in which the sample changes at this time after its begin."""
    whole, rest = late
    A, B = system.A, system.B
    assert B is not None
    ahead, second = exact.held(A, B, dt - rest)
    if way == "impulse":
        return Parts(P, {whole: _times(ahead, B * dt)}, {whole: D})
    if between == "hold":
        first = _times(ahead, exact.held(A, B, rest)[1])
        return Parts(P, {whole + 1: first, whole: second}, {whole + 1: D})
    share = 1.0 - rest / dt  # of the way from one sample to the next that the input has gone where a step begins
    _, begin, end = exact.linear(A, B, rest)
    _, late_begin, late_end = exact.linear(A, B, dt - rest)
    middle = _times(ahead, share * begin + end) + late_begin + (1.0 - share) * late_end
    state = {whole + 1: _times(ahead, (1.0 - share) * begin), whole: middle, whole - 1: share * late_end}
    return Parts(P, state, {whole + 1: (1.0 - share) * D, whole: share * D})


def divided_by(
    system: LinearSystem, method: Method, P: Array, D: Array, between: Any, dt: float, late: tuple[int, float]
) -> Parts:
    """The parts of a method's step, from runs of one step with a pulse of one sample.

    Of held samples a step sees the mean over it, as in a run.
    """
    whole, rest = late
    share = 1.0 - rest / dt
    weights = {}
    for ahead in (1, 0, -1):
        q = np.zeros((len(system.A), len(system.input_names), *system.batch))
        for j in range(q.shape[1]):
            pulse = Sampled([0.0] * (2 - ahead) + [1.0, 0.0, 0.0], dt, rest - 2.0 * dt, between)
            x = [pulse if i == j else None for i in range(q.shape[1])]
            run = quietly(system.with_inputs(x), method, v=0.0, y=0.0, dt=dt, steps=1)
            q[:, j] = system.state(run.v[-1], run.y[-1])
        weights[whole + ahead] = q
    output = {whole + 1: D} if between == "hold" else {whole + 1: (1.0 - share) * D, whole: share * D}
    return Parts(P, weights, output)


def joined(parts: Parts, C: Array, inputs: int, batch: Shape) -> tuple[Array, Array, Array, Array, Array]:
    """P, Q, Q_next, C and D with the samples that are under way as states behind the others, the newest first."""
    n, m = len(parts.P), inputs
    length = max((i for i, each in {**parts.of_state, **parts.of_output}.items() if i > 0), default=0)
    size, r = n + m * length, len(C)
    checks.fits("delay: the matrices with the samples under way", 3.0 * size * size, batch, "take fewer samples")
    P, Q, after = (np.zeros((size, width, *batch)) for width in (size, m, m))
    whole_c, D = np.zeros((r, size, *batch)), np.zeros((r, m, *batch))
    P[:n, :n], whole_c[:, :n] = aligned(parts.P, 2, batch), aligned(C, 2, batch)
    unit = np.eye(m).reshape(m, m, *(1,) * len(batch))
    for i in range(1, length + 1):
        place = slice(n + m * (i - 1), n + m * i)
        if i == 1:
            Q[place] = unit
        else:
            P[place, n + m * (i - 2) : n + m * (i - 1)] = unit
    for of, state, output in ((parts.of_state, (P, Q, after), None), (parts.of_output, None, (whole_c, D))):
        for i, matrix in of.items():
            wide = aligned(matrix, 2, batch)
            if i > 0:
                target = state[0][:n] if state is not None else whole_c
                target[:, n + m * (i - 1) : n + m * i] += wide
            elif state is not None:
                state[1 if i == 0 else 2][:n] += wide
            elif output is not None and i == 0:
                D += wide
    return P, Q, after, whole_c, D


def not_of_tustin(prewarp: float | None, rest: float) -> None:
    """Raise if a prewarped step should be divided."""
    if prewarp is not None and rest:
        raise UnsupportedError(
            "delay: with prewarp= expected whole samples, since the step of the trapezoidal rule is then not dt and has no parts"
        )


def _times(a: Array, b: Array) -> Array:
    axes = max(a.ndim, b.ndim) - 2
    a, b = (each.reshape(*each.shape[:2], *(1,) * (axes + 2 - each.ndim), *each.shape[2:]) for each in (a, b))
    return product(a, b)
