"""How a run ended, in words."""

from __future__ import annotations

import math

import numpy as np

from ..charts import RunPicture
from ..result import Run, Status

#: Of a motion whose exact solution is known, a state so many times as large as that solution has grown by instability.
MIN_GROWTH = 10.0

#: Of one that is not known only so much is surely no motion: a body that is thrown out goes far, too.
MIN_GROWTH_UNKNOWN = 1e6

SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")

#: Why a run with a tolerance stopped.
STOPPED = {
    Status.DIVERGED: "left the finite numbers",
    Status.BUDGET: "used up the most steps that are allowed",
    Status.UNDERFLOW: "would need steps too short to change the time",
    Status.NOT_FINITE: "no step gave a finite state",
}


def verdict(picture: RunPicture) -> str:
    """Whether the run stayed with its motion: a word or two, and the number that says so."""
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
        return "finite to the end; the true motion is not known, so neither is the error"
    if error > 1.0:
        return f"bounded, but wrong: the state error is up to {error:.2g}, where 1 is as large as the solution"
    return f"bounded; the state error is at most {error:.2g}"


def growth_of(picture: RunPicture) -> tuple[float, bool]:
    """How many times as large as the true motion the state became, and whether that is known; otherwise as the first state."""
    scales = picture.scene.scales if picture.scene.exact is not None else _lengths(picture.run)[:, 0]
    ratios = [
        float(length[np.isfinite(length)].max(initial=0.0)) / scale
        for length, scale in zip(_lengths(picture.run), scales, strict=True)
        if scale > 0.0
    ]
    return max(ratios, default=0.0), picture.scene.exact is not None


def _lengths(run: Run) -> np.ndarray:
    """The length of v and of y at each saved state, shape (2, saved)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.array([np.linalg.norm(block.reshape(len(run.t), -1), axis=1) for block in (run.v, run.y)])


def tenfold(number: float) -> str:
    """A large number by its power of ten: 10²⁰."""
    if number < 1000.0:
        return f"a factor of {number:.0f}"
    return "10" + str(round(math.log10(number))).translate(SUPERSCRIPTS)
