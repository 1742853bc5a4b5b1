"""The loop around a step, and the transition-matrix form (Appendix B): the specification of the core's driver."""

from collections.abc import Callable, Sequence

import numpy as np

from ..base.arrays import Array, Blocks, Signal, Whole
from .product import times
from .signal import of_step, over

Step = Callable[[float, Array, Array], Blocks]
Velocity = Callable[[float, Array, Array], Array]


def run(
    step: Step,
    v: Array,
    y: Array,
    first_bad: Whole,
    block_axes: tuple[int, int],
    *,
    h: float,
    t0: float,
    first: int,
    steps: int,
    saves: Whole,
    velocity: Velocity | None = None,
) -> tuple[Array, Array, Blocks, Whole]:
    """Make ``steps`` steps from number ``first``.

    ``step(t, v, y)`` makes one step; the first axes of ``v`` and ``y``, ``block_axes`` many each, are those of a block. Time is
    t0 + k·h, never accumulated. A member has diverged at the first step after which a number of its v or y is not finite; for a
    method with a carry, ``velocity(t, v, y)`` computes v from it. ``first_bad`` has the steps at which members diverged in
    earlier runs, −1 for none.

    Returns:
        The slots at the end; both slots at ``saves``, step counts in ascending order; ``first_bad`` of this and earlier runs.
    """
    saved = np.empty((len(saves), *v.shape), v.dtype), np.empty((len(saves), *y.shape), y.dtype)
    done = 0
    if saves[0] == 0:
        saved[0][0], saved[1][0], done = v, y, 1
    blocks = tuple(tuple(range(n)) for n in block_axes)
    with np.errstate(all="ignore"):
        for i in range(steps):
            k = first + i
            v, y = step(t0 + k * h, v, y)
            finite = np.isfinite(v).all(axis=blocks[0]) & np.isfinite(y).all(axis=blocks[1])
            if velocity is not None:
                finite &= np.isfinite(velocity(t0 + (k + 1) * h, v, y)).all(axis=blocks[0])
            first_bad = np.where((first_bad < 0) & ~finite, k + 1, first_bad)
            if done < len(saves) and saves[done] == i + 1:
                saved[0][done], saved[1][done], done = v, y, done + 1
    return v, y, saved, first_bad


def linear_step(
    p: Array, q: Array, inputs: Sequence[Signal], nodes: Sequence[float], h: float, carries: bool = False, *, fused: bool = False
) -> Callable[[float, Array], Array]:
    """One step of s ← P·s + Σ Q·u, with s the rows of v and y; the sums run over s, then over the nodes and their inputs."""
    columns = [(node * h, signal) for node in nodes for signal in inputs]
    pq = np.concatenate([p, np.moveaxis(q, 0, 1)], axis=1)

    def step(t: float, s: Array) -> Array:
        seen = over(of_step(t, h, carries), lambda: [signal.at(t + later) for later, signal in columns])
        return times(pq, [*s, *seen], fused=fused)

    return step
