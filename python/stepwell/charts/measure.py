"""Measurements of one method on one scene: its errors, whether it is stable, and its time."""

from __future__ import annotations

import math
import statistics
import time
import warnings
from collections.abc import Sequence

import numpy as np

from ..errors import DivergenceWarning, UnsupportedError
from ..integrate import fits_together, integrate
from ..methods import Method
from ..scenes import Scene
from .data import Point, Timing

#: Errors are looked for in at least this many states of a run, or in all if it has fewer.
SAMPLES = 1000

#: The amplitude of a run grows if the largest of its second half is above the largest of its first half by this factor,
#: and above the exact solution's. What is large but bounded, as near a stability limit, is as large in both halves.
GROWTH = 1.1

#: Members of the batch that is timed, on one thread: enough to hide the cost of the call, few enough for the cache.
MEMBERS = 4096

#: Step of a timed run, as a share of the scene's: so small that no method leaves the finite numbers.
TIMED_STEP = 1e-4

#: A timed run takes at least this many seconds, fifty times a call's own cost, and there are so many of each method.
TIMED_SECONDS = 0.005
REPEATS = 11


def refusal(scene: Scene, method: Method) -> str | None:
    """Why the method cannot do the scene, or None."""
    try:
        fits_together(scene.system, method)
    except UnsupportedError as error:
        return str(error)
    return None


def assess(scene: Scene, method: Method, dt: float, steps: int) -> Point:
    """Run the scene and look at its errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        run = scene.run(method, dt, steps=steps, every=max(1, steps // SAMPLES))
    state_error, energy_error = (float(e.max()) for e in (scene.state_error(run), scene.energy_error(run)))
    amplitude = scene.amplitude(run)
    half = len(amplitude) // 2
    # Not above the exact solution is no growth: a driven system may well start small. NaN is above everything.
    grown = not amplitude[half:].max() <= GROWTH * max(1.0, float(amplitude[:half].max()))
    return Point(
        steps=steps,
        dt=dt,
        cost=method.evaluations / dt,
        state_error=state_error,
        energy_error=energy_error,
        unstable=grown and state_error > 1.0,
    )


def largest_stable_step(scene: Scene, method: Method, points: Sequence[Point]) -> float:
    """The step at which the method falls off, within 0.1 %: below it every rung of ``points`` is stable.

    ``points`` go from the largest step to the smallest. Infinite if all are stable, 0 if not even the last one is.
    """
    unstable = [point.dt for point in points if point.unstable]
    if not unstable:
        return math.inf
    high = min(unstable)
    low = max((point.dt for point in points if point.dt < high), default=0.0)
    while low > 0.0 and high > 1.001 * low:
        middle = math.sqrt(low * high)
        point = assess(scene, method, middle, scene.steps_for(middle))
        low, high = (low, middle) if point.unstable else (middle, high)
    return low


def step_times(scene: Scene, methods: Sequence[Method]) -> dict[str, Timing]:
    """Nanoseconds per step of one member of a batch, by method.

    The time of a step depends neither on its length nor on the state, so one measurement serves a whole curve. The
    methods take turns, so that whatever else the machine does meets them all alike.
    """

    def seconds(method: Method, steps: int) -> float:
        begin = time.perf_counter()
        integrate(scene.system, method, v=v, y=y, dt=TIMED_STEP * scene.dt, steps=steps, threads=1)
        return time.perf_counter() - begin

    v, y = (np.repeat(np.asarray(block)[..., np.newaxis], MEMBERS, axis=-1) for block in (scene.v, scene.y))
    steps = {}
    for method in methods:
        n = 50
        while seconds(method, n) < TIMED_SECONDS:
            n *= 2
        steps[method.name] = n
    found: dict[str, list[float]] = {method.name: [] for method in methods}
    for _ in range(REPEATS):
        for method in methods:
            n = steps[method.name]
            found[method.name].append(1e9 * seconds(method, n) / (n * MEMBERS))
    return {name: Timing(statistics.median(ns), min(ns), max(ns)) for name, ns in found.items()}
