"""Trial runs of a scene with fixed steps: how wrong a method is with a step, whether it grows, and what a step of it costs."""

from __future__ import annotations

import copy
import math
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...errors import AccuracyWarning, ControlWarning, DivergenceWarning, ToleranceWarning
from ...model.methods import Method
from ...runs import engine
from ...runs.integration import integrate
from ...runs.result import Run
from ...scenes import Scene
from ..measuring.measure import MIN_GROWTH, TIMED_STEP, TIMED_TOLERANCE
from .motion import Motion

#: A run saves at most so many numbers: every step, if these are fewer.
MAX_SAVED_NUMBERS = 2_000_000

#: A confirming run compares all its saved states with the reference solution, up to so many.
MAX_CONFIRMED_STATES = 50_000

#: The batch that is timed has at most so many members, and at most so many numbers in all, which the cache holds.
MAX_MEMBERS, MAX_NUMBERS = 512, 16_384

#: A timed run takes at least this many seconds; of one that takes MUCH times as long a single one may do. The shortest time of so
#: many further runs counts, since other load only adds to it; of fewer, where timing all methods takes longer than SLOW_SECONDS.
TIMED_SECONDS, MUCH, REPEATS, SLOW_SECONDS = 0.0005, 20.0, 5, 0.25

#: With a tolerance a timed run tries at least so many steps, so that the cost of the call does not count, and at most so many. A
#: quarter of them will do for a system of more numbers than LARGE.
MIN_TIMED_STEPS, MAX_TIMED_STEPS, LARGE = 64, 512, 128


#: Below this an error is taken to be in the asymptotic range, where it falls by the method's order; above, nothing is predicted.
ASYMPTOTIC_ERROR = 0.3

#: A long run is made in so many pieces. Where the error at the end of one is above LOST, or above both ASYMPTOTIC_ERROR and
#: LOST_RATIO times what is allowed, the rest is left out: no more can be learned from it. The ratio is more than the search looks
#: at (IRREGULAR_RISE times IRREGULAR_ERROR_RATIO there). If an error near LOST is allowed, it must be above twice that.
PIECES, LOST, LOST_RATIO = 12, 1.0, 16.0


#: Two timings that differ by less than this share are taken to be equal even if repeats agree better: the place of code and
#: arrays in memory makes such differences. What repeats say counts up to the second number, above which they say nothing.
MIN_COST_NOISE, MAX_COST_NOISE = 0.05, 0.25


class Times(dict[str, float]):
    """Measured nanoseconds by method.

    Attributes:
        noise: the share by which two of them may differ without a meaning, from the spread of the repeats.
    """

    noise: float = 0.0


class Trial(NamedTuple):
    """A run over the horizon.

    Attributes:
        dt: the step; with a tolerance the mean of all that were tried.
        steps: how many; with a tolerance all that were tried.
        error: the largest state error; of a run that was stopped, up to there.
        unstable: whether it is wrong altogether and grew, or with a tolerance stopped early.
        rejected: how many of the steps were rejected.
        before: the largest error before it left the asymptotic range, if it did.
        made: the share of the run that was made; the rest of a long one is left out where it is wrong altogether.
    """

    dt: float
    steps: int
    error: float
    unstable: bool
    rejected: int = 0
    before: float = 0.0
    made: float = 1.0

    @property
    def stopped(self) -> bool:
        """Whether a part of the run was left out."""
        return self.made < 1.0


