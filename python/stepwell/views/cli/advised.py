"""The method and the step of a run that names none: the advised ones, of a few methods that differ."""

from __future__ import annotations

from collections.abc import Callable

from ...errors import StepwellError
from ...scenes import Scene
from ...studies.advice import Row, advise

#: The methods among which is chosen: cheap, usual, accurate, and for stiff equations.
METHODS = ("leapfrog", "rk4", "dop853", "rodas5p")

#: Larger states are not tried by the last, which solves equations in each step.
MOST_IMPLICIT = 64

#: So many rate evaluations cost as much as one of an implicit method. They are counted, since times are not repeatable.
PRICE = 5.0

#: The method where no advice can be given.
USUAL, ADAPTIVE = "rk4", "dop853"

#: The largest error, relative to the size of the solution.
ERROR = 1e-2

#: A budget of seconds that nothing exceeds.
NO_BUDGET = 1e9


def advised(scene: Scene, progress: Callable[[float], object] | None, *, by: str | None) -> tuple[Row | None, str]:
    """The cheapest row that is accurate enough, and why it is taken, in words; None where there is no advice.

    ``by`` is ``"step"`` for fixed steps only, ``"tolerance"`` for adaptive ones, None for either.
    """
    methods = METHODS if scene.v.size + scene.y.size <= MOST_IMPLICIT else METHODS[:-1]
    rows: list[Row] = []
    reason = "no method is accurate enough"
    try:
        # The scene's step is the frame: so states are saved often enough for a smooth picture.
        advice = advise(scene, scene.dt, ERROR, NO_BUDGET, methods, cost="evaluations", fixed=by == "step", progress=progress)
        rows = [row for row in advice.ranked if by is None or (row.tolerance is None) == (by == "step")]
    except StepwellError as error:
        reason = str(error).partition(";")[0]
    if rows:
        names = ", ".join(dict.fromkeys(row.method.name for row in rows))
        others = f"the cheapest of {names}" if "," in names else "the only one of a few"
        cheapest = min(rows, key=lambda row: row.evaluations_per_time * (PRICE if row.method.is_implicit else 1.0))
        return cheapest, f"{others} with an error below {ERROR:g}; --method NAME takes another"
    if by == "tolerance":
        return None, f"no: {ADAPTIVE} is usual with a tolerance; --method NAME takes another"
    return None, f"no: {reason}; {USUAL} is usual"
