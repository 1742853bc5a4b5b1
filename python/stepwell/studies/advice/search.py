"""The search: for each candidate the fewest steps whose run is good enough, from coarse to fine, the cheapest first.

Errors do not fall evenly with the step: they dip where parts cancel, and rise at resonances. So nothing is chosen that was not
run. The order of a method only says where looking is no use.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from .candidates import Candidate
from .trials import ASYMPTOTIC_ERROR, Trial

#: The most function (rate) evaluations of a run, so that it does not take too long; for a system of n > 8 numbers they are
#: divided by (n/8) to this exponent.
MAX_EVALUATIONS, SIZE_EXPONENT = 16_000_000, 1.5

#: All runs of a search together make at most about TOTAL_BUDGET times MAX_EVALUATIONS: each may make this fraction of the rest.
TOTAL_BUDGET, RUN_SHARE = 4.0, 0.5

#: A candidate that costs more than this many times the cheapest is given up.
MAX_COST_RATIO = 10.0

#: Rungs of the fine ladder (a geometric grid of numbers of steps) in a factor of two: 9 % from one to the next.
RUNGS_PER_OCTAVE = 8

#: Between two rungs more numbers of steps are tried, evenly spaced: DENSE_POINTS where the error is above the tolerance by less
#: than the factor DENSE_ERROR_RATIO.
DENSE_ERROR_RATIO, DENSE_POINTS = 2.5, 6

#: And IRREGULAR_POINTS where errors do not fall with the number of steps: where an error is IRREGULAR_RISE times that of fewer
#: steps, and the latter is less than IRREGULAR_ERROR_RATIO times the tolerance. The first of these numbers, or more, up to the
#: second, if all of them together make no more than the share IRREGULAR_SHARE of the evaluations that one run may make.
IRREGULAR_RISE, IRREGULAR_ERROR_RATIO, IRREGULAR_POINTS, IRREGULAR_SHARE = 1.3, 8.0, (6, 24), 1 / 128

#: The number of halvings of the interval in the search for a local minimum of the error.
MINIMUM_HALVINGS = 8

#: Errors are regular where, below REGULAR_ERROR, they fall over two doublings by powers that differ by at most ORDER_SPREAD and
#: are at least the order minus ORDER_DEFICIT. Then the search begins at the fraction REGULAR_START of the steps that the power
#: predicts, if a run makes more than the fraction LONG_RUN_SHARE of the evaluations that it may make.
REGULAR_ERROR, ORDER_SPREAD, ORDER_DEFICIT, REGULAR_START, LONG_RUN_SHARE = 0.02, 1.0, 1.3, 0.75, 1 / 256

#: Where a run makes more than this fraction of the evaluations that it may make, the search only halves the last doubling,
#: ``HALVINGS`` times, or once where that cannot make it the cheapest.
HALVED_RUN_SHARE, HALVINGS = 1 / 12, 3

#: Once a candidate is good enough, a more expensive run may make at most this fraction of the evaluations that a run may make.
LATER_RUN_SHARE = 1 / 4

#: The number of steps that the order predicts is wrong by up to this factor.
PREDICTION_FACTOR = 3.0


#: The factor by which k grows after a run with a tolerance that stopped early.
STOPPED_LEAP = 4


class Fewest(NamedTuple):
    """The fewest steps of a candidate that are good enough.

    Attributes:
        k: the candidate's k.
        trial: the confirming run.
        robust: the k from which on every k that was tried, up to twice as large, is good enough too; usually k itself, and None
            if there is no such k.
        expected: the error extrapolated by the order from a run with longer steps, or None.
    """

    k: int
    trial: Trial
    robust: int | None
    expected: float | None


class Missed(NamedTuple):
    """Why a candidate was given up: ``unstable``, ``inaccurate`` or ``dominated``; the largest k that was run, and its run.

    ``expected`` is the k that would be needed according to the order, or None; ``expensive`` says whether more steps were not
    tried because they cost too much compared with the best.
    """

    kind: str
    k: int
    trial: Trial
    expected: int | None
    expensive: bool = False


class Search:
    """The search of one scene and one tolerance.

    Args:
        tolerance: the allowed error.
        spans: the number of spans in a run; costs are those of one span.
        prices: the cost of a step, by the candidate's name.
        longest: the most function evaluations of a run.
        spent: returns the number of function evaluations of all runs so far.
        short: the most function evaluations of a run where only short ones are worth it.
        progress: called with the share of the candidates that are searched.
    """

    def __init__(
        self,
        tolerance: float,
        spans: int,
        prices: Mapping[str, float],
        longest: float,
        spent: Callable[[], float] = lambda: 0.0,
        short: float = math.inf,
        progress: Callable[[float], object] = lambda share: None,
    ) -> None:
        self.tolerance, self.spans, self.prices, self.longest, self.spent = tolerance, spans, prices, longest, spent
        self.short = short
        self.progress = progress

    @property
    def most(self) -> float:
        """Rate evaluations that the next run may make."""
        return min(self.short, self.longest, RUN_SHARE * max(0.0, TOTAL_BUDGET * self.longest - self.spent()))

    def cost(self, candidate: Candidate, k: int) -> float:
        """The cost of a span in the run with this k."""
        return self.prices[candidate.name] * candidate.look(k).steps / self.spans

    def allowed(self, candidate: Candidate) -> float:
        """The error that the candidate's runs may have."""
        return self.tolerance * candidate.share

    def good(self, candidate: Candidate, k: int) -> bool:
        """True if a run is good enough."""
        return candidate.look(k).error <= self.allowed(candidate)

    def confirmed(self, candidate: Candidate, k: int) -> bool:
        """True if the run is good enough at every step."""
        return self.good(candidate, k) and candidate.confirm(k).error <= self.allowed(candidate)

    def affordable(self, candidate: Candidate, k: int, known: int) -> bool:
        """True if the run is short enough to be tried, judged by the run with ``known``."""
        trial = candidate.look(known)
        return candidate.possible(k) and trial.steps * candidate.evaluations * (k / known) <= self.most

    def run(
        self,
        candidates: Sequence[Candidate],
        ceilings: Mapping[str, float] = MappingProxyType({}),
        hints: Mapping[str, Collection[int]] = MappingProxyType({}),
    ) -> tuple[dict[str, Fewest], dict[str, Missed]]:
        """The fewest steps of each candidate that is good enough, and why the others were given up, by the candidate's name.

        ``ceilings`` are the most steps in a span, if limited, ``hints`` are k that may be good enough.
        """
        octaves, missed = self.octaves(candidates, ceilings)
        by_name = {candidate.name: candidate for candidate in candidates}
        fewest: dict[str, Fewest] = {}
        best = math.inf
        for name in missed.keys() & hints.keys():
            hinted = self.least(by_name[name], None, hints[name])
            if hinted is not None:
                del missed[name]
                fewest[name] = Fewest(hinted, by_name[name].confirm(hinted), hinted, None)
                best = min(best, self.cost(by_name[name], hinted))
        for number, name in enumerate(sorted(octaves, key=lambda name: self.cost(by_name[name], octaves[name]))):
            self.progress(0.5 + 0.5 * number / len(octaves))
            candidate, k = by_name[name], octaves[name]
            cost = self.cost(candidate, k)
            if cost > 2.0 * MAX_COST_RATIO * best:
                missed[name] = Missed("dominated", k, candidate.look(k), None)
                continue
            # A candidate that might be the cheapest of all is searched three octaves back, since a dip may hide there. One that
            # cannot be, or whose runs are very long, is halved as if errors fell evenly.
            least = (
                self.halved(candidate, k, best)
                if cost > 4.0 * best or self.very_long(candidate, k)
                else self.finest(candidate, k, 8)
            )
            if least is None and self.confirmed(candidate, k):
                least = k  # a finer search would take too long
            least = self.least(candidate, least, hints.get(name, ()))
            if least is None:
                missed[name] = Missed("inaccurate", k, candidate.look(k), None)
                continue
            best = min(best, self.cost(candidate, least))
            fewest[name] = Fewest(least, candidate.confirm(least), least, None)
        for name in list(fewest):
            candidate, k = by_name[name], fewest[name].k
            if self.cost(candidate, k) > MAX_COST_RATIO * best:
                missed[name] = Missed("dominated", k, fewest.pop(name).trial, None)
            else:
                fewest[name] = fewest[name]._replace(robust=self.robust(candidate, k), expected=self.expected(candidate, k))
        return fewest, missed

    def least(self, candidate: Candidate, k: int | None, hints: Collection[int]) -> int | None:
        """The cheapest k that is good enough, of this one and the hints; or the next one with a margin to blowing up."""
        good = [n for n in hints if self.confirmed(candidate, n)]
        good += [k] if k is not None else []
        least = min(good, key=lambda n: self.cost(candidate, n), default=None)
        if least is None:
            return None
        begin = candidate.within_limit(least)
        for n in sorted({begin, *rungs(begin, 2 * begin)}):
            if n > least and not self.affordable(candidate, n, least):
                return None
            if self.confirmed(candidate, n) and candidate.keeps_margin(n):
                return n
        return None

    def octaves(self, candidates: Sequence[Candidate], ceilings: Mapping[str, float]) -> tuple[dict[str, int], dict[str, Missed]]:
        """For each candidate the first k in a ladder of doublings that is good enough; the cheapest run is always made next."""
        first: dict[str, int] = {}
        missed: dict[str, Missed] = {}
        best = math.inf
        waiting = [(self.prices[each.name] * each.first, i, each.first) for i, each in enumerate(candidates)]
        heapq.heapify(waiting)
        while waiting:
            self.progress(0.5 - 0.5 * len(waiting) / len(candidates))
            _, i, k = heapq.heappop(waiting)
            candidate = candidates[i]
            trial, cost = candidate.look(k), self.cost(candidate, k)
            if self.good(candidate, k):
                first[candidate.name] = k
                best = min(best, cost)
                continue
            wanted = self.wanted(candidate, k, trial)
            # With the k predicted for a long run that was stopped, the run is good enough up to that point.
            needed = wanted or (self.ordered(candidate, k, trial.before) if trial.stopped else 0)
            least = max(2.0, needed / k / PREDICTION_FACTOR)
            kind = "unstable" if trial.unstable else "inaccurate"
            # The cost of a run with a tolerance that stopped early says nothing about one that does not.
            stopped = trial.unstable and candidate.by == "tolerance"
            following = STOPPED_LEAP * k if stopped else 2 * k
            evaluations, ceiling = trial.steps * candidate.evaluations, ceilings.get(candidate.name, math.inf)
            most = self.most if cost * least <= best else min(self.most, LATER_RUN_SHARE * self.longest)
            if not candidate.possible(following) or evaluations * least > most or trial.steps / self.spans * least > ceiling:
                missed[candidate.name] = Missed(kind, k, trial, wanted)
            elif cost * least > MAX_COST_RATIO * best and not stopped:
                missed[candidate.name] = Missed("unstable" if trial.unstable else "dominated", k, trial, wanted, expensive=True)
            else:
                # Among equally expensive candidates the one that came further goes first.
                heapq.heappush(waiting, (2.0 * cost / trial.share, i, following))
        return first, missed

    def wanted(self, candidate: Candidate, k: int, trial: Trial) -> int | None:
        """The k predicted by the order of the method, if the error is small enough for a prediction."""
        return self.ordered(candidate, k, trial.error) if trial.error < ASYMPTOTIC_ERROR else None

    def ordered(self, candidate: Candidate, k: int, error: float) -> int:
        """The k that is good enough if the error falls by the order of the method from that of this k."""
        return math.ceil(k * min(1e12, float((error / self.allowed(candidate)) ** (1.0 / candidate.method.order))))

    def finest(self, candidate: Candidate, k: int, back: int) -> int | None:
        """The least k that is good enough, searched from ``back`` times less than a good one to a little more."""
        regular = self.regular(candidate, k)
        low = max(candidate.first, k // back, regular)
        failed, ladder = 0, rungs(low, 4 * k)
        for rung in ladder if regular else self.denser(candidate, ladder):
            if not self.affordable(candidate, rung, failed or low):
                return None
            if self.good(candidate, rung):
                least = self.between(candidate, failed, rung) if 0 < failed < rung else rung
                for chosen in (least, rung):
                    if self.confirmed(candidate, chosen):
                        return chosen
            failed = rung
        return None

    def regular(self, candidate: Candidate, k: int) -> int:
        """Where the search may begin, if errors fall by one power over the two doublings up to k; 0 if they do not.

        It is 0 where runs are short, too: errors that fall regularly at the doublings may still have minima between them.
        """
        if k < 4 * candidate.first or candidate.look(k).steps * candidate.evaluations < LONG_RUN_SHARE * self.longest:
            return 0
        first, second, third = (candidate.look(n).error for n in (k // 4, k // 2, k))
        allowed = self.allowed(candidate)
        if not REGULAR_ERROR > first > second > allowed >= third > 0.0:
            return 0
        powers = math.log2(first / second), math.log2(second / third)
        if abs(powers[0] - powers[1]) > ORDER_SPREAD or min(powers) < candidate.method.order - ORDER_DEFICIT:
            return 0
        return int(REGULAR_START * k / 2 * 2.0 ** (math.log2(second / allowed) / powers[1]))

    def denser(self, candidate: Candidate, ladder: list[int]) -> Iterator[int]:
        """The ladder, with more k where one of them may be good enough by chance.

        That is so where an error is just above the tolerance; where errors rise with more steps, since those of a chaotic motion
        are irregular; and at a local minimum, where an error may change its sign.
        """
        allowed = self.allowed(candidate)
        least, before, last = math.inf, (0, math.inf), (0, math.inf)
        for rung, following in zip(ladder, [*ladder[1:], ladder[-1]], strict=True):
            yield rung
            error = candidate.look(rung).error
            if (
                candidate.by == "step"
                and before[1] > last[1] <= IRREGULAR_ERROR_RATIO * allowed
                and error > IRREGULAR_RISE * last[1]
                and before[0]
            ):
                yield from self.minimum(candidate, before[0], last[0], rung)
            before, last = last, (rung, error)
            irregular = IRREGULAR_RISE * least < error and least <= IRREGULAR_ERROR_RATIO * allowed
            least = min(least, error)
            if irregular or error <= DENSE_ERROR_RATIO * allowed:
                yield from range(
                    rung + 1,
                    following,
                    max(1, (following - rung) // (self.dense_points(candidate, rung) if irregular else DENSE_POINTS)),
                )

    def minimum(self, candidate: Candidate, low: int, middle: int, high: int) -> Iterator[int]:
        """Successive k that approach the least error between two k, from one in between with a smaller error."""
        for _ in range(MINIMUM_HALVINGS):
            inner = sorted({(low + middle) // 2, (middle + high) // 2} - {low, middle, high})
            if not inner:
                return
            yield from inner
            ladder = sorted({low, middle, high, *inner})
            errors = [candidate.look(k).error for k in ladder]
            i = min(max(1, errors.index(min(errors))), len(ladder) - 2)
            low, middle, high = ladder[i - 1 : i + 2]

    def dense_points(self, candidate: Candidate, k: int) -> int:
        """The number of k that are tried between two rungs where errors are irregular: the more, the shorter the runs.

        It is the smallest for adaptive steps, since every tolerance makes other steps anyway.
        """
        if candidate.by == "tolerance":
            return IRREGULAR_POINTS[0]
        evaluations = candidate.look(k).steps * candidate.evaluations
        return max(IRREGULAR_POINTS[0], min(IRREGULAR_POINTS[1], int(IRREGULAR_SHARE * self.longest / evaluations)))

    def very_long(self, candidate: Candidate, k: int) -> bool:
        """True if a run takes so long that only a few more like it are possible."""
        return candidate.look(k).steps * candidate.evaluations > HALVED_RUN_SHARE * self.longest

    def halved(self, candidate: Candidate, k: int, best: float) -> int | None:
        """A k in the last doubling that is good enough and nearly the least."""
        hopeless = self.very_long(candidate, k) and self.cost(candidate, k) > 2.0 * best
        least = k if k == candidate.first else self.between(candidate, k // 2, k, 1 if hopeless else HALVINGS)
        if hopeless and self.confirmed(candidate, least):
            return least
        return next((n for n in rungs(least, k) if self.confirmed(candidate, n)), None) or self.finest(candidate, k, 1)

    def between(self, candidate: Candidate, low: int, high: int, halvings: int = HALVINGS) -> int:
        """A k above ``low``, which is not good enough, up to ``high``, which is."""
        for _ in range(halvings):
            middle = (low + high) // 2
            if middle in (low, high):
                break
            low, high = (low, middle) if self.good(candidate, middle) else (middle, high)
        return high

    def robust(self, candidate: Candidate, k: int) -> int | None:
        """The k from which on slightly more steps are good enough too."""
        above = [rung for rung in rungs(k, 2 * k) if rung > k and self.affordable(candidate, rung, k)]
        near = sorted({k + 1, *above[:2]})
        if self.very_long(candidate, k):  # only the runs that exist, and one more
            near = sorted({k + 1, *(n for n in candidate.seen if k < n <= 2 * k)})
        if all(self.good(candidate, n) for n in near if self.affordable(candidate, n, k)):
            return k
        bad = [rung for rung in sorted({k + 1, *above}) if not self.good(candidate, rung)]
        return next((rung for rung in above if rung > bad[-1]), None)

    def expected(self, candidate: Candidate, k: int) -> float | None:
        """The error extrapolated by the order from the finest doubling below k whose error falls."""
        rung = candidate.first
        while 2 * rung < k:
            rung *= 2
        if rung >= k:
            return None
        error = candidate.look(rung).error
        return error * (rung / k) ** candidate.method.order if error < ASYMPTOTIC_ERROR else None


def rungs(low: int, high: int) -> list[int]:
    """Whole numbers from ``low`` to ``high``, 9 % apart or by one; every method has the same ones."""
    start, end = math.floor(RUNGS_PER_OCTAVE * math.log2(low)), math.ceil(RUNGS_PER_OCTAVE * math.log2(high))
    return sorted({n for j in range(start, end + 1) if low <= (n := round(float(2.0 ** (j / RUNGS_PER_OCTAVE)))) <= high})