class Trials:
    """Runs of one scene with fixed steps, each made once.

    Args:
        motion: what runs are compared with.
        tolerance: the state error that is allowed.
        long: a run of more rate evaluations than this is stopped where it is wrong altogether.
        dtype: in which they are computed.
    """

    def __init__(self, motion: Motion, tolerance: float, long: float, dtype: str = "float64") -> None:
        self.dtype, self.until = dtype, motion.until
        self.long, self.lost = long, max(ASYMPTOTIC_ERROR, min(LOST, LOST_RATIO * tolerance), 2.0 * tolerance)
        self.scene, self.grid, self.marks = motion.scene, motion.grid, motion.marks
        self.numbers = self.scene.v.size + self.scene.y.size
        self._done: dict[tuple[str, int, float], Trial] = {}
        self._dense: dict[tuple[str, int, float], Trial] = {}
        self._evaluations: dict[str, int] = {}
        #: The last run, for what is looked at is often confirmed at once.
        self._last: tuple[tuple[str, int, float], Run] | None = None
        #: Runs, and rate evaluations of all.
        self.made, self.work = 0, 0.0

    def evaluations(self, method: Method) -> int:
        """Function evaluations of a step."""
        if method.name not in self._evaluations:
            self._evaluations[method.name] = engine.evaluations(method, self.scene.system)
        return self._evaluations[method.name]

    def look(self, method: Method, dt: float, steps: int) -> Trial:
        """The run, of which some two thousand states are compared with the true ones."""
        key = (method.name, steps, dt)
        if key not in self._done:
            run, worst = self._watched(method, dt, steps)
            part = self._marked(run)
            errors = self.scene.state_error(part)
            error = max(worst, float(errors.max()))
            small = errors < ASYMPTOTIC_ERROR
            before = 0.0 if small.all() else float(errors[: int(np.argmin(small))].max(initial=0.0))
            self._done[key] = Trial(dt, steps, error, error > 1.0 and self._grown(part), 0, before, run.steps / steps)
        return self._done[key]

    def confirm(self, method: Method, dt: float, steps: int) -> Trial:
        """The same run, of which every state is compared if they are not too many."""
        key = (method.name, steps, dt)
        if key not in self._dense:
            trial = self.look(method, dt, steps)
            run = self._last[1] if self._last and self._last[0] == key else self._run(method, dt, steps)
            run = _part(
                run,
                np.arange(
                    0,
                    len(run.t),
                    max(1, math.ceil(len(run.t) * max(self.numbers / MAX_SAVED_NUMBERS, 1.0 / MAX_CONFIRMED_STATES))),
                ),
            )
            error = float(self.scene.state_error(run).max())
            self._dense[key] = trial._replace(error=max(trial.error, error))
        return self._dense[key]

    def unstable(self, method: Method, dt: float, steps: int) -> bool:
        """Whether the run grew and has no correct digit. The true motion is computed only if it grew."""
        key = (method.name, steps, dt)
        if key in self._done and not self._done[key].stopped:
            return self._done[key].unstable
        part = self._marked(self._run(method, dt, steps))
        return self._grown(part) and float(self.scene.state_error(part).max()) > 1.0

    def _every(self, steps: int) -> int:
        return max(1, math.ceil(steps * self.numbers / MAX_SAVED_NUMBERS))

    def _watched(self, method: Method, dt: float, steps: int) -> tuple[Run, float]:
        """The run, of which the rest is left out if it is long and was wrong altogether; and the largest error that was seen."""
        every = self._every(steps)
        piece = every * math.ceil(steps / (PIECES * every))
        if self.evaluations(method) * steps <= self.long or piece >= steps:
            run = self._run(method, dt, steps)
            self._last = (method.name, steps, dt), run
            return run, 0.0
        self.made += 1
        worst, done, pieces = 0.0, 0, []
        state: dict[str, Any] = {"v": self.scene.v, "y": self.scene.y, "dt": dt, "control": self.scene.control}
        state["dtype"] = self.dtype
        with warnings.catch_warnings():
            for kind in (DivergenceWarning, ControlWarning, AccuracyWarning):
                warnings.simplefilter("ignore", kind)
            while done < steps and worst <= self.lost:
                number = min(piece, steps - done)
                pieces.append(run := integrate(self.scene.system, method, steps=number, every=every, **state))
                done, state = done + number, {"resume": run}
                worst = max(worst, float(self.scene.state_error(_part(run, np.array([-1])))[0]))
        self.work += self.evaluations(method) * done
        whole = copy.copy(pieces[-1])
        for name in ("t", "v", "y"):
            blocks = [getattr(each, name) for each in pieces]
            setattr(whole, name, np.concatenate([blocks[0], *(block[1:] for block in blocks[1:])]))
        whole.steps = done
        whole = self._known(whole)
        if done == steps:
            self._last = (method.name, steps, dt), whole
        return whole, worst

    def _run(self, method: Method, dt: float, steps: int) -> Run:
        self.made += 1
        self.work += self.evaluations(method) * steps
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DivergenceWarning)
            warnings.simplefilter("ignore", ControlWarning)
            warnings.simplefilter("ignore", AccuracyWarning)
            return self._known(self.scene.run(method, dt, steps=steps, every=self._every(steps), dtype=self.dtype))

    def _known(self, run: Run) -> Run:
        """The run as far as the true motion is known: steps that were rounded to float32 may end after it."""
        if self.dtype == "float64" or run.t[-1] <= self.until:
            return run
        return _part(run, np.flatnonzero(run.t <= self.until))

    def _marked(self, run: Run) -> Run:
        """The states at the marks; the last is one of them."""
        return _part(run, np.unique(np.searchsorted(run.t, np.minimum(self.marks, run.t[-1]))))

    def _grown(self, run: Run) -> bool:
        """As the charts have it: the amplitude grows in the second half, above the true one."""
        amplitude, half = self.scene.amplitude(run), int(np.searchsorted(run.t, 0.5 * run.t[-1]))
        # NaN is above everything.
        return not amplitude[half:].max() <= MIN_GROWTH * max(1.0, float(amplitude[: max(1, half)].max()))


