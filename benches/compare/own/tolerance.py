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

    A few members tell about where that is; then all do.
    """

    def missed(part: Any, tolerance: float) -> float:
        try:
            return float(part.error(*solve(part, tolerance)))
        except ArithmeticError:  # a step that was so long that an exponential overflowed
            return float("inf")

    least, place = 0.0, 0
    for part in (work.cut(members=TRIAL), work):
        least = max(part.expected, 1e-12)  # of a part of some few steps, rounding is all there is
        while place < len(TOLERANCES) and not missed(part, TOLERANCES[place]) <= least:
            place += 1
    if place == len(TOLERANCES):
        raise WrongResultError(f"no tolerance gives an error of {least:.1e}")
    return TOLERANCES[place]
