"""The search: for each method the fewest steps whose run is good enough, from coarse to fine, the cheapest first.

Errors do not fall evenly with the step: they dip where parts cancel, and rise at resonances. So nothing is chosen that was not
run. The order of a method only says where looking is no use.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ..methods import Method
from .trials import Grid, Trial, Trials

#: No run makes more rate evaluations than this, for it would take too long; a system of more than eight numbers, fewer.
MOST = 16_000_000

#: A method that costs more than this many times the cheapest is not looked at any further.
DOMINATED = 10.0

#: Rungs of the fine ladder in a factor of two: 9 % between one and the next.
RUNGS = 8

#: Where an error misses the tolerance by less than the factor NEAR, FEW more numbers of steps are tried before the next rung;
#: where it is by the factor RISES above that of fewer steps, and that missed by less than the factor FAR, MANY.
NEAR, FEW, RISES, FAR, MANY = 2.5, 6, 1.3, 8.0, 8

#: An error below this is taken to fall with the order of the method at most; above it a run may be wrong in other ways.
FALLS = 0.3

#: But what the order tells is off by up to this factor in steps.
DOUBT = 3.0


class Found(NamedTuple):
    """The fewest steps of a method that are good enough.

    Attributes:
        k: how many in a span of the grid.
        trial: the confirming run.
        robust: from here on all numbers of steps that were tried, up to twice as many, are good enough too; k itself as a rule,
            and None if there is no such number.
        expected: error that the order tells from a run with a longer step, or None.
    """

    k: int
    trial: Trial
    robust: int | None
    expected: float | None


class Missed(NamedTuple):
    """Why a method was given up: ``unstable``, ``inaccurate`` or ``dominated``.

    Attributes:
        kind: which.
        k: the most steps in a span that were run.
        trial: that run.
        expected: steps in a span that the order says it takes, or None.
        dear: whether more steps were not tried because they cost too much, beside the best.
    """

    kind: str
    k: int
    trial: Trial
    expected: int | None
    dear: bool = False


class Search:
    """The search of one scene and one tolerance."""

    def __init__(self, trials: Trials, grid: Grid, tolerance: float, prices: Mapping[str, float]) -> None:
        self.trials, self.grid, self.tolerance = trials, grid, tolerance
        #: What a step costs, by method.
        self.prices = prices
        self.most = MOST / max(1.0, trials.numbers / 8)

    def cost(self, method: Method, k: int) -> float:
        """Of a span."""
        return self.prices[method.name] * k

    def look(self, method: Method, k: int) -> Trial:
        """A run."""
        return self.trials.look(method, self.grid.dt(k), self.grid.steps(k))

    def good(self, method: Method, k: int) -> bool:
        """Whether a run is good enough."""
        return self.look(method, k).error <= self.tolerance

    def confirmed(self, method: Method, k: int) -> bool:
        """Whether it is so at every step."""
        if not self.good(method, k):
            return False
        return self.trials.confirm(method, self.grid.dt(k), self.grid.steps(k)).error <= self.tolerance

    def affordable(self, method: Method, k: int) -> bool:
        """Whether the run is short enough to be made."""
        return self.grid.steps(k) * method.evaluations <= self.most

    def run(self, methods: Sequence[Method]) -> tuple[dict[str, Found], dict[str, Missed]]:
        """What was found, and what was given up, by method."""
        octaves, missed = self.octaves(methods)
        by_name = {method.name: method for method in methods}
        found: dict[str, Found] = {}
        best = math.inf
        for name in sorted(octaves, key=lambda name: self.cost(by_name[name], octaves[name])):
            method, k = by_name[name], octaves[name]
            if self.cost(method, k) > 2.0 * DOMINATED * best:
                missed[name] = Missed("dominated", k, self.look(method, k), None)
                continue
            # Two octaves back if that might be the cheapest of all, for a dip may hide there; else the one it must be in.
            # One that cannot be the cheapest is halved, as if errors were even.
            runner_up = self.cost(method, k) > 4.0 * best
            least = (
                self.halved(method, k) if runner_up else self.finest(method, k, 4 if self.cost(method, k) <= 3.0 * best else 2)
            )
            if least is None:
                missed[name] = Missed("inaccurate", k, self.look(method, k), None)
                continue
            best = min(best, self.cost(method, least))
            found[name] = Found(least, self.trials.confirm(method, self.grid.dt(least), self.grid.steps(least)), least, None)
        for name in list(found):
            method, k = by_name[name], found[name].k
            if self.cost(method, k) > DOMINATED * best:
                missed[name] = Missed("dominated", k, found.pop(name).trial, None)
            else:
                found[name] = found[name]._replace(robust=self.robust(method, k), expected=self.expected(method, k))
        return found, missed

    def octaves(self, methods: Sequence[Method]) -> tuple[dict[str, int], dict[str, Missed]]:
        """For each method the first k in a ladder of doublings that is good enough; the cheapest run is always made next."""
        found: dict[str, int] = {}
        missed: dict[str, Missed] = {}
        best = math.inf
        waiting = [(self.cost(method, self.grid.first), i, self.grid.first) for i, method in enumerate(methods)]
        heapq.heapify(waiting)
        while waiting:
            cost, i, k = heapq.heappop(waiting)
            method = methods[i]
            trial = self.look(method, k)
            if trial.error <= self.tolerance:
                found[method.name] = k
                best = min(best, cost)
                continue
            wanted = self.wanted(method, k, trial)
            least = max(2.0 * k, (wanted or 0) / DOUBT)
            if self.grid.spans * least * method.evaluations > self.most:
                missed[method.name] = Missed("unstable" if trial.unstable else "inaccurate", k, trial, wanted)
            elif self.prices[method.name] * least > DOMINATED * best:
                missed[method.name] = Missed("unstable" if trial.unstable else "dominated", k, trial, wanted, dear=True)
            else:
                heapq.heappush(waiting, (self.cost(method, 2 * k), i, 2 * k))
        return found, missed

    def wanted(self, method: Method, k: int, trial: Trial) -> int | None:
        """The k that the order of the method asks for, if the error is small enough to tell."""
        if not trial.error < FALLS:
            return None
        return math.ceil(k * min(1e12, float((trial.error / self.tolerance) ** (1.0 / method.order))))

    def finest(self, method: Method, k: int, back: int) -> int | None:
        """The least k that is good enough, from the last doubling that was not, or the one before it, to a little more than k."""
        low = max(self.grid.first, k // back)
        failed = 0
        for rung in self.closer(method, rungs(low, 4 * k)):
            if not self.affordable(method, rung):
                return None
            if self.good(method, rung):
                least = self.between(method, failed, rung) if failed else rung
                for chosen in (least, rung):
                    if self.confirmed(method, chosen):
                        return chosen
            failed = rung
        return None

    def closer(self, method: Method, ladder: list[int]) -> Iterator[int]:
        """The ladder, with rungs between where the next may be good enough by chance.

        That is where an error just misses, and where errors rise with more steps: of a chaotic motion they are a lottery.
        """
        least = math.inf
        for rung, following in zip(ladder, [*ladder[1:], ladder[-1]], strict=True):
            yield rung
            error = self.look(method, rung).error
            ragged = RISES * least < error and least <= FAR * self.tolerance
            least = min(least, error)
            if ragged or error <= NEAR * self.tolerance:
                yield from range(rung + 1, following, max(1, (following - rung) // (MANY if ragged else FEW)))

    def halved(self, method: Method, k: int) -> int | None:
        """A k in the last doubling that is good enough and nearly the least."""
        least = k if k == self.grid.first else self.between(method, k // 2, k)
        for n in (least, k):
            if self.confirmed(method, n):
                return n
        return self.finest(method, k, 1)

    def between(self, method: Method, low: int, high: int) -> int:
        """A k above ``low``, which is not good enough, up to ``high``, which is: halved thrice."""
        for _ in range(3):
            middle = (low + high) // 2
            if middle in (low, high):
                break
            low, high = (low, middle) if self.good(method, middle) else (middle, high)
        return high

    def robust(self, method: Method, k: int) -> int | None:
        """From where on a few more steps are good enough too."""
        above = [rung for rung in rungs(k, 2 * k) if rung > k and self.affordable(method, rung)]
        near = sorted({k + 1, *above[:2]})
        if all(self.good(method, n) for n in near if self.affordable(method, n)):
            return k
        bad = [rung for rung in sorted({k + 1, *above}) if not self.good(method, rung)]
        return next((rung for rung in above if rung > bad[-1]), None)

    def expected(self, method: Method, k: int) -> float | None:
        """The error that the order tells from the finest doubling below k whose error falls."""
        rung = self.grid.first
        while 2 * rung < k:
            rung *= 2
        if rung >= k:
            return None
        error = self.look(method, rung).error
        return error * (rung / k) ** method.order if error < FALLS else None


def rungs(low: int, high: int) -> list[int]:
    """Whole numbers from ``low`` to ``high``, 9 % apart or by one; the same ones for every method."""
    start, end = math.floor(RUNGS * math.log2(low)), math.ceil(RUNGS * math.log2(high))
    return sorted({n for j in range(start, end + 1) if low <= (n := round(float(2.0 ** (j / RUNGS)))) <= high})
