"""A short verdict on how a run ended."""

from __future__ import annotations

from ...runs.result import Status
from ..charts import RunPicture
from ..charts.runs_finding import MIN_GROWTH, MIN_GROWTH_UNKNOWN, growth_of, tenfold

#: Where no true motion is known.
UNKNOWN = "finite to the end; the error is unknown, because the true motion is unknown"

#: Why a run with a tolerance stopped.
STOPPED = {
    Status.DIVERGED: "the state is no longer finite",
    Status.BUDGET: "reached the largest number of steps allowed",
    Status.UNDERFLOW: "steps would be too short to change the time",
    Status.NOT_FINITE: "no step gave a finite state",
}


def verdict(picture: RunPicture) -> str:
    """A verdict, in a few words, on whether the run followed the motion, and the number that shows it."""
    run = picture.run
    if run.status:
        step = int(run.first_bad_step)
        if run.paces is None:
            return f"diverged at step {step} (t = {run.t0 + step * run.dt:.6g}): unstable"
        return f"stopped at t = {float(run.paces.t):.6g}: {STOPPED[Status(int(run.status))]}"
    growth, known = growth_of(picture)
    if growth >= (MIN_GROWTH if known else MIN_GROWTH_UNKNOWN):
        return f"grew by {tenfold(growth)}: unstable"
    error = picture.summary()["largest_state_error"]
    if error is None:
        return UNKNOWN
    if error > 1.0:
        return f"bounded, but wrong: the state error is up to {error:.2g}, where 1 is the size of the solution"
    return f"bounded; the state error is at most {error:.2g}"
