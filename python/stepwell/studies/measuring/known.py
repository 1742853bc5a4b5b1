"""The exact solution of a scene for charts, which evaluate it thousands of times, as far as it is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...errors import ArgumentError
from ...scenes import Scene
from ...scenes.table import tabled
from ...scenes.truth import MAX_DIFFERENCE, METHOD_IF_STIFF, Tight, with_truth

#: Nodes of the polynomial that interpolates the state.
INTERPOLATION_POINTS = 10

#: Nodes of the whole motion at first and at most, and the largest error of the interpolation, relative to the blocks' largest
#: lengths.
FIRST_NODES, MAX_NODES, MAX_INTERPOLATION_ERROR = 500, 64_000, 0.1 * MAX_DIFFERENCE

Exact = Callable[[Array], tuple[Array, Array]]


def chartable(scene: Scene) -> tuple[Scene, float]:
    """The scene without a control, with a motion that is known over its whole horizon, and the least meaningful error.

    A scene without an exact solution gets one by ``with_truth``, and ends where that does.
    """
    if scene.exact is not None and scene.until >= scene.horizon:
        return scene, 0.0
    floor = 0.0 if scene.exact is not None else 10.0 * MAX_DIFFERENCE
    known = with_truth(scene)
    if not known.until > 0.0 or known.exact is None:
        raise ArgumentError(f"scene: the true motion of {scene.name} is not known for any time, so there is no error to chart")
    until = min(known.horizon, known.until)
    if scene.exact is None:
        error = "as far from the true places or velocities as the largest true ones"
        if isinstance(known.exact, Tight) and known.exact.method == METHOD_IF_STIFF:  # what dies out is too short for even nodes
            table = tabled(known.exact, until, replace(known, horizon=until).scales_of_numbers, MAX_INTERPOLATION_ERROR)
        else:
            table = dense(known.exact, until)
        known = replace(known, exact=table, control=None, error=scene.error if scene.system.groups else error)
    return replace(known, horizon=until), floor


def dense(exact: Exact, until: float) -> Exact:
    """The motion from 0 to ``until``, by polynomials through states that are computed once."""
    between = np.linspace(0.0, until, 97)[1:-1] + until / 2e4
    wanted = exact(between)
    nodes = FIRST_NODES
    while True:
        interpolant = Interpolant(*exact(np.linspace(0.0, until, nodes + 1)), until / nodes)
        pairs = zip(interpolant(between), wanted, strict=True)
        apart = max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs if b.size)
        if apart <= MAX_INTERPOLATION_ERROR or nodes >= MAX_NODES:
            return interpolant
        nodes *= 2


@dataclass(frozen=True, eq=False)
class Interpolant(ValueEquality):
    """Polynomials through equidistant states; a class, since a local function cannot be pickled with its chart.

    Attributes:
        v: velocities at the nodes, shape (nodes, *block).
        y: coordinates there, likewise.
        spacing: the time from one node to the next; the first is at 0.
    """

    v: Array
    y: Array
    spacing: float

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at times of shape (n,), of shape (n, *block)."""
        last = len(self.v) - 1
        place = np.asarray(t, dtype=np.float64) / self.spacing
        first = np.clip(np.floor(place).astype(np.int64) - (INTERPOLATION_POINTS // 2 - 1), 0, last + 1 - INTERPOLATION_POINTS)
        u = place - first
        blocks = []
        for block in (self.v, self.y):
            value = np.zeros((len(u), *block.shape[1:]))
            for j in range(INTERPOLATION_POINTS):
                others = [k for k in range(INTERPOLATION_POINTS) if k != j]
                share = np.prod([(u - k) / (j - k) for k in others], axis=0)
                value += share.reshape(-1, *(1,) * (block.ndim - 1)) * block[first + j]
            blocks.append(value)
        return blocks[0], blocks[1]
