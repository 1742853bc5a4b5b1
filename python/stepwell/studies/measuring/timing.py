"""The time of a step. Methods take turns, so that other load on the machine affects them all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...model.methods import Method
from ...runs.execution import quietly
from ...scenes import Scene
from .data import Timing

#: The step of a timed run, over the scene's: so small that no method leaves the finite numbers.
TIMED_STEP = 1e-4

#: The tolerances of timed runs: of a batch, and of one member, whose call must be negligible against many steps.
BATCH_TOLERANCE, SINGLE_TOLERANCE = 1e-6, 1e-12

#: The least and the most attempts of a timed run of a batch with a tolerance, so that the cost of the call does not count. A
#: quarter of them suffices for a system of more numbers than LARGE.
MIN_TRIED, MAX_TRIED, LARGE = 64, 512, 128

#: The most attempts of a run with a tolerance.
MOST_TRIED = 10_000_000

#: One run suffices to choose the number of steps if it takes this many times as long as needed.
MUCH = 20.0

#: A function that repeats a run this many times, and returns the seconds and the number of steps.
Timed = Callable[[int], tuple[float, int]]


class Effort(NamedTuple):
    """The effort of a measurement.

    Attributes:
        members: the most members of a batch: enough to hide the cost of the call, few enough for the cache.
        numbers: the most numbers of a batch, so that a cluster of stars does not take minutes.
        fewest: the least number of members, whatever the numbers.
        seconds: the shortest time of a timed run.
        repeats: how many times each method is timed after its number of steps was chosen.
        slow: the seconds of all methods together after which repeats end.
    """

    members: int
    numbers: int
    fewest: int
    seconds: float
    repeats: int
    slow: float = float("inf")

    def members_of(self, scene: Scene) -> int:
        """The number of members of the scene that are timed as a batch."""
        return max(self.fewest, min(self.members, self.numbers // max(1, scene.v.size + scene.y.size)))


class Batch:
    """Equal members of a scene; without a batch axis if ``members`` is 0."""

    def __init__(self, scene: Scene, members: int) -> None:
        self.scene, self.members, self._is_single = scene, max(1, members), members == 0
        v, y = (np.asarray(block) for block in (scene.v, scene.y))
        if members:
            v, y = (np.repeat(block[..., np.newaxis], members, axis=-1) for block in (v, y))
        self._v, self._y = v, y

    def steps(self, method: Method, **options: Any) -> Timed:
        """A run that makes the number of fixed steps, on one thread."""

        def timed(steps: int) -> tuple[float, int]:
            scene, begin = self.scene, time.perf_counter()
            quietly(scene.system, method, v=self._v, y=self._y, dt=TIMED_STEP * scene.dt, steps=steps, threads=1, **options)
            return time.perf_counter() - begin, steps

        return timed

    def attempts(self, method: Method, *, fused: bool = False) -> Timed:
        """A run that repeats an equal run with a tolerance, on one thread, and counts its attempts."""
        tolerance, most = (SINGLE_TOLERANCE, MOST_TRIED) if self._is_single else (BATCH_TOLERANCE, MAX_TRIED)
        time_of_enough = cache(partial(self._time_of_enough, method, fused))

        def timed(runs: int) -> tuple[float, int]:
            end = self.scene.horizon if self._is_single else time_of_enough()
            begin = time.perf_counter()
            tried = sum(self._tried(method, self._v, self._y, end, tolerance, most, fused) for _ in range(runs))
            return time.perf_counter() - begin, tried

        return timed

    def _time_of_enough(self, method: Method, fused: bool) -> float:
        """The time until which a run makes enough attempts."""
        scene = self.scene
        fewest = MIN_TRIED if scene.v.size + scene.y.size <= LARGE else MIN_TRIED // 4
        end = scene.horizon / 1024
        while end < 1000 * scene.horizon:
            if self._tried(method, scene.v, scene.y, end, BATCH_TOLERANCE, MAX_TRIED, fused) >= fewest:
                break
            end *= 2.0
        return end

    def _tried(self, method: Method, v: Array, y: Array, end: float, tolerance: float, most: int, fused: bool) -> int:
        adaptive: dict[str, Any] = {"tolerance": tolerance, "at": [end], "dt": 1e-3 * end, "max_steps": most}
        adaptive |= self.scene.adaptive_options
        run = quietly(self.scene.system, method, v=v, y=y, threads=1, fused=fused, **adaptive)
        assert run.paces is not None
        return int(run.paces.evaluations.max()) // method.attempt_evaluations


def in_turns(runs: Mapping[str, Timed], effort: Effort, members: int) -> dict[str, list[float]]:
    """Nanoseconds per step and member of each run, of all repeats; the first is from the choice of its number of steps."""
    begun = time.perf_counter()
    sizes: dict[str, int] = {}
    times: dict[str, list[float]] = {}
    for name, timed in runs.items():
        n, (seconds, steps) = 1, timed(1)
        # The quicker of two runs counts, since other load would make a run look long enough, unless it is far too long.
        while seconds < MUCH * effort.seconds and min(seconds, timed(n)[0]) < effort.seconds:
            n *= 2
            seconds, steps = timed(n)
        sizes[name], times[name] = n, [1e9 * seconds / (steps * members)]
    for _ in range(effort.repeats):
        if time.perf_counter() - begun > effort.slow:
            break
        for name, timed in runs.items():
            seconds, steps = timed(sizes[name])
            times[name].append(1e9 * seconds / (steps * members))
    return times


#: The effort for charts and for ``stepwell bench``: a timed run takes fifty times the cost of a call.
CHARTS = Effort(members=4096, numbers=131_072, fewest=8, seconds=0.002, repeats=7)


def step_times(
    scene: Scene, methods: Sequence[Method], members: int | None = None, fused: bool = False, dtype: str = "float64"
) -> dict[str, Timing]:
    """Nanoseconds per step of one member of a batch, by method.

    The time of a step depends neither on its length nor on the state, so one measurement serves a whole curve. ``members`` are
    those of ``CHARTS`` if None, and 0 for a run without a batch.
    """
    batch = Batch(scene, CHARTS.members_of(scene) if members is None else members)
    return _summaries(batch, {method.name: batch.steps(method, fused=fused, dtype=dtype) for method in methods})


def tried_times(scene: Scene, methods: Sequence[Method], members: int | None = None, fused: bool = False) -> dict[str, Timing]:
    """Nanoseconds per attempted step of one member of a batch, by method, in runs with a tolerance; as ``step_times``."""
    batch = Batch(scene, CHARTS.members_of(scene) if members is None else members)
    return _summaries(batch, {method.name: batch.attempts(method, fused=fused) for method in methods})


def _summaries(batch: Batch, runs: Mapping[str, Timed]) -> dict[str, Timing]:
    times = {name: each[1:] or each for name, each in in_turns(runs, CHARTS, batch.members).items()}
    return {name: Timing(median(each), min(each), max(each)) for name, each in times.items()}
