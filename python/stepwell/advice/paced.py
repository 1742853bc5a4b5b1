"""Trial runs of a scene with steps of chosen length: how wrong a method is with a tolerance, and how many steps it tries.

Such a run shows its state at the times that it is asked for, and each of these ends a step. Asked at two thousand times it
would be another run. So what lies between is asked for a few times at once, in many runs, each nearly the one that is judged.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .._checks import Array
from ..errors import ToleranceWarning
from ..integrate import integrate
from ..methods import Method
from ..result import Run
from .motion import Motion, looked_up
from .trials import Trial

#: Beside the times that it is asked for anyway, a run is asked for its state at so many, or at these shares of its steps.
#: Each ends a step, and steps that are not the method's own choice may make a run three times as wrong, most of all where there
#: are half as many of them as of others.
LEAST, SHARES = 4, (0.1, 0.25, 0.6)

#: So many runs look between at first, and so many at most to confirm.
LOOKS, CONFIRMS = 4, 100

#: The first step that is tried, as a share of the time: that of ``integrate``.
FIRST = 1e-3

#: The steps in each frame are counted by going from frame to frame, or, of more frames than this, over so many pieces and then
#: through so many of the pieces with the most steps.
PIECES, WORST = 2000, 20


class PacedTrials:
    """Runs of one scene with a tolerance, each made once.

    Args:
        motion: what runs are compared with.
        allowed: the state error that is allowed; of a run with a larger one no more is asked than that it is larger.
        most: rate evaluations that a run may make.
    """

    def __init__(self, motion: Motion, allowed: float, most: float) -> None:
        scene = motion.scene
        assert scene.exact is not None
        self.grid, self.allowed, self.most = motion.grid, allowed, most
        self.asked = motion.grid.asked
        self.marks = np.setdiff1d(motion.marks[1:], self.asked)
        self.scene = replace(scene, exact=looked_up(scene.exact, np.union1d(self.asked, self.marks)))
        self._runs: dict[tuple[str, float], Trial] = {}
        self._trials: dict[tuple[str, float, int], Trial] = {}
        self._worst: dict[tuple[str, float], int] = {}
        #: Times at which a run was not good enough between those that it is asked for, by method.
        self._bad: dict[str, list[float]] = {}
        self.made = 0

    def look(self, method: Method, tolerance: float) -> Trial:
        """The run, and a few that look between."""
        return self._looked(method, tolerance, LOOKS)

    def confirm(self, method: Method, tolerance: float) -> Trial:
        """The run, and many that look between: at all marks, if it has a fifth as many steps or more."""
        return self._looked(method, tolerance, CONFIRMS)

    def _looked(self, method: Method, tolerance: float, runs: int) -> Trial:
        key = (method.name, tolerance, runs)
        if key not in self._trials:
            trial = self._run(method, tolerance)
            for comb in self._combs(trial, method, runs):
                if not trial.error <= self.allowed:
                    break
                run = self._integrated(method, tolerance, np.union1d(self.asked, comb))
                errors = self.scene.state_error(run)
                if errors.max() > self.allowed:
                    self._bad.setdefault(method.name, []).append(float(run.t[errors.argmax()]))
                trial = trial._replace(error=max(trial.error, float(errors.max())))
            self._trials[key] = trial
        return self._trials[key]

    def _combs(self, trial: Trial, method: Method, runs: int) -> Iterator[Array]:
        """Times between, so many or fewer sets of them; first those that were bad before."""
        if method.name in self._bad:
            yield np.unique(self._bad[method.name][-LEAST:])
        # What takes long is done less often.
        runs = min(runs, max(LOOKS, int(0.25 * self.most / (trial.steps * method.evaluations))))
        # Many times at once find what is short and what they do to the run, few leave it as it is.
        for times in dict.fromkeys(max(LEAST, round(share * trial.steps)) for share in (*SHARES, 0.0)):
            number = max(1, math.ceil(len(self.marks) / times))
            part = min(math.ceil(runs / (1 + len(SHARES))), number)
            for first in np.unique(np.linspace(0, number, part, endpoint=False).astype(int)):
                yield self.marks[first::number]

    def _run(self, method: Method, tolerance: float) -> Trial:
        """The run that is judged, as wrong as it is where it is asked for its state."""
        key = (method.name, tolerance)
        if key not in self._runs:
            run = self._integrated(method, tolerance, self.asked)
            assert run.paces is not None
            steps = int(run.paces.accepted + run.paces.rejected)
            stopped = bool(run.status)
            error = math.inf if stopped else float(self.scene.state_error(run).max())
            self._runs[key] = Trial(self.grid.end / steps, steps, error, stopped, int(run.paces.rejected))
        return self._runs[key]

    def _integrated(self, method: Method, tolerance: float, at: Array) -> Run:
        self.made += 1
        scene, most = self.scene, max(1, int(self.most / method.evaluations))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToleranceWarning)
            return integrate(scene.system, method, v=scene.v, y=scene.y, tolerance=tolerance, at=at, max_steps=most)

    def worst(self, method: Method, tolerance: float) -> int:
        """The most steps that are tried in a frame, going from one to the next as a game does."""
        key = (method.name, tolerance)
        if key not in self._worst:
            number = len(self.asked)
            start = Leg(0, self.scene.v, self.scene.y, FIRST * self.grid.end, 0)
            ends = np.unique(np.linspace(0, number, min(number, PIECES) + 1).astype(int))[1:].tolist()
            legs = [start, *self._legs(method, tolerance, start, ends)]
            if len(ends) < number:
                pairs = sorted(itertools.pairwise(legs), key=lambda pair: -pair[1].tried)[:WORST]
                legs = [each for a, b in pairs for each in self._legs(method, tolerance, a, range(a.end + 1, b.end + 1))]
            self._worst[key] = max(leg.tried for leg in legs)
        return self._worst[key]

    def _legs(self, method: Method, tolerance: float, leg: Leg, ends: Iterable[int]) -> Iterator[Leg]:
        """From where a leg ended to the end of one frame after the other, or of several at once."""
        for end in ends:
            t0, at = self.grid.span * leg.end, self.asked[leg.end : end]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ToleranceWarning)
                run = integrate(
                    self.scene.system, method, v=leg.v, y=leg.y, t0=t0, tolerance=tolerance, at=at, dt=leg.h, max_steps=10**9
                )
            assert run.paces is not None
            leg = Leg(end, run.v[-1], run.y[-1], float(run.paces.h), int(run.paces.accepted + run.paces.rejected))
            yield leg
            if run.status:
                break


class Leg(NamedTuple):
    """Where a run is after so many frames, the step that it would try next, and the steps tried since the leg before."""

    end: int
    v: Array
    y: Array
    h: float
    tried: int
