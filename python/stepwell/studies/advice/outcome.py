"""The results of a search as the rows of an advice, with their costs on this machine."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence

from . import predict
from .adaptive import AdaptiveTrials
from .candidates import Adaptive, Candidate, Single
from .motion import Grid
from .rows import Rejected, Row, Shortfall
from .search import MAX_COST_RATIO, Fewest, Missed, Search
from .trials import ASYMPTOTIC_ERROR, Trial, Trials


class Spending:
    """Measured seconds of a run, in a frame, or in a unit of time without one."""

    def __init__(self, grid: Grid, adaptive: AdaptiveTrials, times: Mapping[str, float]) -> None:
        self.grid, self.adaptive, self.times = grid, adaptive, times

    def mean(self, candidate: Candidate, trial: Trial) -> float:
        """The mean of all frames."""
        return 1e-9 * self.times[candidate.name] * trial.steps / (self.grid.spans if self.grid.framed else self.grid.end)

    def longest(self, candidate: Candidate, k: int) -> float:
        """The seconds of the most expensive frame."""
        return (
            1e-9 * self.times[candidate.name] * self.most(candidate, k)
            if self.grid.framed
            else self.mean(candidate, candidate.look(k))
        )

    def fits(self, candidate: Candidate, k: int, budget: float | None) -> bool:
        """True if the most expensive frame keeps the budget."""
        return budget is None or self.longest(candidate, k) <= budget

    def steps(self, candidate: Candidate, budget: float | None) -> float:
        """The steps in a span for which the budget suffices."""
        if budget is None:
            return math.inf
        return budget / (1e-9 * self.times[candidate.name]) * (1.0 if self.grid.framed else self.grid.end)

    def most(self, candidate: Candidate, k: int) -> int:
        """The most steps in a frame."""
        return self.adaptive.worst(candidate.method, candidate.tolerance(k)) if isinstance(candidate, Adaptive) else k


def row(
    trials: Trials, candidate: Candidate, fewest: Fewest, spent: Spending, budget: float | None, fastest: float | None
) -> Row:
    """The row of a candidate that is good enough; ``fastest`` is the frequency of the fastest oscillation, or None."""
    method, trial, grid = candidate.method, fewest.trial, trials.grid
    ns, mean, longest = spent.times[candidate.name], spent.mean(candidate, trial), spent.longest(candidate, fewest.k)
    per_frame = candidate.evaluations * trial.steps / grid.spans
    by_modes, limit = None, predict.Limit(None, "none", None, None)
    wide_error = wide_ns = None
    if isinstance(candidate, Single):
        wide_error, wide_ns = candidate.in_float64(trial), spent.times[method.name]
        trials = candidate.trials
    observed = math.inf
    if candidate.by == "step":
        by_modes = predict.predicted(trials.scene, method, trial.dt, trial.steps)
        limit = predict.limit(trials, method, fastest)
        observed = predict.observed_limit(trials, method, trial.steps)
    robust: float | None = fewest.robust
    if isinstance(candidate, Adaptive) and fewest.robust is not None:
        robust = candidate.tolerance(fewest.robust)
    return Row(
        method=method,
        substeps=fewest.k if grid.framed and candidate.by == "step" else None,
        steps=trial.steps,
        dt=trial.dt,
        error=trial.error,
        predicted=by_modes.error if by_modes else fewest.expected,
        predicted_by="modes" if by_modes else ("order" if fewest.expected is not None else None),
        frequency_error=by_modes.frequency if by_modes else None,
        damping_error=by_modes.damping if by_modes else None,
        evaluations_per_frame=per_frame if grid.framed else None,
        evaluations_per_time=candidate.evaluations / trial.dt,
        ns_per_step=ns,
        seconds_per_frame=mean if grid.framed else None,
        seconds_per_time=1e-9 * ns / trial.dt,
        objects=None if budget is None else int(budget / longest),
        limit=limit.dt,
        limit_by=limit.by,
        mode=limit.mode,
        mode_frequency=limit.frequency,
        observed_limit=observed,
        robust=robust,
        tolerance=candidate.tolerance(fewest.k) if isinstance(candidate, Adaptive) else None,
        rejected_steps=trial.rejected,
        worst_evaluations=candidate.evaluations * spent.most(candidate, fewest.k) if grid.framed else None,
        dtype=candidate.dtype,
        float64_error=wide_error,
        float64_ns_per_step=wide_ns,
    )


def rejection(candidate: Candidate, missed: Missed, search: Search) -> Rejected:
    """Why a candidate that the search gave up is not advised."""
    trial = missed.trial
    if search.allowed(candidate) < trial.error < ASYMPTOTIC_ERROR:
        trial = candidate.measured(missed.k)
    detail = f"dt = {trial.dt:.3g}" if candidate.by == "step" else f"{trial.steps} steps"
    tried = f"with {candidate.described(missed.k)} ({detail})"
    too_expensive = f"costs over {MAX_COST_RATIO:g} times as much as the best"
    needs = f"; by its order it needs about {candidate.described(missed.expected)}" if missed.expected else ""
    unstable = "still unstable" if candidate.by == "step" else "stops early"
    if trial.error <= search.allowed(candidate):
        reason = f"good enough {tried}, which {too_expensive}"
    elif missed.kind == "unstable":
        reason = (
            f"{unstable} {tried}, and more of them {too_expensive.replace('costs', 'cost')}"
            if missed.expensive
            else f"{unstable} {tried}, the most tried"
        )
    elif missed.expensive:
        reason = f"error {trial.error:.2g} {tried}, and enough steps {too_expensive.replace('costs', 'cost')}{needs}"
    else:
        reason = f"error {trial.error:.2g} {tried}, the most tried{needs}"
    if isinstance(candidate, Single) and candidate.is_rounding(missed.k):
        reason = f"error {trial.error:.2g} {tried}, most of it rounding: in float64 it is {candidate.in_float64(trial):.2g}"
    return Rejected(candidate.method.name, missed.kind, reason, candidate.by, candidate.dtype)


def shortfall_of(
    candidates: Sequence[Candidate], fewest: Mapping[str, Fewest], spent: Spending, budget: float | None
) -> Shortfall:
    """The shortfall: the least error within the budget among all tried runs, and the budget that the tolerance needs."""
    least, best = _least(candidates, spent, budget)
    needs = [(spent.longest(each, fewest[each.name].k), each.name) for each in candidates if each.name in fewest]
    needed, by = min(needs) if needs else (None, None)
    if best is None:
        return Shortfall(least, None, None, needed, by)
    chosen, k = best
    tolerance = chosen.tolerance(k) if isinstance(chosen, Adaptive) else None
    return Shortfall(least, chosen.method.name, k if tolerance is None else None, needed, by, tolerance, chosen.dtype)


def _least(candidates: Sequence[Candidate], spent: Spending, budget: float | None) -> tuple[float, tuple[Candidate, int] | None]:
    """The least error within the budget, and its candidate and k.

    For a run that was not good enough only a lower bound of its error is known. So the run with the least bound is measured until
    a measured error is the least.
    """
    waiting = [
        (trial.error, i, k, False)
        for i, each in enumerate(candidates)
        for k, trial in each.seen.items()
        if trial.error < math.inf and spent.fits(each, k, budget)
    ]
    heapq.heapify(waiting)
    while waiting:
        error, i, k, measured = heapq.heappop(waiting)
        if measured:
            return error, (candidates[i], k)
        heapq.heappush(waiting, (candidates[i].measured(k).error, i, k, True))
    return math.inf, None
