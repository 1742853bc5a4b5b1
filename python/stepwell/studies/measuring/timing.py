"""How long a step takes. Methods take turns, so that whatever else the machine does meets them all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...model.methods import Method
from ...runs.integration import quietly
from ...scenes import Scene
from .data import Timing

#: Step of a timed run, as a share of the scene's: so small that no method leaves the finite numbers.
TIMED_STEP = 1e-4

#: Tolerance of timed runs: those of a batch, and those of one member, whose call must be lost among many steps.
BATCH_TOLERANCE, SINGLE_TOLERANCE = 1e-6, 1e-12

#: With a tolerance a timed run of a batch tries at least so many steps, so that the cost of the call does not count, and at most
#: so many. A quarter of them will do for a system of more numbers than LARGE.
MIN_TRIED, MAX_TRIED, LARGE = 64, 512, 128

#: A run with a tolerance makes no more steps than this, rejected ones counted.
MOST_TRIED = 10_000_000

#: One run suffices to choose the number of steps if it takes this many times as long as it must.
MUCH = 20.0

#: Runs so many times, and returns the seconds and the steps that were made.
Timed = Callable[[int], tuple[float, int]]


class Effort(NamedTuple):
    """How much a measurement takes.

    Attributes:
        members: a batch has at most so many members: enough to hide the cost of the call, few enough for the cache.
        numbers: and at most so many numbers in all, so that a cluster of stars does not take minutes.
        fewest: but at least so many members.
        seconds: a timed run takes at least this.
        repeats: each method is timed so many times after its number of steps was chosen.
        slow: repeats end when all methods together have taken so many seconds.
    """

    members: int
    numbers: int
    fewest: int
    seconds: float
    repeats: int
    slow: float = float("inf")

    def members_of(self, scene: Scene) -> int:
        """How many members of the scene are timed as a batch."""
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
        """Makes so many fixed steps, on one thread."""

        def timed(steps: int) -> tuple[float, int]:
            scene, begin = self.scene, time.perf_counter()
            quietly(scene.system, method, v=self._v, y=self._y, dt=TIMED_STEP * scene.dt, steps=steps, threads=1, **options)
            return time.perf_counter() - begin, steps

        return timed

    def attempts(self, method: Method, *, fused: bool = False) -> Timed:
        """Makes so many equal runs with a tolerance, on one thread; the steps that were tried count."""
        tolerance, most = (SINGLE_TOLERANCE, MOST_TRIED) if self._is_single else (BATCH_TOLERANCE, MAX_TRIED)
        time_of_enough = cache(partial(self._time_of_enough, method, fused))

        def timed(runs: int) -> tuple[float, int]:
            end = self.scene.horizon if self._is_single else time_of_enough()
            begin = time.perf_counter()
            tried = sum(self._tried(method, self._v, self._y, end, tolerance, most, fused) for _ in range(runs))
            return time.perf_counter() - begin, tried

        return timed

    def _time_of_enough(self, method: Method, fused: bool) -> float:
        """The time until which a run tries enough steps."""
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
    """Nanoseconds per step and member of each run, several times; the first time is of when its number of steps was chosen."""
    begun = time.perf_counter()
    sizes: dict[str, int] = {}
    times: dict[str, list[float]] = {}
    for name, timed in runs.items():
        n, (seconds, steps) = 1, timed(1)
        # The quicker of two counts: a call that something else held up would look long enough. One far too long is not.
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


#: The charts' effort, and that of ``stepwell bench``: a timed run takes fifty times a call's own cost.
CHARTS = Effort(members=4096, numbers=131_072, fewest=8, seconds=0.005, repeats=11)


def step_times(
    scene: Scene, methods: Sequence[Method], members: int | None = None, fused: bool = False, dtype: str = "float64"
) -> dict[str, Timing]:
    """Nanoseconds per step of one member of a batch, by method.

    The time of a step depends neither on its length nor on the state, so one measurement serves a whole curve.

    Args:
        scene: what to step.
        methods: by which.
        members: of the batch; as many as ``CHARTS`` says if None, and 0 for a run without a batch.
        fused: with fused multiply-adds.
        dtype: in float64 or float32.
    """
    batch = Batch(scene, CHARTS.members_of(scene) if members is None else members)
    return _summaries(batch, {method.name: batch.steps(method, fused=fused, dtype=dtype) for method in methods})


def tried_times(scene: Scene, methods: Sequence[Method], members: int | None = None, fused: bool = False) -> dict[str, Timing]:
    """Nanoseconds per step that is tried, of one member of a batch, by method, in runs with a tolerance; as ``step_times``."""
    batch = Batch(scene, CHARTS.members_of(scene) if members is None else members)
    return _summaries(batch, {method.name: batch.attempts(method, fused=fused) for method in methods})


def _summaries(batch: Batch, runs: Mapping[str, Timed]) -> dict[str, Timing]:
    times = {name: each[1:] or each for name, each in in_turns(runs, CHARTS, batch.members).items()}
    return {name: Timing(median(each), min(each), max(each)) for name, each in times.items()}
