"""Advice: the cheapest method and step that are accurate enough for a scene, and how far they are from instability.

``motion`` has the reference solution, ``trials`` and ``adaptive`` run the scene with fixed and with adaptive steps, and
``candidates`` gives both the same interface for ``search``, which finds the fewest steps that are accurate enough. ``costs``
measures steps, ``predict`` uses eigenvalues, ``outcome`` makes rows of the results, and ``result`` presents them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from ...base import checks
from ...errors import ArgumentError, TooLargeError, UnsupportedError
from ...model.compatibility import one_state
from ...model.methods import Method, choice
from ...model.systems import NBody, System
from ...runs import float32
from ...runs.execution import quietly
from ...scenes import Scene
from ...scenes import scene as find_scene
from ...scenes.base import quiet_run
from ..measuring.timing import TIMED_STEP
from . import predict
from .adaptive import AdaptiveTrials
from .candidates import ERROR_SHARE, Adaptive, Candidate, Fixed, Single
from .costs import Times, step_times, tried_times
from .motion import SINGLE_STEP_ROUNDING, Grid, Motion, motion_of
from .outcome import Spending, rejection, row, shortfall_of
from .result import Advice
from .rows import Rejected, Row, Shortfall
from .search import LONG_RUN_SHARE, MAX_EVALUATIONS, SIZE_EXPONENT, Search
from .stiff import Stiff, stiff_of
from .trials import Trial, Trials

if TYPE_CHECKING:
    from ...base.literals import Cost, Dtypes

Kind = TypeVar("Kind")

__all__ = ["Advice", "Rejected", "Row", "Shortfall", "Stiff", "advise"]

COSTS: tuple[Cost, ...] = ("time", "evaluations")
DTYPES: tuple[Dtypes, ...] = ("float64", "float32", "both")

#: A larger budget in seconds is refused: the age of the universe is half of it.
MOST_SECONDS = 1e18

#: A step in float32 takes about this fraction of the time of a step in float64, and counts accordingly in the work of a search.
SINGLE_WORK = 0.5

#: The longest frame, in horizons: a run must reach its end.
LONGEST_FRAME = 100.0

#: The most frames in a horizon: the state is known at the end of each, and each takes a step or more.
MAX_FRAMES = 1_000_000

#: The most numbers of a state: with more, no useful run would be short enough to be tried.
MAX_NUMBERS = 100_000

#: Errors for which a search may find steps that are good enough by luck: this, a tenth of it and so on.
LARGEST_HINTED = 0.1

#: The shares of the progress at which the true motion and the times are known, and the steps for larger errors.
MOTION_SHARE, HINTS_SHARE = 0.15, 0.5

#: A scene by its name, created once, since some take long to compute their true motion.
_named = cache(find_scene)


def knows_motion(method: Method, system: System) -> bool:
    """True if every step is exact, however long: Kepler's motion of two bodies alone."""
    return method.splits and isinstance(system, NBody) and system.force == "newton" and len(system.masses) == 2


