"""Advice: which method and which step are the cheapest that are good enough for a scene, and how far they are from blowing up.

``trials`` runs the scene, ``search`` finds the fewest steps of each method that are good enough, ``predict`` asks the
eigenvalues, ``result`` tells it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Sequence

from .. import _checks
from ..charts.measure import TIMED_STEP
from ..errors import ArgumentError, DTypeError, UnsupportedError
from ..methods import Method
from ..methods import method as find_method
from ..methods import methods as every_method
from ..scenes import Scene
from ..scenes import scene as find_scene
from . import predict
from .result import Advice, Rejected, Row, Shortfall
from .search import DOMINATED, Found, Missed, Search
from .trials import Grid, Trials, step_times

__all__ = ["Advice", "Rejected", "Row", "Shortfall", "advise"]

COSTS = ("time", "evaluations")

#: Without a frame a run has at least so many steps.
FEWEST = 4


def advise(
    scene: Scene | str,
    frame: float | None = 1 / 60,
    tolerance: float = 1e-2,
    budget: float | None = None,
    methods: Iterable[Method | str] | None = None,
    *,
    cost: str = "time",
) -> Advice:
    """The cheapest method and step that are good enough for a scene.

    For each method the fewest steps are sought with which the state error stays below the tolerance over the scene's horizon,
    from coarse to fine. What is advised has been run, and its error is that of the run. A scene without an exact
    solution is judged as far as its true motion can be known.

    Args:
        scene: a ``Scene``, or the name of one.
        frame: the frame, in the scene's units of time, into which a whole number of steps must fit; None if any step will do.
        tolerance: the largest ``Scene.state_error`` that is allowed, above zero; at 1 a state is as wrong as it is large.
        budget: seconds of computing that may be used in a frame; if None, the frame itself, with the second as the unit of time.
            Without a frame, seconds in a unit of time, or no bound.
        methods: names, or what ``stepwell.method`` returns; all if None.
        cost: ``"time"`` ranks by measured time, ``"evaluations"`` by rate evaluations, which repeat.

    Returns:
        An ``Advice``; print it.

    Raises:
        ArgumentError: what was given and what was expected.
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

    trials = Trials(scene)
    grid = _grid(trials.scene, frame)
    rejected = [Rejected(m.name, "refused", why) for m in chosen if (why := _refusal(scene, m)) is not None]
    able = [m for m in chosen if m.name not in {each.method for each in rejected}]
    times = step_times(scene, able) if able else {}
    prices = times if cost == "time" else {m.name: float(m.evaluations) for m in able}
    search = Search(trials, grid, tolerance, prices)
    found, missed = search.run(able)

    # Seconds in a frame, or in a unit of time, of one step more in each span.
    seconds = {name: 1e-9 * ns * (1.0 if frame is not None else 1.0 / grid.span) for name, ns in times.items()}
    fits = [m for m in able if m.name in found and (budget is None or seconds[m.name] * found[m.name].k <= budget)]
    fits.sort(key=lambda m: search.cost(m, found[m.name].k))
    for m in able:
        if m.name in missed:
            rejected.append(_missed(m, missed[m.name], search, frame))
        elif m not in fits:
            need = seconds[m.name] * found[m.name].k
            rejected.append(Rejected(m.name, "budget", f"good enough, but takes {need:.3g} s of the {budget:.3g} s"))
    fastest = predict.fastest_oscillation(trials) if fits else None
    ranked = tuple(_row(trials, grid, m, found[m.name], times[m.name], frame, budget, fastest) for m in fits)
    shortfall = None if ranked else _shortfall(search, able, found, seconds, budget)
    return Advice(trials.scene, frame, tolerance, budget, cost, ranked, tuple(rejected), shortfall, trials.made)


def _refusal(scene: Scene, method: Method) -> str | None:
    """Why the method cannot do the scene with its control, or None: a step tells."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            scene.run(method, TIMED_STEP * scene.dt, steps=1)
        except UnsupportedError as error:
            return str(error)
    return None


def _grid(scene: Scene, frame: float | None) -> Grid:
    if frame is None:
        return Grid(scene.horizon, 1, FEWEST)
    return Grid(frame, max(1, math.ceil(scene.horizon / frame - 1e-9)), 1)


def _row(
    trials: Trials,
    grid: Grid,
    method: Method,
    found: Found,
    ns: float,
    frame: float | None,
    budget: float | None,
    fastest: float | None,
) -> Row:
    dt, steps = grid.dt(found.k), grid.steps(found.k)
    modes = predict.predicted(trials.scene, method, dt, steps)
    limit = predict.limit(trials, method, fastest)
    per_time = 1e-9 * ns / dt
    per_frame = None if frame is None else 1e-9 * ns * found.k
    spent = per_time if per_frame is None else per_frame
    return Row(
        method=method,
        substeps=None if frame is None else found.k,
        steps=steps,
        dt=dt,
        error=found.trial.error,
        predicted=modes.error if modes else found.expected,
        predicted_by="modes" if modes else ("order" if found.expected is not None else None),
        frequency_error=modes.frequency if modes else None,
        damping_error=modes.damping if modes else None,
        evaluations_per_frame=None if frame is None else method.evaluations * found.k,
        evaluations_per_time=method.evaluations / dt,
        ns_per_step=ns,
        seconds_per_frame=per_frame,
        seconds_per_time=per_time,
        objects=None if budget is None else int(budget / spent),
        limit=limit.dt,
        limit_by=limit.how,
        mode=limit.mode,
        mode_frequency=limit.frequency,
        observed_limit=predict.observed_limit(trials, method, steps),
        robust=found.robust,
    )


def _missed(method: Method, missed: Missed, search: Search, frame: float | None) -> Rejected:
    def counted(k: int) -> str:
        return f"{k} step{'s' * (k != 1)}{' a frame' * (frame is not None)}"

    tried = f"with {counted(missed.k)} (dt = {missed.trial.dt:.3g})"
    too_dear = f"costs over {DOMINATED:g} times the least"
    needs = f"; by its order it needs about {counted(missed.expected)}" if missed.expected else ""
    if missed.trial.error <= search.tolerance:
        reason = f"good enough {tried}, which {too_dear}"
    elif missed.kind == "unstable":
        reason = f"still unstable {tried}, and more {too_dear}" if missed.dear else f"still unstable {tried}, the most tried"
    elif missed.dear:
        reason = f"error {missed.trial.error:.2g} {tried}, and enough {too_dear}{needs}"
    else:
        reason = f"error {missed.trial.error:.2g} {tried}, the most tried{needs}"
    return Rejected(method.name, missed.kind, reason)


def _shortfall(
    search: Search, able: Sequence[Method], found: dict[str, Found], seconds: dict[str, float], budget: float | None
) -> Shortfall:
    """What would have to give: the least error within the budget, and the budget for the tolerance."""
    least: tuple[float, str | None, int | None] = (math.inf, None, None)
    for method in able:
        most = search.most / (method.evaluations * search.grid.spans)
        if budget is not None:
            most = min(most, budget / seconds[method.name])
        # Half as many and a quarter too, for the error need not be the least with the most steps: rounding adds up.
        for k in {int(most), int(most / 2), int(most / 4)}:
            if k >= search.grid.first:
                error = search.look(method, k).error
                if error < least[0]:
                    least = (error, method.name, k)
    needs = [(seconds[name] * each.k, name) for name, each in found.items()]
    needed, by = min(needs) if needs else (None, None)
    return Shortfall(*least, needed, by)
