"""Trial runs of a scene: how wrong a method is with a step, whether it grows, and what a step of it costs."""

from __future__ import annotations

import copy
import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .._checks import Array
from ..charts.measure import GROWTH, TIMED_STEP
from ..errors import ControlWarning, DivergenceWarning
from ..integrate import integrate
from ..methods import Method
from ..result import Run
from ..scenes import Scene
from ..scenes.truth import with_truth

#: A run keeps at most so many numbers, every step's if they are fewer.
KEPT = 2_000_000

#: A trial compares so many states at even times with the true ones, and as many at even lengths of the true motion's path, so
#: that a short encounter is not passed over. A confirming run compares every kept state, up to so many.
EVEN, CONFIRMED = 1000, 50_000

#: The path's length is found by putting times where it is long, so often.
ROUNDS = 4

#: How many answers of ``exact`` are kept: all methods are tried with the same numbers of steps, hence at the same times.
REMEMBERED = 96

#: A true motion that is not a formula is read from a table with so many intervals, by a polynomial through so many of its times,
#: if that is as close as this in the blocks' largest lengths.
TABLES, NODES, CLOSE = (2000, 8000, 32_000), 10, 1e-9

#: The batch that is timed has at most so many members, and at most so many numbers in all, which the cache holds.
MEMBERS, NUMBERS = 4096, 16_384

#: A timed run takes at least this many seconds; of so many the quickest counts, since whatever else the machine does only adds.
TIMED_SECONDS, REPEATS = 0.001, 7


class Grid(NamedTuple):
    """The steps that can be chosen: k = 1, 2, … of them in a span of time, of which the horizon has so many.

    Attributes:
        span: the frame, or the whole horizon if any step will do; in units of time.
        spans: how many spans reach the horizon.
        first: the least k.
    """

    span: float
    spans: int
    first: int

    def dt(self, k: int) -> float:
        """The step."""
        return self.span / k

    def steps(self, k: int) -> int:
        """The steps that reach the horizon."""
        return self.spans * k


class Trial(NamedTuple):
    """A run over the horizon: its step, its largest state error, and whether it is wrong altogether and grew."""

    dt: float
    steps: int
    error: float
    unstable: bool


class Trials:
    """Runs of one scene, each made once."""

    def __init__(self, scene: Scene) -> None:
        known = with_truth(scene)
        exact, until = known.exact, known.until
        assert exact is not None
        if scene.exact is None:
            exact = tabled(exact, min(known.horizon, until), known.scales)
        #: The scene up to where its true motion is known. A last time past that by rounding is taken for it.
        self.scene = replace(
            known, exact=remembered(lambda t: exact(np.minimum(t, until))), until=math.inf, horizon=min(known.horizon, until)
        )
        self.numbers = scene.v.size + scene.y.size
        self.marks = _marks(self.scene)
        self._done: dict[tuple[str, int, float], Trial] = {}
        self._dense: dict[tuple[str, int, float], Trial] = {}
        self.made = 0

    def look(self, method: Method, dt: float, steps: int) -> Trial:
        """The run, of which some two thousand states are compared with the true ones."""
        key = (method.name, steps, dt)
        if key not in self._done:
            part = self._marked(self._run(method, dt, steps))
            error = float(self.scene.state_error(part).max())
            self._done[key] = Trial(dt, steps, error, error > 1.0 and self._grown(part))
        return self._done[key]

    def confirm(self, method: Method, dt: float, steps: int) -> Trial:
        """The same run, of which every state is compared if they are not too many."""
        key = (method.name, steps, dt)
        if key not in self._dense:
            trial, run = self.look(method, dt, steps), self._run(method, dt, steps)
            run = _part(run, np.arange(0, len(run.t), max(1, math.ceil(len(run.t) * max(self.numbers / KEPT, 1.0 / CONFIRMED)))))
            error = float(self.scene.state_error(run).max())
            self._dense[key] = trial._replace(error=max(trial.error, error))
        return self._dense[key]

    def unstable(self, method: Method, dt: float, steps: int) -> bool:
        """Whether the run grew and is wrong altogether. The true motion is asked for only if it grew."""
        key = (method.name, steps, dt)
        if key in self._done:
            return self._done[key].unstable
        part = self._marked(self._run(method, dt, steps))
        return self._grown(part) and float(self.scene.state_error(part).max()) > 1.0

    def _run(self, method: Method, dt: float, steps: int) -> Run:
        self.made += 1
        every = max(1, math.ceil(steps * self.numbers / KEPT))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DivergenceWarning)
            warnings.simplefilter("ignore", ControlWarning)
            return self.scene.run(method, dt, steps=steps, every=every)

    def _marked(self, run: Run) -> Run:
        """The states at the marks; the last is one of them."""
        return _part(run, np.unique(np.searchsorted(run.t, np.minimum(self.marks, run.t[-1]))))

    def _grown(self, run: Run) -> bool:
        """As the charts have it: the amplitude grows in the second half, above the true one."""
        amplitude, half = self.scene.amplitude(run), int(np.searchsorted(run.t, 0.5 * run.t[-1]))
        # NaN is above everything.
        return not amplitude[half:].max() <= GROWTH * max(1.0, float(amplitude[: max(1, half)].max()))