def advise(
    scene: Scene | str,
    frame: float | None = 1 / 60,
    tolerance: float = 1e-2,
    budget: float | None = None,
    methods: Iterable[Method | str] | None = None,
    *,
    cost: Cost = "time",
    fixed: bool = False,
    dtype: Dtypes = "float64",
    progress: Callable[[float], object] | None = None,
) -> Advice:
    """Find the cheapest method and step that are accurate enough for a scene.

    For each method the search finds the fewest steps with which the state error stays below the tolerance over the scene's
    horizon, from coarse to fine. For each method that estimates its error, it also finds the largest tolerance for adaptive
    steps. Every advised step was run, and its error is that of the run. A scene without an exact solution is judged as long
    as a reference solution can be trusted.

    Args:
        scene: a ``Scene``, or the name of one.
        frame: the frame, in the scene's units of time, into which a whole number of steps must fit; None if the step is free.
        tolerance: the largest allowed ``Scene.state_error``, above zero; at 1 the error is as large as the solution.
        budget: computing time in seconds that a frame may use; if None, the frame itself, with the second as the unit of time.
            Without a frame, seconds per unit of time, or no bound. If the cost of frames differs, the most expensive must fit.
        methods: names, or what ``stepwell.method`` returns; all if None, but ``wisdom_holman`` for two bodies alone, whose motion
            it knows, so that its step says nothing.
        cost: ``"time"`` ranks by measured time, ``"evaluations"`` by function (rate) evaluations, which are repeatable. If the
            cost of frames differs, their mean counts. Of methods whose costs differ by less than the noise of the measurement the
            one with the smallest error comes first.
        fixed: leave out adaptive steps, which a ``World`` cannot take.
        dtype: ``"float64"``, ``"float32"``, or ``"both"``, which also tries each method with fixed steps in float32. There a
            step takes about half the time, and rounding bounds what is accurate enough. Of equal costs, as evaluations are,
            float64 comes first. With ``"float32"`` there are no adaptive steps, which it does not work with.
        progress: a function that is called with the share of the search that is done, from 0 to 1.

    Returns:
        An ``Advice``; print it.

    Raises:
        ArgumentError: what was given and what was expected, or that the true motion of the scene is not known for any time.

    Example:
        >>> advice = sw.advise("figure_eight", methods=["leapfrog", "rk4"], cost="evaluations")
        >>> advice
        <advice for figure_eight: leapfrog, dt = 0.00833333, error 0.0039>
    """
    scene, chosen = _named(scene) if isinstance(scene, str) else find_scene(scene), choice(methods)
    if methods is None:
        chosen = [method for method in chosen if not knows_motion(method, scene.system)]
    tolerance = checks.number("tolerance", tolerance, positive=True)
    cost = checks.known("cost", cost, COSTS)
    fixed = checks.flag("fixed", fixed)
    dtype = checks.known("dtype", dtype, DTYPES)
    report = _forward(checks.callback("progress", progress))
    frame = None if frame is None else checks.number("frame", frame, positive=True, unit="units of time")
    budget = frame if budget is None else checks.number("budget", budget, positive=True, unit="seconds")
    if budget is not None and budget > MOST_SECONDS:
        raise ArgumentError(f"budget: expected at most {MOST_SECONDS:g} seconds, got {budget:g}")
    if scene.system.batch:
        raise ArgumentError(f"scene: expected a system of one member, got parameters of shape {scene.system.batch}")
    if (numbers := scene.v.size + scene.y.size) > MAX_NUMBERS:
        raise TooLargeError(f"scene: expected a state of at most {MAX_NUMBERS} numbers, got one of {numbers}")

    if frame is not None and frame > LONGEST_FRAME * scene.horizon:
        raise ArgumentError(
            f"frame: expected at most {LONGEST_FRAME:g} times the horizon of {scene.horizon:g} units of time, got {frame:g}"
        )

    most = MAX_EVALUATIONS / max(1.0, (scene.v.size + scene.y.size) / 8) ** SIZE_EXPONENT
    if frame is not None and scene.horizon / frame > (frames := min(MAX_FRAMES, int(most))):
        raise TooLargeError(
            f"frame: expected at most {frames} frames in the horizon, each of which takes a step or more in every run; got "
            f"{scene.horizon / frame:.3g} of {frame:g} in {scene.horizon:g} units of time; give a longer frame, or a scene "
            f"with a shorter horizon"
        )

    known = motion_of(scene, frame, tolerance, single=dtype != "float64")
    trials = Trials(known, tolerance, LONG_RUN_SHARE * most)
    narrow = Trials(known, tolerance, LONG_RUN_SHARE * most, "float32")
    adaptive = AdaptiveTrials(known, ERROR_SHARE * tolerance, most)
    candidates: list[Candidate] = []
    rejected = []
    for method in chosen:
        ways: list[Candidate] = []
        if dtype != "float32":
            ways += [Fixed(method, trials, known.grid, known.share)]
            ways += [Adaptive(method, adaptive)] if method.error_order is not None and not (fixed or method.has_series) else []
        if dtype != "float64":
            ways += [Single(method, narrow, known.grid, known.share, trials, known.share * tolerance)]
        for candidate in ways:
            why = _refusal(scene, candidate, known.grid)
            if why is None:
                candidates.append(candidate)
            else:
                rejected.append(Rejected(method.name, "refused", why, candidate.by, candidate.dtype))

    report(MOTION_SHARE / 2.0)
    times, noise = _times(scene, candidates)
    report(MOTION_SHARE)
    noise = noise if cost == "time" else 0.0
    prices = times if cost == "time" else {each.name: float(each.evaluations) for each in candidates}
    hints = _hints(known, trials, [each for each in candidates if each.dtype == "float64"], prices, tolerance, most, report)
    search = Search(
        tolerance,
        known.grid.spans,
        prices,
        most,
        lambda: trials.work + SINGLE_WORK * narrow.work + adaptive.work,
        progress=_part(report, HINTS_SHARE if tolerance < LARGEST_HINTED else MOTION_SHARE, 1.0),
    )
    fewest, missed = search.run(candidates, hints=hints)

    spent = Spending(known.grid, adaptive, times)
    broken = [each for each in candidates if each.name in fewest and not spent.fits(each, fewest[each.name].k, budget)]
    if budget is not None and any(each.by == "tolerance" for each in broken):
        # A candidate that is cheap on average but not in its worst frame must not exclude one that costs more on average but the
        # same in all frames.
        rest = [each for each in candidates if each not in broken]
        useful = max(2.0 * budget, min(spent.longest(each, fewest[each.name].k) for each in broken))
        again, _ = search.run(rest, {each.name: spent.steps(each, useful) for each in rest})
        fewest |= again
        missed = {name: why for name, why in missed.items() if name not in again}
    enough = [each for each in candidates if each.name in fewest]
    fits = [each for each in enough if spent.fits(each, fewest[each.name].k, budget)]
    costs = [search.cost(each, fewest[each.name].k) for each in fits]
    fits = by_cost_and_error(fits, costs, [_judged(each, fewest[each.name].trial) for each in fits], noise)
    for each in candidates:
        if each.name in missed:
            rejected.append(rejection(each, missed[each.name], search))
        elif each not in fits:
            worst = " in its worst frame" if each.by == "tolerance" and frame is not None else ""
            need = spent.longest(each, fewest[each.name].k)
            reason = f"good enough, but takes {need:.3g} s{worst} of the {budget:.3g} s"
            rejected.append(Rejected(each.method.name, "budget", reason, each.by, each.dtype))
    rates = predict.rates_along(trials) if fits else None
    fastest = None if rates is None or trials.scene.system.linear else rates.oscillation
    ranked = tuple(row(trials, each, fewest[each.name], spent, budget, fastest) for each in fits)
    shortfall = None if ranked else shortfall_of(candidates, fewest, spent, budget)
    runs = trials.runs + narrow.runs + adaptive.runs
    outcome = (trials.scene, frame, tolerance, budget, cost, ranked, tuple(rejected), shortfall, runs, known.cut, noise)
    explicit = dict.fromkeys(each.method for each in candidates)
    report(1.0)
    stiff = stiff_of(ranked[0].method, ranked[0].dt, rates, explicit) if ranked else None
    return Advice(*outcome, dtype=dtype, stiff=stiff)