def _part(run: Run, places: np.ndarray[Any, np.dtype[np.int64]]) -> Run:
    """The run with these of its saved states."""
    part = copy.copy(run)
    part.t, part.v, part.y = run.t[places], run.v[places], run.y[places]
    return part


def step_times(scene: Scene, methods: Sequence[Method], singles: Sequence[Method] = ()) -> Times:
    """Nanoseconds per step of one member of a batch, on one thread; all take turns.

    Args:
        scene: what is stepped.
        methods: by which, in float64.
        singles: by which, in float32.

    Returns:
        Times by the method's name, those in float32 by ``single_name``.
    """
    v, y, members = _batch(scene)

    def timed(method: Method, steps: int, dtype: str) -> tuple[float, int]:
        dt = TIMED_STEP * scene.dt  # so small that nothing leaves the finite numbers
        begin = time.perf_counter()
        integrate(scene.system, method, v=v, y=y, dt=dt, steps=steps, threads=1, control=scene.control, dtype=dtype)
        return time.perf_counter() - begin, steps

    ways = {method.name: partial(timed, method, dtype="float64") for method in methods}
    ways |= {single_name(method): partial(timed, method, dtype="float32") for method in singles}
    return _in_turns(ways, members)


def single_name(method: Method) -> str:
    """The name of a method in float32: ``"rk4, float32"``."""
    return f"{method.name}, float32"


def tried_times(scene: Scene, methods: Sequence[Method]) -> Times:
    """Nanoseconds per step that is tried in a run with a tolerance, rejected ones counted; otherwise as ``step_times``."""
    batch_v, batch_y, members = _batch(scene)

    fewest = MIN_TIMED_STEPS if scene.v.size + scene.y.size <= LARGE else MIN_TIMED_STEPS // 4

    def tried(method: Method, v: Array, y: Array, end: float) -> int:
        run = integrate(
            scene.system,
            method,
            v=v,
            y=y,
            tolerance=TIMED_TOLERANCE[True],
            at=[end],
            dt=1e-3 * end,
            max_steps=MAX_TIMED_STEPS,
            threads=1,
        )
        assert run.paces is not None
        return int(run.paces.evaluations.max()) // method.attempt_evaluations

    def timed(method: Method, runs: int) -> tuple[float, int]:
        begin = time.perf_counter()
        steps = sum(tried(method, batch_v, batch_y, ends[method.name]) for _ in range(runs))
        return time.perf_counter() - begin, steps

    ends = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        warnings.simplefilter("ignore", AccuracyWarning)
        for method in methods:
            end = scene.horizon / 1024
            while tried(method, scene.v, scene.y, end) < fewest and end < 1000 * scene.horizon:
                end *= 2.0
            ends[method.name] = end
    return _in_turns({method.name: partial(timed, method) for method in methods}, members)


def _batch(scene: Scene) -> tuple[Array, Array, int]:
    """Blocks of equal members, and how many they are."""
    members = max(1, min(MAX_MEMBERS, MAX_NUMBERS // max(1, scene.v.size + scene.y.size)))
    v, y = (np.repeat(np.asarray(block)[..., np.newaxis], members, axis=-1) for block in (scene.v, scene.y))
    return v, y, members


def _in_turns(ways: Mapping[str, Callable[[int], tuple[float, int]]], members: int) -> Times:
    """Each function takes a number of runs or steps, and returns seconds and how many steps were made."""
    sizes, repeats = {}, {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ControlWarning)
        warnings.simplefilter("ignore", ToleranceWarning)
        warnings.simplefilter("ignore", AccuracyWarning)
        begun = time.perf_counter()
        for name, timed in ways.items():
            n, (seconds, steps) = 1, timed(1)
            # The quicker of two, for a call that something else held up would look long enough; one that is far too long is not.
            while seconds < MUCH * TIMED_SECONDS and min(seconds, timed(n)[0]) < TIMED_SECONDS:
                n *= 2
                seconds, steps = timed(n)
            sizes[name], repeats[name] = n, [1e9 * seconds / (steps * members)]
        for _ in range(REPEATS):
            if time.perf_counter() - begun > SLOW_SECONDS:
                break
            for name, timed in ways.items():
                seconds, steps = timed(sizes[name])
                repeats[name].append(1e9 * seconds / (steps * members))
    found = Times({name: min(each) for name, each in repeats.items()})
    found.noise = cost_noise(repeats.values())
    return found


def cost_noise(repeats: Iterable[Sequence[float]]) -> float:
    """By which share the least of some repeats may be wrong: how far the second least is above it, of the worst method."""
    repeats = list(repeats)
    if not repeats:
        return 0.0
    spreads = [sorted(each)[1] / min(each) - 1.0 for each in repeats if len(each) > 1]
    return min(MAX_COST_NOISE, max(MIN_COST_NOISE, *spreads, 0.0))
