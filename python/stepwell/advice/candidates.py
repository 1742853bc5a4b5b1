"""What is looked through: each method with fixed steps, and each that can estimate its error with steps of chosen length.

Both have a k that is the number of steps, or grows like it: it doubles where steps are halved, and the error falls with its power
that is the method's order. The search knows no more of them.
"""

from __future__ import annotations

import math
from typing import Protocol

from ..methods import Method
from .motion import Grid
from .paced import PacedTrials
from .trials import Trial, Trials

#: A k of so many is a tolerance of 1: there one k more makes steps 1.5 % shorter.
COARSEST = 64

#: No tolerance is smaller than this, in the scene's largest lengths: below it rounding is all.
LEAST_TOLERANCE = 1e-16


#: A run with a tolerance is not looked at everywhere, and asked at other times it is another run: this share of the error that is
#: allowed is all that it may have.
SHARE = 0.7


class Candidate(Protocol):
    """A method, and how its steps are chosen.

    Attributes:
        method: which.
        by: ``"step"`` or ``"tolerance"``.
        name: the method's, and that it goes by tolerance: ``"merson, tolerance"``.
        first: the least k.
        share: of the error that is allowed, what the run may have.
    """

    method: Method
    by: str
    name: str
    first: int
    share: float

    def look(self, k: int) -> Trial:
        """The run with that k."""

    def confirm(self, k: int) -> Trial:
        """The same, looked at closely."""

    def possible(self, k: int) -> bool:
        """Whether there is such a run."""

    def said(self, k: int) -> str:
        """What k stands for, in words."""


class Fixed:
    """Steps of one length: k of them in a span of the grid."""

    by = "step"
    share = 1.0

    def __init__(self, method: Method, trials: Trials, grid: Grid) -> None:
        self.method, self.name = method, method.name
        self.trials, self.grid, self.first = trials, grid, grid.first

    def look(self, k: int) -> Trial:
        """The run with that k."""
        return self.trials.look(self.method, self.grid.dt(k), self.grid.steps(k))

    def confirm(self, k: int) -> Trial:
        """The same run, at every step."""
        return self.trials.confirm(self.method, self.grid.dt(k), self.grid.steps(k))

    def possible(self, k: int) -> bool:
        """Whether a step still moves the time."""
        return self.grid.steps(k) < 2**52

    def said(self, k: int) -> str:
        """How many steps."""
        return f"{k} step{'s' * (k != 1)}{' a frame' * self.grid.framed}"


class Paced:
    """Steps chosen to a tolerance: it is the power of 1/k with which the method estimates its error."""

    by = "tolerance"
    share = SHARE

    def __init__(self, method: Method, trials: PacedTrials) -> None:
        assert method.error_order is not None
        self.method, self.name = method, f"{method.name}, tolerance"
        self.trials, self.power = trials, method.error_order
        scale = max(trials.scene.scales)
        self.least = LEAST_TOLERANCE * min(1.0, scale)
        # A single step may be wrong by the tolerance and by that share of the length; more than what is allowed is luck.
        most = min(1.0, trials.allowed * scale / (1.0 + scale))
        self.first = math.ceil(COARSEST * most ** (-1.0 / self.power))

    def tolerance(self, k: int) -> float:
        """The tolerance of that k, in two digits, so that what is told is what was run."""
        return float(f"{(COARSEST / k) ** self.power:.1e}")

    def look(self, k: int) -> Trial:
        """The run with that k."""
        return self.trials.look(self.method, self.tolerance(k))

    def confirm(self, k: int) -> Trial:
        """The same, at many more times."""
        return self.trials.confirm(self.method, self.tolerance(k))

    def possible(self, k: int) -> bool:
        """Whether the tolerance is above the rounding."""
        return self.tolerance(k) >= self.least

    def said(self, k: int) -> str:
        """The tolerance."""
        return f"a tolerance of {self.tolerance(k):g}"
