"""Trial runs of a scene with fixed steps: the error of a method with a step, and whether it grows."""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np

from ...analysis.stability import StabilityLimit
from ...analysis.stability.limit import limit_of
from ...model.methods import Method
from ...runs import engine
from ...runs.execution import quietly
from ...runs.result import Run
from ...scenes.base import quiet_run
from ..measuring.measure import grew
from .motion import Motion

#: The most numbers that a run saves; if all its steps have fewer, it saves every step.
MAX_SAVED_NUMBERS = 2_000_000

#: The most saved states that a confirming run compares with the reference solution.
MAX_CONFIRMED_STATES = 50_000

#: An error below this counts as asymptotic: it falls by the method's order. Above, nothing is predicted.
ASYMPTOTIC_ERROR = 0.3

#: A long run is made in PIECES pieces. If the error at the end of a piece is above LOST, or above both ASYMPTOTIC_ERROR and
#: LOST_RATIO times the allowed error, the rest is omitted, since nothing more can be learned from it. The ratio is beyond the
#: errors that the search uses (IRREGULAR_RISE times IRREGULAR_ERROR_RATIO there). If the allowed error is near LOST, the error
#: must be above twice the allowed one.
PIECES, LOST, LOST_RATIO = 12, 1.0, 16.0


class Trial(NamedTuple):
    """A run over the horizon.

    Attributes:
        dt: the step; with a tolerance the mean of all attempts.
        steps: the number of steps; with a tolerance of all attempts.
        error: the largest state error; for a run that was stopped, up to that point.
        unstable: whether it has no correct digit and grew, or with a tolerance stopped early.
        rejected: the number of rejected steps.
        before: the largest error before it left the asymptotic range, if it did.
        share: the fraction of the horizon that was run; the rest of a long run without a correct digit is omitted.
    """

    dt: float
    steps: int
    error: float
    unstable: bool
    rejected: int = 0
    before: float = 0.0
    share: float = 1.0

    @property
    def stopped(self) -> bool:
        """True if a part of the run was omitted."""
        return self.share < 1.0


class Trials:
    """Runs of one scene with fixed steps of this precision, each made once.

    A run of more rate evaluations than ``long`` is stopped where it has no correct digit.
    """

    def __init__(self, motion: Motion, tolerance: float, long: float, dtype: str = "float64") -> None:
        self.dtype, self.until = dtype, motion.until
        self.long, self.lost = long, max(ASYMPTOTIC_ERROR, min(LOST, LOST_RATIO * tolerance), 2.0 * tolerance)
        self.scene, self.grid, self.marks = motion.scene, motion.grid, motion.marks
        self.numbers = self.scene.v.size + self.scene.y.size
        self._done: dict[tuple[str, int, float], Trial] = {}
        self._dense: dict[tuple[str, int, float], Trial] = {}
        self._evaluations: dict[str, int] = {}
        self._limits: dict[str, StabilityLimit] = {}
        #: The last run, since ``confirm`` often follows ``look``.
        self._last: tuple[tuple[str, int, float], Run] | None = None
        #: The number of runs, and of all their rate evaluations.
        self.runs, self.work = 0, 0.0

    def evaluations(self, method: Method) -> int:
        """Function evaluations of a step."""
        if method.name not in self._evaluations:
            self._evaluations[method.name] = engine.evaluations(method, self.scene.system)
        return self._evaluations[method.name]

    def stability_limit(self, method: Method) -> StabilityLimit:
        """The stability limit of a method on a linear system, which takes longer to find than most runs."""
        if method.name not in self._limits:
            self._limits[method.name] = limit_of(self.scene.system, method)
        return self._limits[method.name]

    def look(self, method: Method, dt: float, steps: int) -> Trial:
        """The run, with some two thousand states compared with the true ones."""
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
        """The run, with every state compared unless there are too many."""
        key = (method.name, steps, dt)
        if key not in self._dense:
            trial = self.look(method, dt, steps)
            run = self._last[1] if self._last and self._last[0] == key else self._run(method, dt, steps)
            some = math.ceil(len(run.t) * max(self.numbers / MAX_SAVED_NUMBERS, 1.0 / MAX_CONFIRMED_STATES))
            error = float(self.scene.state_error(run.select(slice(None, None, max(1, some)))).max())
            self._dense[key] = trial._replace(error=max(trial.error, error))
        return self._dense[key]

    def unstable(self, method: Method, dt: float, steps: int) -> bool:
        """True if the run grew and has no correct digit. The true motion is computed only if it grew."""
        key = (method.name, steps, dt)
        if key in self._done and not self._done[key].stopped:
            return self._done[key].unstable
        part = self._marked(self._run(method, dt, steps))
        return self._grown(part) and float(self.scene.state_error(part).max()) > 1.0

    def _every(self, steps: int) -> int:
        return max(1, math.ceil(steps * self.numbers / MAX_SAVED_NUMBERS))

    def _watched(self, method: Method, dt: float, steps: int) -> tuple[Run, float]:
        """The run and its largest error; a long run ends where it has no correct digit."""
        every = self._every(steps)
        piece = every * math.ceil(steps / (PIECES * every))
        if self.evaluations(method) * steps <= self.long or piece >= steps:
            run = self._run(method, dt, steps)
            self._last = (method.name, steps, dt), run
            return run, 0.0
        self.runs += 1
        worst, done, pieces = 0.0, 0, []
        state: dict[str, Any] = {"v": self.scene.v, "y": self.scene.y, "dt": dt, "control": self.scene.control}
        state["dtype"] = self.dtype
        while done < steps and worst <= self.lost:
            number = min(piece, steps - done)
            pieces.append(run := quietly(self.scene.system, method, steps=number, every=every, **state))
            done, state = done + number, {"resume": run}
            worst = max(worst, float(self.scene.state_error(run.select(-1))[0]))
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
        self.runs += 1
        self.work += self.evaluations(method) * steps
        return self._known(quiet_run(self.scene, method, dt, steps=steps, every=self._every(steps), dtype=self.dtype))

    def _known(self, run: Run) -> Run:
        """The run as far as the true motion is known: steps that were rounded to float32 may end after it."""
        if self.dtype == "float64" or run.t[-1] <= self.until:
            return run
        return run.select(run.t <= self.until)

    def _marked(self, run: Run) -> Run:
        """The states at the marks; the last is one of them."""
        return run.select(np.unique(np.searchsorted(run.t, np.minimum(self.marks, run.t[-1]))))

    def _grown(self, run: Run) -> bool:
        amplitude, half = self.scene.amplitude(run), int(np.searchsorted(run.t, 0.5 * run.t[-1]))
        return grew(amplitude, half)