def _part(run: Run, places: np.ndarray[Any, np.dtype[np.int64]]) -> Run:
    """The run with these of its kept states."""
    part = copy.copy(run)
    part.t, part.v, part.y = run.t[places], run.v[places], run.y[places]
    return part


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


def remembered(exact: Callable[[Array], tuple[Array, Array]]) -> Callable[[Array], tuple[Array, Array]]:
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


def tabled(
    exact: Callable[[Array], tuple[Array, Array]], horizon: float, scales: tuple[float, float]
) -> Callable[[Array], tuple[Array, Array]]:
    """A quicker function that is the same within ``CLOSE``, by interpolation; the same function if no table is fine enough."""
    for number in TABLES:
        t = np.linspace(0.0, horizon, number + 1)
        halves = np.linspace(0.0, horizon, 2 * number + 1)
        blocks = exact(halves)
        table = tuple(block[::2] for block in blocks)

        def answer(t: Array, number: int = number, table: tuple[Array, ...] = table) -> tuple[Array, Array]:
            v, y = (_interpolated(block, np.asarray(t) * (number / horizon)) for block in table)
            return v, y

        middle = 0.5 * (t[1:] + t[:-1])
        misses = (np.abs(a - b[1::2]).max() for a, b in zip(answer(middle), blocks, strict=True))
        if all(miss <= CLOSE * scale for miss, scale in zip(misses, scales, strict=True)):
            return answer
    return exact


def _interpolated(table: Array, x: Array) -> Array:
    """Values between the rows of a table, x counted in rows: Lagrange's polynomial through the nearest ``NODES``."""
    first = np.clip(np.floor(x).astype(np.int64) - NODES // 2 + 1, 0, len(table) - NODES)
    u = x - first
    found = np.zeros((len(x), *table.shape[1:]))
    for j in range(NODES):
        weight = np.ones(len(x))
        for m in range(NODES):
            if m != j:
                weight *= (u - m) / (j - m)
        found += weight.reshape(-1, *(1,) * (table.ndim - 1)) * table[first + j]
    return found


def step_times(scene: Scene, methods: Sequence[Method]) -> dict[str, float]:
    """Nanoseconds per step of one member of a batch, on one thread, by method; the methods take turns."""
    numbers = scene.v.size + scene.y.size
    members = max(1, min(MEMBERS, NUMBERS // numbers))
    v, y = (np.repeat(np.asarray(block)[..., np.newaxis], members, axis=-1) for block in (scene.v, scene.y))

    def seconds(method: Method, steps: int) -> float:
        dt = TIMED_STEP * scene.dt  # so small that nothing leaves the finite numbers
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ControlWarning)
            begin = time.perf_counter()
            integrate(scene.system, method, v=v, y=y, dt=dt, steps=steps, threads=1, control=scene.control)
            return time.perf_counter() - begin

    steps = {}
    for method in methods:
        n = 1
        # The quicker of two, for a call that something else held up would look long enough.
        while min(seconds(method, n), seconds(method, n)) < TIMED_SECONDS:
            n *= 2
        steps[method.name] = n
    found = dict.fromkeys(steps, math.inf)
    for _ in range(REPEATS):
        for method in methods:
            n = steps[method.name]
            found[method.name] = min(found[method.name], 1e9 * seconds(method, n) / (n * members))
    return found
