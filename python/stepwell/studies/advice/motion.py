"""The true motion of a scene for trials: computed quickly, over whole frames, and only as far as it is known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...errors import ArgumentError
from ...scenes import Scene
from ...scenes.table import Exact, tabled
from ...scenes.truth import with_truth
from ..measuring.measure import SAVED_TIMES

#: The least number of steps of a run without a frame.
MIN_STEPS = 4

#: A reference solution without a formula is TRUTH_FACTOR times as accurate as the tolerance, and its table TABLE_FACTOR times.
TRUTH_FACTOR, TABLE_FACTOR = 10.0, 1000.0

#: Runs that are compared with it may have this fraction of the tolerance as error: except for rounding, the error of the tighter
#: of its two runs is a tenth of their difference.
ERROR_SHARE = 0.95

#: The largest error of the table, whatever the tolerance, relative to the blocks' largest lengths.
MAX_TABLE_ERROR = 1e-9

#: A trial is compared with the reference at this many times evenly spaced in time, and at as many evenly spaced in the length of
#: the path, so that a short encounter is not missed.
EVEN_SAMPLES = 1000

#: The latter are more on a long path: SAMPLES_PER_LENGTH for each part as long as the block's largest length, MAX_SAMPLES at
#: most.
SAMPLES_PER_LENGTH, MAX_SAMPLES = 4.0, 20_000

#: The number of refinements of the length of the path, each of which adds times where the path is long.
PATH_ITERATIONS = 4

#: A step that is rounded to float32 is longer by at most this fraction, twice the half of a unit in the last place.
SINGLE_STEP_ROUNDING = 2.0**-23

#: How many results of ``exact`` are cached: all methods are tried with the same numbers of steps, hence at the same times.
CACHED_ANSWERS = 96


class Grid(NamedTuple):
    """The possible steps: k = 1, 2, … in a span, a frame or else the whole horizon; so many spans reach the horizon."""

    span: float
    spans: int
    framed: bool

    @property
    def first(self) -> int:
        """The least k."""
        return 1 if self.framed else MIN_STEPS

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
    def output_times(self) -> Array:
        """Output times of a run with a tolerance: the ends of frames, or a few equidistant times."""
        if self.framed:
            return self.span * np.arange(1.0, self.spans + 1)
        return np.linspace(0.0, self.span, SAVED_TIMES + 1)[1:]


def grid_of(horizon: float, frame: float | None) -> Grid:
    """The grid of possible steps for a horizon."""
    if frame is None:
        return Grid(horizon, 1, False)
    return Grid(frame, max(1, math.ceil(horizon / frame - 1e-9)), True)


class Motion(NamedTuple):
    """The true motion, with which runs are compared.

    Attributes:
        scene: the scene with an ``exact`` that is fast, and known over the horizon and to the end of the last span.
        grid: the possible steps.
        marks: times within the horizon at which errors are measured, ascending from 0.
        cut: whether the scene's horizon is longer than its true motion is known.
        share: the fraction of the allowed error that a run may have, since the motion has an error, too.
        until: the last time for which the motion is known.
    """

    scene: Scene
    grid: Grid
    marks: Array
    cut: bool
    share: float
    until: float


def motion_of(scene: Scene, frame: float | None, tolerance: float, single: bool = False) -> Motion:
    """The true motion of a scene, over whole frames; with ``single`` a little further, where it is known.

    Runs of float32 make steps that are rounded to it, so they end a little later or earlier than others.
    """
    horizon = scene.horizon
    grid = grid_of(horizon, frame)
    last = max(horizon, grid.end)
    reach = last * (1.0 + SINGLE_STEP_ROUNDING) if single else last
    until = min(scene.until, reach)
    exact = scene.exact
    if exact is None:
        known = with_truth(replace(scene, horizon=reach), tolerance / TRUTH_FACTOR)
        exact, until = known.exact, min(known.until, reach)
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
        exact = tabled(exact, until, judged.scales_of_numbers, min(MAX_TABLE_ERROR, tolerance / TABLE_FACTOR))

    judged = replace(judged, exact=Within(exact, until))
    return Motion(judged, grid, _marks(judged), cut, ERROR_SHARE if scene.exact is None else 1.0, until)


def _marks(scene: Scene) -> Array:
    """Times over the horizon at which errors are measured: evenly spaced in time, and evenly spaced on the path."""
    assert scene.exact is not None
    t = even = np.linspace(0.0, scene.horizon, EVEN_SAMPLES + 1)
    path = np.linspace(0.0, 1.0, EVEN_SAMPLES + 1)
    _ = scene.scales  # which checks what a function of the user returns
    blocks = scene.exact(t)
    for i in range(PATH_ITERATIONS):
        changes = scene.relative_lengths(*(np.diff(block, axis=0) for block in blocks))
        length = np.where(np.isfinite(changes), changes, 0.0).sum(axis=0)
        reached = np.concatenate([[0.0], np.cumsum(length)])
        if len(path) == len(even) and reached[-1] * SAMPLES_PER_LENGTH > EVEN_SAMPLES:
            path = np.linspace(0.0, 1.0, min(MAX_SAMPLES, math.ceil(reached[-1] * SAMPLES_PER_LENGTH)) + 1)
        by_path = np.interp(path * reached[-1], reached, t)
        if i < PATH_ITERATIONS - 1:
            t, blocks = _with_more(scene.exact, t, blocks, np.setdiff1d(by_path, t))
    return np.unique(np.concatenate([even, by_path]))


def _with_more(exact: Exact, t: Array, blocks: tuple[Array, Array], more: Array) -> tuple[Array, tuple[Array, Array]]:
    """All times in order and the blocks there; only those at the additional times are computed."""
    times = np.concatenate([t, more])
    order = np.argsort(times)
    v, y = (np.concatenate(both)[order] for both in zip(blocks, exact(more), strict=True))
    return times[order], (v, y)


class Within:
    """A solution up to a time; a time beyond it by rounding counts as this time.

    The last results are cached.
    """

    def __init__(self, solution: Exact, until: float) -> None:
        self.solution, self.until = solution, until
        self._kept: dict[bytes, tuple[Array, Array]] = {}

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        key = np.asarray(t).tobytes()
        if key not in self._kept:
            if len(self._kept) >= CACHED_ANSWERS:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = self.solution(np.minimum(t, self.until))
        return self._kept[key]

    def __reduce__(self) -> tuple[Any, ...]:
        return Within, (self.solution, self.until)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Within) and self.until == other.until and bool(self.solution == other.solution)

    def __hash__(self) -> int:
        return hash(self.until)


def looked_up(exact: Exact, times: Array) -> Exact:
    """The function with its results for these times, ascending, in a table."""
    blocks = exact(times)

    def answer(t: Array) -> tuple[Array, Array]:
        place = np.minimum(np.searchsorted(times, t), len(times) - 1)
        if (times[place] != t).any():
            return exact(t)
        return blocks[0][place], blocks[1][place]

    return answer
