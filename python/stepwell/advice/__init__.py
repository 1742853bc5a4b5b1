"""Advice: which method and which step are the cheapest that are good enough for a scene, and how far they are from blowing up.

``motion`` knows the true motion, ``trials`` and ``paced`` run the scene with fixed steps and with steps of chosen length,
``candidates`` makes both alike for ``search``, which finds the fewest steps that are good enough; ``predict`` asks the
eigenvalues, ``result`` tells it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence

from .. import _checks
from ..charts.measure import TIMED_STEP
from ..errors import ArgumentError, DTypeError, UnsupportedError
from ..integrate import integrate
from ..methods import Method
from ..methods import method as find_method
from ..methods import methods as every_method
from ..scenes import Scene
from ..scenes import scene as find_scene
from . import predict
from .candidates import SHARE, Candidate, Fixed, Paced
from .motion import Grid, motion_of
from .paced import PacedTrials
from .result import Advice, Rejected, Row, Shortfall
from .search import DOMINATED, MOST, Found, Missed, Search
from .trials import Trial, Trials, step_times, tried_times

__all__ = ["Advice", "Rejected", "Row", "Shortfall", "advise"]

COSTS = ("time", "evaluations")


def advise(
    scene: Scene | str,
    frame: float | None = 1 / 60,
    tolerance: float = 1e-2,
    budget: float | None = None,
    methods: Iterable[Method | str] | None = None,
    *,
    cost: str = "time",
    fixed: bool = False,
) -> Advice:
    """The cheapest method and step that are good enough for a scene.

    For each method the fewest steps are sought with which the state error stays below the tolerance over the scene's horizon,
    from coarse to fine; and for each that can estimate its error, the largest tolerance with which it may choose its steps
    itself. What is advised has been run, and its error is that of the run. A scene without an exact solution is judged as far
    as its true motion can be known.

    Args:
        scene: a ``Scene``, or the name of one.
        frame: the frame, in the scene's units of time, into which a whole number of steps must fit; None if any step will do.
        tolerance: the largest ``Scene.state_error`` that is allowed, above zero; at 1 a state is as wrong as it is large.
        budget: seconds of computing that may be used in a frame; if None, the frame itself, with the second as the unit of time.
            Without a frame, seconds in a unit of time, or no bound. Where frames take different times, the longest must keep it.
        methods: names, or what ``stepwell.method`` returns; all if None.
        cost: ``"time"`` ranks by measured time, ``"evaluations"`` by rate evaluations, which repeat. Where frames cost
            differently, their mean counts.
        fixed: leave out steps of chosen length, which a ``World`` cannot make.

    Returns:
        An ``Advice``; print it.

    Raises:
        ArgumentError: what was given and what was expected, or that the true motion of the scene is not known for any time.
    """
    if not isinstance(scene, (Scene, str)):
        raise DTypeError(f"scene: expected a Scene or its name, got {type(scene).__name__}")
    scene = find_scene(scene)
    if isinstance(methods, str):
        raise DTypeError(f"methods: expected a list of names, got the text {methods!r}")
    chosen = list(dict.fromkeys(every_method() if methods is None else map(find_method, methods)))
    if not chosen:
        raise ArgumentError("methods: expected at least one, got none")
    tolerance = _checks.number("tolerance", tolerance, positive=True)
    cost = _checks.known("cost", cost, COSTS)
    frame = None if frame is None else _checks.number("frame", frame, positive=True, unit="units of time")
    budget = frame if budget is None else _checks.number("budget", budget, positive=True, unit="seconds")
    if scene.system.batch:
        raise ArgumentError(f"scene: expected a system of one member, got parameters of shape {scene.system.batch}")

    known = motion_of(scene, frame, tolerance)
    trials = Trials(known)
    most = MOST / max(1.0, trials.numbers / 8)
    paced = PacedTrials(known, SHARE * tolerance, most)
    candidates: list[Candidate] = []
    rejected = []
    for method in chosen:
        ways: list[Candidate] = [Fixed(method, trials, known.grid)]
        ways += [Paced(method, paced)] if method.error_order is not None and not fixed else []
        for candidate in ways:
            why = _refusal(scene, candidate)
            if why is None:
                candidates.append(candidate)
            else:
                rejected.append(Rejected(method.name, "refused", why, candidate.by))

    times = _times(scene, candidates)
    prices = times if cost == "time" else {each.name: float(each.method.evaluations) for each in candidates}
    search = Search(tolerance, known.grid.spans, prices, most)
    found, missed = search.run(candidates)

    spent = _Spending(known.grid, paced, times)
    broken = [each for each in candidates if each.name in found and not spent.fits(each, found[each.name].k, budget)]
    if budget is not None and any(each.by == "tolerance" for each in broken):
        # What is cheap in the mean but not in its worst frame must not stand in the way of what is dearer and even.
        rest = [each for each in candidates if each not in broken]
        useful = max(2.0 * budget, min(spent.longest(each, found[each.name].k) for each in broken))
        again, _ = search.run(rest, {each.name: spent.steps(each, useful) for each in rest})
        found |= again
        missed = {name: why for name, why in missed.items() if name not in again}
    enough = [each for each in candidates if each.name in found]
    fits = [each for each in enough if spent.fits(each, found[each.name].k, budget)]
    fits.sort(key=lambda each: search.cost(each, found[each.name].k))
    for each in candidates:
        if each.name in missed:
            rejected.append(_missed(each, missed[each.name], search))
        elif each not in fits:
            worst = " in its worst frame" if each.by == "tolerance" and frame is not None else ""
            need = spent.longest(each, found[each.name].k)
            reason = f"good enough, but takes {need:.3g} s{worst} of the {budget:.3g} s"
            rejected.append(Rejected(each.method.name, "budget", reason, each.by))
    fastest = predict.fastest_oscillation(trials) if fits else None
    ranked = tuple(_row(trials, each, found[each.name], spent, budget, fastest) for each in fits)
    shortfall = None if ranked else _shortfall(search, candidates, found, spent, budget)
    made = trials.made + paced.made
    return Advice(trials.scene, frame, tolerance, budget, cost, ranked, tuple(rejected), shortfall, made, known.cut)


def _refusal(scene: Scene, candidate: Candidate) -> str | None:
    """Why the method cannot do the scene with its control, or None: a step tells."""
    if candidate.by == "tolerance" and scene.control is not None:
        return "steps of chosen length do not go with a control"
    dt = TIMED_STEP * scene.dt
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if candidate.by == "step":
                scene.run(candidate.method, dt, steps=1)
            else:
                integrate(scene.system, candidate.method, v=scene.v, y=scene.y, tolerance=1.0, at=[dt], max_steps=1)
        except UnsupportedError as error:
            return str(error).removeprefix(f"{candidate.method.name} ")
    return None


def _times(scene: Scene, candidates: Sequence[Candidate]) -> dict[str, float]:
    """Nanoseconds per step, by the candidate's name."""
    steps = step_times(scene, [each.method for each in candidates if each.by == "step"])
    tried = tried_times(scene, [each.method for each in candidates if each.by == "tolerance"])
    return {each.name: (steps if each.by == "step" else tried)[each.method.name] for each in candidates}


