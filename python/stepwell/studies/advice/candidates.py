"""The candidates of the search: each method with fixed steps, and each that can estimate its error with adaptive steps.

Both have a k that is the number of steps, or grows like it: it doubles where steps are halved, and the error falls like k to the
minus order of the method. The search knows no more about them.
"""

from __future__ import annotations

import math
from functools import cached_property

from ...model.methods import Method
from .adaptive import AdaptiveTrials
from .costs import single_name
from .motion import Grid
from .predict import keeps_margin, longest_step
from .trials import ASYMPTOTIC_ERROR, Trial, Trials

#: The k of the tolerance 1, at which k + 1 has steps that are 1.5 % shorter.
UNIT_TOLERANCE_K = 64

#: No tolerance is smaller than this, since rounding is larger.
LEAST_TOLERANCE = 1e-16

#: Steps below the normal numbers of float32 have fewer digits.
LEAST_SINGLE_STEP = 2.0**-126

#: The first run with a tolerance may make this fraction of the evaluations of a run: where stability bounds the steps, a loose
#: tolerance costs as much as a tight one, and such runs of every method would use up the search.
FIRST_RUN_SHARE = 1 / 16

#: The error of a run with a tolerance is measured at many times, but not at every one: it may be at most this fraction of the
#: allowed error.
ERROR_SHARE = 0.95


class Fixed:
    """Steps of one length: k of them in a span of the grid.

    As for all candidates, ``first`` is the least k, ``share`` the fraction of the allowed error that its runs may have, and
    ``seen`` are its runs so far, by k.
    """

    by = "step"
    dtype = "float64"

    def __init__(self, method: Method, trials: Trials, grid: Grid, share: float) -> None:
        self.method, self.name, self.share = method, method.name, share
        self.trials, self.grid, self.first = trials, grid, grid.first
        self.seen: dict[int, Trial] = {}

    @cached_property
    def evaluations(self) -> int:
        """Function evaluations of a step."""
        return self.trials.evaluations(self.method)

    def look(self, k: int) -> Trial:
        """The run with that k."""
        self.seen[k] = trial = self.trials.look(self.method, self.grid.dt(k), self.grid.steps(k))
        return trial

    def confirm(self, k: int) -> Trial:
        """The run with that k, compared at every step."""
        return self.trials.confirm(self.method, self.grid.dt(k), self.grid.steps(k))

    measured = confirm

    def within_limit(self, k: int) -> int:
        """This k, or the least larger one with which a linear system does not blow up, nor with somewhat longer steps."""
        return max(k, math.ceil(self.grid.span / longest_step(self.trials, self.method)))

    def keeps_margin(self, k: int) -> bool:
        """True if runs with somewhat longer steps do not blow up."""
        return keeps_margin(self.trials, self.method, self.grid.dt(k))

    def possible(self, k: int) -> bool:
        """True if a step still moves the time."""
        return self.grid.steps(k) < 2**52

    def described(self, k: int) -> str:
        """How many steps."""
        return f"{k} step{'s' * (k != 1)}{' a frame' * self.grid.framed}"


class Single(Fixed):
    """Steps of one length in float32; ``wide`` are the runs with the same steps in float64.

    Shorter steps do not help where rounding alone is above the allowed error, so the search ends there. A run may have this
    ``share`` of it.
    """

    dtype = "float32"

    def __init__(self, method: Method, trials: Trials, grid: Grid, share: float, wide: Trials, allowed: float) -> None:
        super().__init__(method, trials, grid, share)
        self.name, self.wide, self.allowed = single_name(method), wide, allowed

    def possible(self, k: int) -> bool:
        """True if the step is a normal number of float32, and rounding was not too large already with fewer steps."""
        before = max((n for n in self.seen if n < k), default=None)
        return super().possible(k) and self.grid.dt(k) >= LEAST_SINGLE_STEP and (before is None or not self.is_rounding(before))

    def is_rounding(self, k: int) -> bool:
        """True if rounding alone makes the error of the run with that k too large.

        The states of the two precisions differ by rounding only, and by at least as much as their errors do.
        """
        error = self.seen[k].error
        if not self.allowed < error < ASYMPTOTIC_ERROR:
            return False
        return error - self.in_float64(self.seen[k]) > self.allowed

    def in_float64(self, trial: Trial) -> float:
        """The error of the same steps in float64."""
        return self.wide.confirm(self.method, trial.dt, trial.steps).error


class Adaptive:
    """Steps chosen to a tolerance: it is the power of 1/k with which the method estimates its error."""

    by = "tolerance"
    dtype = "float64"
    share = ERROR_SHARE

    def __init__(self, method: Method, trials: AdaptiveTrials) -> None:
        assert method.error_order is not None
        self.method, self.name = method, f"{method.name}, tolerance"
        self.trials, self.power = trials, method.error_order
        self.seen: dict[int, Trial] = {}
        # A single step may be wrong by the tolerance; with a tolerance above the allowed error, a run is good enough by luck.
        self.first = math.ceil(UNIT_TOLERANCE_K * min(1.0, trials.allowed) ** (-1.0 / self.power))

    @property
    def evaluations(self) -> int:
        """Function evaluations of an attempt at a step."""
        return self.method.attempt_evaluations

    def tolerance(self, k: int) -> float:
        """The tolerance of that k, in two digits, so that the tolerance shown is the one that was run."""
        return float(f"{(UNIT_TOLERANCE_K / k) ** self.power:.1e}")

    def look(self, k: int) -> Trial:
        """The run with that k."""
        share = FIRST_RUN_SHARE if k == self.first else 1.0
        self.seen[k] = trial = self.trials.look(self.method, self.tolerance(k), share)
        return trial

    def confirm(self, k: int) -> Trial:
        """The run with that k, compared at many more times."""
        return self.trials.confirm(self.method, self.tolerance(k))

    def measured(self, k: int) -> Trial:
        """The run with that k, measured as by ``confirm``; it need not be good enough."""
        return self.trials.measured(self.method, self.tolerance(k))

    def within_limit(self, k: int) -> int:
        """Steps that blow up are rejected."""
        return k

    def keeps_margin(self, k: int) -> bool:
        """Steps that blow up are rejected."""
        return True

    def possible(self, k: int) -> bool:
        """True if the tolerance is above the rounding."""
        return self.tolerance(k) >= LEAST_TOLERANCE

    def described(self, k: int) -> str:
        """The tolerance."""
        return f"a tolerance of {self.tolerance(k):g}"


#: A method, and how its steps are chosen.
Candidate = Fixed | Adaptive
