"""Trial runs of a scene with adaptive steps: the error of a method with a tolerance, and the steps that it attempts.

Steps depend on the output times only where a state within a step shows that the step missed something. So the error is measured
at many times, and at those of the run that an advice shows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...model.methods import Method
from ...runs.execution import quietly
from ...runs.result import Run
from .motion import Motion, looked_up
from .trials import Trial

#: The error of a run is first measured at FIRST_SAMPLES of the marks. To confirm it, it is measured at all of them, and then at
#: REFINED_SAMPLES times around each of the REFINED_MARKS worst.
FIRST_SAMPLES, REFINED_SAMPLES, REFINED_MARKS = 128, 32, 4

#: Each such time costs a step. In large systems, where a run may make few evaluations, there are fewer times: their steps make at
#: most this fraction of the evaluations.
CONFIRMING_SHARE = 1 / 8

#: Steps are counted for each frame. If there are more frames than MAX_PIECES, they are first counted for as many pieces, and then
#: frame by frame in the WORST_PIECES pieces with the most steps.
MAX_PIECES, WORST_PIECES = 2000, 20


class AdaptiveTrials:
    """Runs of one scene with a tolerance, each made once, of at most so many function evaluations.

    A state error above the ``allowed`` one need not be known exactly.
    """

    def __init__(self, motion: Motion, allowed: float, most: float) -> None:
        scene = motion.scene
        assert scene.exact is not None
        self.grid, self.allowed, self.most = motion.grid, allowed, most
        #: The cost of a run includes that of the states at these times.
        self.output_times = motion.grid.output_times if motion.grid.framed else np.array([motion.grid.end])
        self.marks = motion.marks[1:]
        self.scene = replace(scene, exact=looked_up(scene.exact, np.union1d(self.output_times, self.marks)))
        self._runs: dict[tuple[str, float], Trial] = {}
        self._trials: dict[tuple[str, float], Trial] = {}
        self._confirmed: dict[tuple[str, float], Trial] = {}
        self._worst: dict[tuple[str, float], int] = {}
        #: Number of runs, and their function evaluations in total.
        self.runs, self.work = 0, 0.0

    def look(self, method: Method, tolerance: float, share: float = 1.0) -> Trial:
        """The run with its error at some of the marks; a new run may make this fraction of the most function evaluations."""
        key = (method.name, tolerance)
        if key not in self._trials:
            trial = self._run(method, tolerance, share)
            if trial.error <= self.allowed:
                error, _ = self._errors(method, tolerance, self.marks[:: max(1, len(self.marks) // FIRST_SAMPLES)])
                trial = trial._replace(error=max(trial.error, float(error.max())))
            self._trials[key] = trial
        return self._trials[key]

    def confirm(self, method: Method, tolerance: float) -> Trial:
        """The run with its error at all marks and around the worst of them."""
        key = (method.name, tolerance)
        if key not in self._confirmed:
            trial = self.look(method, tolerance)
            if trial.error <= self.allowed:
                trial = self._measured(method, tolerance, trial)
            self._confirmed[key] = trial
        return self._confirmed[key]

    def measured(self, method: Method, tolerance: float) -> Trial:
        """As ``confirm``, for a run that need not be good enough: ``look`` knows its error at the output times only."""
        trial = self.confirm(method, tolerance)
        if self.allowed < trial.error < math.inf:
            trial = self._confirmed[method.name, tolerance] = self._measured(method, tolerance, trial)
        return trial

    def _measured(self, method: Method, tolerance: float, trial: Trial) -> Trial:
        """A trial with its error at all marks and around the worst of them, and at the times that an advice shows."""
        times = max(FIRST_SAMPLES, int(CONFIRMING_SHARE * self.most / method.attempt_evaluations))
        marks = self.marks[:: math.ceil(len(self.marks) / times)]
        error, _ = self._errors(method, tolerance, marks)
        ends = np.concatenate([[0.0], marks, self.marks[-1:]])
        around = [np.linspace(ends[i], ends[i + 2], REFINED_SAMPLES + 1) for i in np.argsort(error)[-REFINED_MARKS:]]
        closer, _ = self._errors(method, tolerance, np.unique(np.concatenate(around)))
        shown, _ = self._errors(method, tolerance, self.grid.output_times)
        return trial._replace(error=max(trial.error, *(float(each.max()) for each in (error, closer, shown))))

    def _errors(self, method: Method, tolerance: float, at: Array, share: float = 1.0) -> tuple[Array, Run]:
        run = self._integrated(method, tolerance, at, share)
        return self.scene.state_error(run), run

    def _run(self, method: Method, tolerance: float, share: float) -> Trial:
        """The run that is judged, with its error at the output times."""
        key = (method.name, tolerance)
        if key not in self._runs:
            errors, run = self._errors(method, tolerance, self.output_times, share)
            assert run.paces is not None
            steps = int(run.paces.evaluations) // method.attempt_evaluations
            stopped = bool(run.status)
            error = math.inf if stopped else float(errors.max())
            self._runs[key] = Trial(self.grid.end / steps, steps, error, stopped, int(run.paces.rejected))
        return self._runs[key]

    def _integrated(self, method: Method, tolerance: float, at: Array, share: float) -> Run:
        self.runs += 1
        scene, most = self.scene, max(1, int(share * self.most / method.attempt_evaluations))
        options: dict[str, Any] = {"tolerance": tolerance, "at": at, "max_steps": most} | scene.adaptive_options
        run = quietly(scene.system, method, v=scene.v, y=scene.y, **options)
        assert run.paces is not None
        self.work += int(run.paces.evaluations)
        return run

    def worst(self, method: Method, tolerance: float) -> int:
        """The most attempted steps in a frame, including those for its state."""
        key = (method.name, tolerance)
        if key not in self._worst:
            number = len(self.output_times)
            start = Leg(0, {"v": self.scene.v, "y": self.scene.y, "tolerance": tolerance}, 0)
            ends = np.unique(np.linspace(0, number, min(number, MAX_PIECES) + 1).astype(int))[1:].tolist()
            legs = [start, *self._legs(method, start, ends)]
            if len(ends) < number:
                pairs = sorted(itertools.pairwise(legs), key=lambda pair: pair[0].tried - pair[1].tried)[:WORST_PIECES]
                pieces = [[a, *self._legs(method, a, range(a.end + 1, b.end + 1))] for a, b in pairs]
            else:
                pieces = [legs]
            self._worst[key] = max(b.tried - a.tried for each in pieces for a, b in itertools.pairwise(each))
        return self._worst[key]

    def _legs(self, method: Method, leg: Leg, ends: Iterable[int]) -> Iterator[Leg]:
        """The legs from the end of one leg to each of these ends of frames."""
        for end in ends:
            run = quietly(self.scene.system, method, at=self.output_times[leg.end : end], max_steps=10**9, **leg.on)
            assert run.paces is not None
            leg = Leg(end, {"resume": run}, int(run.paces.evaluations) // method.attempt_evaluations)
            yield leg
            if run.status:
                break


class Leg(NamedTuple):
    """The position of a run after some frames: the arguments to go on with, and the steps attempted so far."""

    end: int
    on: dict[str, Any]
    tried: int