class _Spending:
    """Measured seconds of a run, in a frame, or in a unit of time without one."""

    def __init__(self, grid: Grid, paced: PacedTrials, times: Mapping[str, float]) -> None:
        self.grid, self.paced, self.times = grid, paced, times

    def mean(self, candidate: Candidate, trial: Trial) -> float:
        """On the whole."""
        return 1e-9 * self.times[candidate.name] * trial.steps / (self.grid.spans if self.grid.framed else self.grid.end)

    def longest(self, candidate: Candidate, k: int) -> float:
        """In the frame that takes longest."""
        return (
            1e-9 * self.times[candidate.name] * self.most(candidate, k)
            if self.grid.framed
            else self.mean(candidate, candidate.look(k))
        )

    def fits(self, candidate: Candidate, k: int, budget: float | None) -> bool:
        """Whether it keeps the budget."""
        return budget is None or self.longest(candidate, k) <= budget

    def steps(self, candidate: Candidate, budget: float | None) -> float:
        """The steps in a span for which the budget suffices."""
        if budget is None:
            return math.inf
        return budget / (1e-9 * self.times[candidate.name]) * (1.0 if self.grid.framed else self.grid.end)

    def most(self, candidate: Candidate, k: int) -> int:
        """The most steps in a frame."""
        return self.paced.worst(candidate.method, candidate.tolerance(k)) if isinstance(candidate, Paced) else k


