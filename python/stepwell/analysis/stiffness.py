"""Whether stability, and not accuracy, limits the adaptive steps of a run (stiffness)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..runs.result import Run
from ..runs.stops import rates_of, start_of

#: Stiffness is tested after at least this many attempts, for at most this many numbers of a state, and of its matrices in all:
#: that is little work beside the run.
ATTEMPTS, MOST_RATES, MOST_NUMBERS = 1000, 32, 100_000
#: A mode is stiff if it decays rather than oscillates, the run has lasted this many of its time constants, and the step is at
#: least this fraction of the largest at which the method is stable for it.
DECAYED, SHARE_OF_LIMIT = 100.0, 0.2
#: The fraction of a number by which it is changed to approximate a derivative: half of its digits.
PART = 2.0**-26


def held_by_stability(run: Run, index: Shape, attempts: int) -> str:
    """The end of the message for a member that stopped where stability limited its steps; empty if it did not."""
    assert run.paces is not None
    assert run.controller_state is not None
    numbers = run.controller_state.v.size + run.controller_state.y.size
    n = numbers // run.status.size
    if attempts < ATTEMPTS or n > MOST_RATES or n * numbers > MOST_NUMBERS:
        return ""
    matrix = _derivative(run, index, n)
    if not np.isfinite(matrix).all():
        return ""
    values = np.linalg.eigvals(matrix)
    fastest: Any = values[np.abs(values).argmax()]
    rate, elapsed = abs(fastest), abs(float(run.paces.t[index]) - start_of(run, index))
    if not (-fastest.real >= 0.5 * rate and rate * elapsed > DECAYED):
        return ""
    from ..analysis.stability import stability_limit  # needed for stiff equations only
    from ..model.systems import LinearSystem

    mode = [[fastest.real, -fastest.imag], [fastest.imag, fastest.real]] if fastest.imag else [[fastest.real]]
    limit = float(stability_limit(LinearSystem(mode), run.method))
    if not float(run.paces.h[index]) >= SHARE_OF_LIMIT * limit:
        return ""
    return (
        f", held down by stability and not by accuracy: the fastest rate there, 1/{1.0 / rate:.2g}, lets no steps beyond "
        f"{limit:.2g} be stable (stiff equations; SciPy's Radau and LSODA are for them)"
    )


def _derivative(run: Run, index: Shape, n: int) -> Array:
    """The Jacobian of the rates of a member at its state, by differences."""
    assert run.controller_state is not None
    assert run.paces is not None
    paces, blocks = run.paces, (run.controller_state.v, run.controller_state.y)
    flat = [block.reshape(-1, *run.status.shape) for block in blocks]

    def at(state: Array) -> Array:
        parts = state[: len(flat[0])].reshape(blocks[0].shape), state[len(flat[0]) :].reshape(blocks[1].shape)
        rates = rates_of(run.system, run.status.shape, paces.t, parts)
        return np.concatenate([checks.member(rate, index).reshape(-1) for rate in rates])

    state = np.concatenate(flat)
    lengths = np.concatenate([np.full(block.shape, np.sqrt((block * block).sum(axis=0))) for block in flat])
    least = np.finfo(np.float64).tiny / PART  # below it, that fraction of the number would underflow
    scale = np.where(np.abs(state) >= least, np.abs(state), np.where(lengths >= least, lengths, 1.0))
    matrix, here = np.empty((n, n)), at(state)
    for i in range(n):
        moved = state.copy()
        moved[i] += PART * scale[i]
        matrix[:, i] = (at(moved) - here) / float(checks.member(moved - state, index)[i])
    return matrix
