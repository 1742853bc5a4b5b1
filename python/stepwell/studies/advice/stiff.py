"""Why an implicit method is the cheapest: how short steps must be for explicit ones to be stable."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ...analysis.stability import function
from ...base.reprs import one_line
from ...errors import UnsupportedError
from ...model.methods import Method
from ...runs.findings.stiffness import STIFF, limit_of
from .predict import Rates


@dataclass(frozen=True)
class Stiff:
    """The stability limit of explicit methods where a motion is stiff.

    Attributes:
        rate: size of the fastest rate along the true motion that does not grow, in 1 per unit of time.
        t: the time there.
        limit: the longest step of an explicit method that is stable there.
        method: the name of that method.
        ratio: the advised step, the mean of adaptive ones, over that limit.
    """

    __repr__ = one_line

    rate: float
    t: float
    limit: float
    method: str
    ratio: float

    def __str__(self) -> str:
        steps = f"explicit steps are stable up to dt = {self.limit:.3g} ({self.method})"
        return (
            f"It is stiff: beside the fastest rate, 1/{1.0 / self.rate:.3g} at t = {self.t:.4g}, {steps}; "
            f"these steps are {float(f'{self.ratio:.2g}'):g} times as long."
        )


def stiff_of(best: Method, dt: float, rates: Rates | None, explicit: Iterable[Method]) -> Stiff | None:
    """Why an implicit method is the best with this step; None if it is not implicit, or not because of stability."""
    if not best.is_implicit or rates is None or (fastest := rates.fastest) is None:
        return None
    rate, t = fastest
    limits = [(limit_of(each, 0, rate), each.name) for each in explicit if _is_of_one_kind(each)]
    if not limits:
        return None
    limit, name = max(limits)
    if not dt >= STIFF * limit:
        return None
    return Stiff(abs(rate), t, limit, name, dt / limit if limit else float("inf"))


def _is_of_one_kind(method: Method) -> bool:
    """True if an explicit method treats v and y alike, so that a single rate says how long its steps may be."""
    if method.is_implicit:
        return False
    try:
        function(method)
    except UnsupportedError:
        return False
    return True
