"""For those that choose their own steps: the coarsest tolerance that makes them as exact as Runge-Kutta 4 with its step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..peers import WrongResultError

#: From coarse to fine, three in a decade.
TOLERANCES = tuple(10.0 ** (-k / 3) for k in range(6, 43))
#: Members that it is looked for with.
TRIAL = 32


def as_exact(work: Any, solve: Callable[[Any, float], Any]) -> float:
    """The coarsest tolerance by which ``solve(work, tolerance)`` misses no more than the work's method is expected to.

    A few members tell; all of them may still miss twice as much before they are turned away.
    """
    part = work.cut(members=TRIAL)
    least = max(part.expected, 1e-12)  # of a part of some few steps, rounding is all there is
    for tolerance in TOLERANCES:
        if part.error(*solve(part, tolerance)) <= least:
            return tolerance
    raise WrongResultError(f"no tolerance gives an error of {least:.1e}")