def _row(
    trials: Trials, candidate: Candidate, found: Found, spent: _Spending, budget: float | None, fastest: float | None
) -> Row:
    method, trial, grid = candidate.method, found.trial, trials.grid
    ns, mean, longest = spent.times[candidate.name], spent.mean(candidate, trial), spent.longest(candidate, found.k)
    per_frame = method.evaluations * trial.steps / grid.spans
    by_modes, limit = None, predict.Limit(None, "none", None, None)
    observed = math.inf
    if candidate.by == "step":
        by_modes = predict.predicted(trials.scene, method, trial.dt, trial.steps)
        limit = predict.limit(trials, method, fastest)
        observed = predict.observed_limit(trials, method, trial.steps)
    robust: float | None = found.robust
    if isinstance(candidate, Paced) and found.robust is not None:
        robust = candidate.tolerance(found.robust)
    return Row(
        method=method,
        substeps=found.k if grid.framed and candidate.by == "step" else None,
        steps=trial.steps,
        dt=trial.dt,
        error=trial.error,
        predicted=by_modes.error if by_modes else found.expected,
        predicted_by="modes" if by_modes else ("order" if found.expected is not None else None),
        frequency_error=by_modes.frequency if by_modes else None,
        damping_error=by_modes.damping if by_modes else None,
        evaluations_per_frame=per_frame if grid.framed else None,
        evaluations_per_time=method.evaluations / trial.dt,
        ns_per_step=ns,
        seconds_per_frame=mean if grid.framed else None,
        seconds_per_time=1e-9 * ns / trial.dt,
        objects=None if budget is None else int(budget / longest),
        limit=limit.dt,
        limit_by=limit.how,
        mode=limit.mode,
        mode_frequency=limit.frequency,
        observed_limit=observed,
        robust=robust,
        tolerance=candidate.tolerance(found.k) if isinstance(candidate, Paced) else None,
        rejected_steps=trial.rejected,
        worst_evaluations=method.evaluations * spent.most(candidate, found.k) if grid.framed else None,
    )


def _missed(candidate: Candidate, missed: Missed, search: Search) -> Rejected:
    trial = missed.trial
    detail = f"dt = {trial.dt:.3g}" if candidate.by == "step" else f"{trial.steps} steps"
    tried = f"with {candidate.said(missed.k)} ({detail})"
    too_dear = f"costs over {DOMINATED:g} times the least"
    needs = f"; by its order it needs about {candidate.said(missed.expected)}" if missed.expected else ""
    unstable = "still unstable" if candidate.by == "step" else "stops early"
    if trial.error <= search.allowed(candidate):
        reason = f"good enough {tried}, which {too_dear}"
    elif missed.kind == "unstable":
        reason = f"{unstable} {tried}, and more {too_dear}" if missed.dear else f"{unstable} {tried}, the most tried"
    elif missed.dear:
        reason = f"error {trial.error:.2g} {tried}, and enough {too_dear}{needs}"
    else:
        reason = f"error {trial.error:.2g} {tried}, the most tried{needs}"
    return Rejected(candidate.method.name, missed.kind, reason, candidate.by)


def _shortfall(
    search: Search, candidates: Sequence[Candidate], found: Mapping[str, Found], spent: _Spending, budget: float | None
) -> Shortfall:
    """What would have to give: the least error within the budget, and the budget for the tolerance."""
    least, best = math.inf, None
    for each in candidates:
        for k in _tries(each, search, spent, budget):
            error = each.look(k).error
            if error < least and spent.fits(each, k, budget):
                least, best = error, (each, k)
    needs = [(spent.longest(each, found[each.name].k), each.name) for each in candidates if each.name in found]
    needed, by = min(needs) if needs else (None, None)
    if best is None:
        return Shortfall(least, None, None, needed, by)
    chosen, k = best
    tolerance = chosen.tolerance(k) if isinstance(chosen, Paced) else None
    return Shortfall(least, chosen.method.name, k if tolerance is None else None, needed, by, tolerance)


def _tries(candidate: Candidate, search: Search, spent: _Spending, budget: float | None) -> Iterator[int]:
    """What is worth a look for the least error: of fixed steps the most, and fewer, for rounding adds up; every tolerance."""
    if isinstance(candidate, Paced):
        k = candidate.first
        yield k
        while search.affordable(candidate, 2 * k, k) and (budget is None or spent.mean(candidate, candidate.look(k)) <= budget):
            k *= 2
            yield k
        return
    most = min(search.most / (candidate.method.evaluations * spent.grid.spans), spent.steps(candidate, budget))
    yield from {k for k in (int(most), int(most / 2), int(most / 4)) if k >= candidate.first}