def _refusal(scene: Scene, candidate: Candidate, grid: Grid) -> str | None:
    """Why the method cannot step the scene with its control, or None; determined by trying a step."""
    if candidate.by == "tolerance" and scene.control is not None:
        return "adaptive steps are tried for scenes without a control only"
    if candidate.by == "tolerance" and scene.system.contacts:
        return "adaptive steps do not work with surfaces"
    dt = TIMED_STEP * scene.dt
    try:
        one_state("advice", candidate.method)
        if candidate.dtype == "float32":
            float32.step(scene.system, candidate.method, grid.dt(candidate.first))
            float32.check_inputs(scene.system, (1.0 + SINGLE_STEP_ROUNDING) * grid.end)
            quiet_run(scene, candidate.method, dt, steps=1, dtype="float32")
        elif candidate.by == "step":
            quiet_run(scene, candidate.method, dt, steps=1)
        else:
            quietly(
                scene.system,
                candidate.method,
                v=scene.v,
                y=scene.y,
                tolerance=1.0,
                at=[dt],
                max_steps=1,
                **scene.adaptive_options,
            )
    except UnsupportedError as error:
        return str(error).removeprefix(f"{candidate.method.name} ").removeprefix("dtype: ")
    except ArgumentError as error:
        # The scene exists in float64, so only numbers that float32 does not have can be wrong.
        if candidate.dtype == "float64":
            raise
        return str(error)
    return None


