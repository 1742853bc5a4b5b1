"""The true motion of a scene as trials ask for it: quickly, at whole frames, and only as far as it is known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .._checks import Array
from ..charts.measure import ASKED
from ..errors import ArgumentError
from ..scenes import Scene
from ..scenes.table import Exact, tabled
from ..scenes.truth import AGREES, with_truth

#: Without a frame a run has at least so many steps.
FEWEST = 4

#: A true motion without a formula is known this many times better than the tolerance, and a table of it that many times.
BETTER, FINER = 10.0, 1000.0

#: A table of it is as close to it as this at least, in the blocks' largest lengths.
CLOSE = 1e-9

#: A trial compares so many states at even times with the true ones, and as many at even lengths of the true motion's path, so
#: that a short encounter is not passed over.
EVEN = 1000

#: The path's length is found by putting times where it is long, so often.
ROUNDS = 4

#: How many answers of ``exact`` are kept: all methods are tried with the same numbers of steps, hence at the same times.
REMEMBERED = 96


class Grid(NamedTuple):
    """The steps that can be chosen: k = 1, 2, … of them in a span of time, of which the horizon has so many.

    Attributes:
        span: the frame, or the whole horizon if any step will do; in units of time.
        spans: how many spans reach the horizon.
        framed: whether the spans are frames.
    """

    span: float
    spans: int
    framed: bool

    @property
    def first(self) -> int:
        """The least k."""
        return 1 if self.framed else FEWEST

    @property
    def end(self) -> float:
        """The time at which runs end: the horizon, or the end of the frame in which it is."""
        return self.span * self.spans

    def dt(self, k: int) -> float:
        """The step."""
        return self.span / k

    def steps(self, k: int) -> int:
        """The steps that reach the horizon."""
        return self.spans * k

    @property
    def asked(self) -> Array:
        """Times at which a run with a tolerance is asked for its state: the frames, or a few even ones."""
        if self.framed:
            return self.span * np.arange(1.0, self.spans + 1)
        return np.linspace(0.0, self.span, ASKED + 1)[1:]


def grid_of(horizon: float, frame: float | None) -> Grid:
    """The steps that can be chosen to reach a horizon."""
    if frame is None:
        return Grid(horizon, 1, False)
    return Grid(frame, max(1, math.ceil(horizon / frame - 1e-9)), True)


class Motion(NamedTuple):
    """What runs are compared with.

    Attributes:
        scene: with an ``exact`` that is quick, known over the horizon and to the end of the last span.
        grid: the steps that can be chosen.
        marks: times within the horizon at which errors are looked for, ascending from 0.
        cut: whether the scene's horizon is longer, and its true motion not known so far.
    """

    scene: Scene
    grid: Grid
    marks: Array
    cut: bool


def motion_of(scene: Scene, frame: float | None, tolerance: float) -> Motion:
    """The true motion of a scene, over whole frames.

    Raises:
        ArgumentError: if it is not known to the end of the first frame.
    """
    horizon = scene.horizon
    grid = grid_of(horizon, frame)
    last = max(horizon, grid.end)
    until = min(scene.until, last)
    exact = scene.exact
    if exact is None:
        known = with_truth(replace(scene, horizon=last), min(AGREES, tolerance / BETTER))
        exact, until = known.exact, min(known.until, last)
        assert exact is not None
    cut = until < horizon
    if frame is not None and until < last:
        grid = grid._replace(spans=math.floor(until / frame + 1e-9))
        horizon = min(horizon, grid.spans * frame)
    elif frame is None and cut:
        grid, horizon = grid_of(until, None), until
    if not until > 0.0 or not grid.spans:
        far = "for any time" if not until > 0.0 else f"beyond t = {until:.3g}, within the first frame"
        raise ArgumentError(f"scene: the true motion of {scene.name} is not known {far}, so there is no error to judge by")
    judged = replace(scene, exact=exact, until=math.inf, horizon=horizon)
    if scene.exact is None:
        exact = tabled(exact, until, judged.scales, min(CLOSE, tolerance / FINER))

    def within(t: Array) -> tuple[Array, Array]:
        return exact(np.minimum(t, until))  # a last time past that by rounding is taken for it

    judged = replace(judged, exact=remembered(within))
    return Motion(judged, grid, _marks(judged), cut)


def _marks(scene: Scene) -> Array:
    """Times over the horizon at which errors are looked for: even ones, and ones that are evenly far apart on the path."""
    assert scene.exact is not None
    t = even = np.linspace(0.0, scene.horizon, EVEN + 1)
    path = np.linspace(0.0, 1.0, EVEN + 1)
    for _ in range(ROUNDS):
        length = np.zeros(len(t) - 1)
        for block, scale in zip(scene.exact(t), scene.scales, strict=True):
            change = np.diff(block.reshape(len(t), -1), axis=0)
            length += np.sqrt((change * change).sum(axis=1)) / (scale or 1.0)
        reached = np.concatenate([[0.0], np.cumsum(length)])
        by_path = np.interp(path * reached[-1], reached, t)
        t = np.unique(np.concatenate([t, by_path]))
    return np.unique(np.concatenate([even, by_path]))


def remembered(exact: Exact) -> Exact:
    """The same function, which does not compute twice what it was asked for lately."""
    kept: dict[bytes, tuple[Array, Array]] = {}

    def answer(t: Array) -> tuple[Array, Array]:
        key = np.asarray(t).tobytes()
        if key not in kept:
            if len(kept) >= REMEMBERED:
                del kept[next(iter(kept))]
            kept[key] = exact(t)
        return kept[key]

    return answer


def looked_up(exact: Exact, times: Array) -> Exact:
    """The same function, which has its answers for these times, ascending, and any of them, at hand."""
    blocks = exact(times)

    def answer(t: Array) -> tuple[Array, Array]:
        place = np.minimum(np.searchsorted(times, t), len(times) - 1)
        if (times[place] != t).any():
            return exact(t)
        return blocks[0][place], blocks[1][place]

    return answer
