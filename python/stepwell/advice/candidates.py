"""The candidates of the search: each method with fixed steps, and each that can estimate its error with adaptive steps.

Both have a k that is the number of steps, or grows like it: it doubles where steps are halved, and the error falls with its power
that is the method's order. The search knows no more of them.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Protocol

from ..methods import Method
from .adaptive import AdaptiveTrials
from .motion import Grid
from .trials import Trial, Trials

#: The k that stands for a tolerance of 1; one more makes steps 1.5 % shorter there.
UNIT_TOLERANCE_K = 64

#: No tolerance is smaller than this: below it rounding is all.
LEAST_TOLERANCE = 1e-16


#: The error of a run with a tolerance is measured at many times, but not at every one: it may be at most this share of
#: what is allowed.
ERROR_SHARE = 0.95


class Candidate(Protocol):
    """A method, and how its steps are chosen.

    Attributes:
        method: the method.
        by: ``"step"`` or ``"tolerance"``.
        name: the method's name, followed by "tolerance" for adaptive steps: ``"merson, tolerance"``.
        first: the least k.
        share: of the error that is allowed, what the run may have.
        seen: the runs that were made, by k.
    """

    method: Method
    by: str
    name: str
    first: int
    share: float
    seen: dict[int, Trial]

    @property
    def evaluations(self) -> int:
        """Function evaluations of a step, or of an attempt at one."""

    def look(self, k: int) -> Trial:
        """The run with that k."""

    def confirm(self, k: int) -> Trial:
        """The same, measured more closely."""

    def possible(self, k: int) -> bool:
        """Whether there is such a run."""

    def said(self, k: int) -> str:
        """What k stands for, in words."""


class Fixed:
    """Steps of one length: k of them in a span of the grid."""

    by = "step"

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
        """The same run, at every step."""
        return self.trials.confirm(self.method, self.grid.dt(k), self.grid.steps(k))

    def possible(self, k: int) -> bool:
        """Whether a step still moves the time."""
        return self.grid.steps(k) < 2**52

    def said(self, k: int) -> str:
        """How many steps."""
        return f"{k} step{'s' * (k != 1)}{' a frame' * self.grid.framed}"


class Adaptive:
    """Steps chosen to a tolerance: it is the power of 1/k with which the method estimates its error."""

    by = "tolerance"
    share = ERROR_SHARE

    def __init__(self, method: Method, trials: AdaptiveTrials) -> None:
        assert method.error_order is not None
        self.method, self.name = method, f"{method.name}, tolerance"
        self.trials, self.power = trials, method.error_order
        self.seen: dict[int, Trial] = {}
        # A single step may be wrong by the tolerance; more than what is allowed is luck.
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
        self.seen[k] = trial = self.trials.look(self.method, self.tolerance(k))
        return trial

    def confirm(self, k: int) -> Trial:
        """The same, at many more times."""
        return self.trials.confirm(self.method, self.tolerance(k))

    def possible(self, k: int) -> bool:
        """Whether the tolerance is above the rounding."""
        return self.tolerance(k) >= LEAST_TOLERANCE

    def said(self, k: int) -> str:
        """The tolerance."""
        return f"a tolerance of {self.tolerance(k):g}"