def _forward(progress: Callable[[float], object] | None) -> Callable[[float], object]:
    """The progress, which never goes back, as where some candidates are searched again; nothing for None."""
    furthest = 0.0

    def report(share: float) -> None:
        nonlocal furthest
        furthest = max(furthest, share)
        if progress is not None:
            progress(furthest)

    return report


def _part(progress: Callable[[float], object], begin: float, end: float) -> Callable[[float], object]:
    """The progress of a part that begins and ends at these shares of the whole."""
    return lambda share: progress(begin + (end - begin) * share)


def _hints(
    known: Motion,
    trials: Trials,
    candidates: Sequence[Candidate],
    prices: Mapping[str, float],
    tolerance: float,
    most: float,
    progress: Callable[[float], object],
) -> dict[str, set[int]]:
    """The results of searches for larger errors, in short runs only, by the candidate's name.

    Where errors do not fall with the step, steps that are good enough by luck may lie between those that a search for a small
    error tries. Advice for a larger error would then name a step that is good enough for the small one, too.
    """
    hints: dict[str, set[int]] = {}
    levels = [LARGEST_HINTED]
    while 0.1 * levels[-1] > tolerance:
        levels.append(0.1 * levels[-1])
    step = (HINTS_SHARE - MOTION_SHARE) / len(levels)
    for number, allowed in enumerate(levels if tolerance < LARGEST_HINTED else []):
        begin = MOTION_SHARE + number * step
        adaptive = AdaptiveTrials(known, ERROR_SHARE * allowed, trials.long)
        again = [Adaptive(each.method, adaptive) if isinstance(each, Adaptive) else each for each in candidates]
        part = _part(progress, begin, begin + step)
        search = Search(allowed, known.grid.spans, prices, most, short=trials.long, progress=part)
        for name, each in search.run(again)[0].items():
            hints.setdefault(name, set()).add(each.k)
    return hints


def _times(scene: Scene, candidates: Sequence[Candidate]) -> tuple[dict[str, float], float]:
    """Nanoseconds per step, by the candidate's name, and the relative difference that means nothing."""
    # An advised method in float32 is compared with the same one in float64, so all are measured in float64, too.
    both = list({each.method.name: each.method for each in candidates if each.by == "step"}.values())
    steps = step_times(scene, both, [each.method for each in candidates if each.dtype == "float32"])
    tried = tried_times(scene, [each.method for each in candidates if each.by == "tolerance"])
    noise = max((each.noise for each in (steps, tried) if isinstance(each, Times)), default=0.0)
    adaptive = {each.name: tried[each.method.name] for each in candidates if each.by == "tolerance"}
    return {**steps, **adaptive}, noise


def by_cost_and_error(candidates: Sequence[Kind], costs: Sequence[float], errors: Sequence[float], noise: float) -> list[Kind]:
    """Candidates in the order of their costs; among those whose costs are equal up to the noise, the smaller error comes first.

    The first group is the cheapest and all that cost at most that fraction more; the next begins with the cheapest of the others.
    Errors that agree in two digits count as equal: those of one motion computed in two ways differ by roundings.
    """
    errors = [float(f"{error:.1e}") for error in errors]
    order = sorted(range(len(candidates)), key=lambda i: (costs[i], errors[i]))
    ranked: list[int] = []
    while order:
        most = costs[order[0]] * (1.0 + noise)
        group = [i for i in order if costs[i] <= most]
        ranked += sorted(group, key=lambda i: (errors[i], costs[i]))
        order = order[len(group) :]
    return [candidates[i] for i in ranked]


def _judged(candidate: Candidate, trial: Trial) -> float:
    """The error that orders equal costs: at least that of the float64 run, since a lucky rounding proves nothing."""
    return max(trial.error, candidate.in_float64(trial)) if isinstance(candidate, Single) else trial.error
