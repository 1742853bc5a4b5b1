"""Finding of a run, in a few words: the second half of the title of its picture, and of the verdict of the command line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.arrays import Array
from ...base.reprs import counted
from ...model.controls import ConstraintControl
from ...runs.result import Run

if TYPE_CHECKING:
    from .runs import RunPicture

#: Of a motion whose exact solution is known, a state so many times as large as that solution has grown by instability.
MIN_GROWTH = 10.0

#: Of one that is not known only so much is surely no motion: a body that is thrown out goes far, too.
MIN_GROWTH_UNKNOWN = 1e6

#: A smaller error is told by the number of right digits, a larger one in percent up to the whole.
MAX_ERROR_IN_DIGITS = 0.005

#: An energy error that is larger is told by the energies themselves.
MAX_ENERGY_IN_PERCENT = 0.5

#: More digits than these are rounding.
MOST_DIGITS = 15

#: An angle that changes by less, in degrees, over this last share of the run has settled.
SETTLED, LAST_SHARE = 0.5, 0.1

#: Constraints that keep something else than the energy.
CONSTRAINTS = ("length", "norm")

#: A run within this share of the orbit's size is on it; the number of states that are looked at, and the least share of a period
#: that is told.
ON_THE_ORBIT, LATE_STATES, MIN_LAG = 0.02, 400, 2e-3

#: Control that changes an error by less than this factor makes no difference.
MIN_DIFFERENCE = 1.5

SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def finding(chart: RunPicture) -> str:
    """The run's title in a few words: how it ended, else its error, else what it did."""
    return _words(chart).replace(" -", " −")


def _words(chart: RunPicture) -> str:
    run = chart.run
    if run.status:
        if run.paces is None:
            return f"diverges at step {int(run.first_bad_step)}"
        return f"stops at t = {float(run.paces.t):.4g}"
    growth, known = growth_of(chart)
    if growth >= (MIN_GROWTH if known else MIN_GROWTH_UNKNOWN):
        return f"grows to {_times(growth)} the {'exact motion' if known else 'start'}"
    if chart.before is not None and (change := _of_control(chart, chart.before)):
        return change
    if chart.state_error is not None and np.isfinite(chart.state_error).any():
        return _of_error(chart.state_error, chart.run.t, _late(chart))
    if chart.energy_error is not None:
        return _of_energy(chart.energy_error, run.energy)
    return _of_motion(chart)


def _late(chart: RunPicture) -> str | None:
    """By what share of the period a run is late or early at its end, if it stays on the exact orbit; None if it leaves it."""
    period, exact = chart.scene.period, chart.exact
    if chart.kind != "orbits" or period is None or exact is None or exact[0][-1] - exact[0][0] < 0.999 * period:
        return None
    finite = np.flatnonzero(chart.finite)
    at = finite[np.unique(np.round(np.linspace(0, len(finite) - 1, LATE_STATES)).astype(int))]
    places, curve = chart.run.y[at].reshape(len(at), -1), exact[2].reshape(len(exact[0]), -1)[::4]
    squares = (places**2).sum(axis=1)[:, np.newaxis] + (curve**2).sum(axis=1) - 2.0 * places @ curve.T
    nearest = squares.argmin(axis=1)
    off = float(np.sqrt(np.maximum(squares.min(axis=1), 0.0).max() / (curve**2).sum(axis=1).max()))
    lags = np.unwrap(chart.run.t[at] - exact[0][::4][nearest], period=period) / period
    lag = float(lags[-1] - lags[0])
    if off > ON_THE_ORBIT or abs(lag) < MIN_LAG:
        return None
    return f"on the exact orbit, but {percent(abs(lag))} of a period {'late' if lag > 0.0 else 'early'}"


def _of_error(error: Array, t: Array, late: str | None = None) -> str:
    """The largest state error that is known, or by how much the run is late."""
    largest = float(np.nanmax(error))
    known = "" if not np.isnan(error).any() else f" up to t = {float(t[~np.isnan(error)][-1]):.3g}"
    if largest <= MAX_ERROR_IN_DIGITS:
        return f"the exact motion to {_digits(largest)}{known}"
    if late is not None:
        return late
    if largest <= 1.0:
        return f"up to {percent(largest)} from the exact motion{known}"
    return f"not the exact motion, the error reaches {largest:.2g}{known}"


def _of_energy(error: Array, energy: Array) -> str:
    """How well the energy is kept, where it is all that is known."""
    largest = float(error.max())
    if largest <= MAX_ERROR_IN_DIGITS:
        return f"energy kept to {_digits(largest)}"
    if largest <= MAX_ENERGY_IN_PERCENT:
        return f"energy changes by up to {percent(largest)}"
    return f"energy goes from {energy[0]:.3g} to {energy[int(np.argmax(error))]:.3g}"


def _of_control(chart: RunPicture, before: RunPicture) -> str:
    """The effect of the control, beside the same run without it; nothing where it is not the energy that it keeps.

    Medians of the saved states are compared: at a close encounter the largest error may be the same with and without control.
    """
    if before.run.status:
        return f"finite with control, diverges at step {int(before.run.first_bad_step)} without"
    keeper: Any = chart.run.system.keeper
    if isinstance(keeper, ConstraintControl) or getattr(keeper, "way", None) in CONSTRAINTS:
        return ""
    changes = []
    for name, after, plain in (
        ("energy", chart.energy_error, before.energy_error),
        ("state", chart.state_error, before.state_error),
    ):
        change = None if after is None or plain is None else _change(after, plain)
        if change is None and name == "energy":
            return ""
        if change is not None:
            changes.append(f"the {name} error {change}")
    return f"control makes {', '.join(changes)}"


def _change(after: Array, plain: Array) -> str | None:
    """How the median of errors changed; nothing where one of the medians is zero or not known."""
    known = np.isfinite(after) & np.isfinite(plain)
    if not known.any():
        return None
    old, new = float(np.median(plain[known])), float(np.median(after[known]))
    if old <= 0.0 or new <= 0.0:
        return None
    factor = old / new
    if 1.0 / MIN_DIFFERENCE < factor < MIN_DIFFERENCE:
        return "neither smaller nor larger"
    return f"{_times(factor)} smaller" if factor > 1.0 else f"{_times(1.0 / factor)} larger"


def _of_motion(chart: RunPicture) -> str:
    """The range of the motion, where neither error is known."""
    if chart.kind == "attitude":
        return _of_attitude(chart)
    y = chart.run.y
    if chart.kind == "swing":
        return f"y from {y.min():.3g} to {y.max():.3g}"
    if chart.kind == "body":
        return f"angular velocity up to {np.linalg.norm(chart.run.v, axis=-1).max():.3g}"
    return f"no coordinate beyond {np.abs(y).max():.3g}"


def _of_attitude(chart: RunPicture) -> str:
    """Where roll and pitch settled, or how far they went."""
    system: Any = chart.run.system
    roll, pitch = np.asarray(system.angles(chart.run.y, axis=1))[:, :2].T
    last = chart.elapsed >= (1.0 - LAST_SHARE) * chart.elapsed[-1]
    if max(np.ptp(roll[last]), np.ptp(pitch[last])) < SETTLED:
        return f"settles at {roll[-1]:.1f}° roll and {pitch[-1]:.1f}° pitch"
    ways = (f"{name} from {angle.min():.0f}° to {angle.max():.0f}°" for name, angle in (("roll", roll), ("pitch", pitch)))
    return ", ".join(ways)


# ---- numbers in words


def steps_of(run: Run) -> str:
    """How many steps of which length, or how many adaptive ones."""
    if run.paces is not None:
        return counted(int(run.paces.accepted), "adaptive step")
    return f"{counted(run.steps, 'step')} of {run.dt:.6g}"


def broke_off(run: Run) -> str:
    """When a run diverged or stopped, as a sentence without its full stop; empty if it did not."""
    if not run.status:
        return ""
    if run.paces is not None:
        return f"Stopped at t = {float(run.paces.t):.6g}"
    step = int(run.first_bad_step)
    return f"Diverged at step {step} (t = {run.t0 + step * run.dt:g})"


def percent(share: float) -> str:
    """A share in percent, of two digits."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"


def _digits(error: float) -> str:
    """How many digits are right: −log₁₀ of the error, rounded down."""
    if error < 10.0**-MOST_DIGITS:
        return "rounding"
    return f"{math.floor(-math.log10(error))} digits"


def _times(factor: float) -> str:
    return f"{factor:.2g} times" if factor < 100.0 else f"{tenfold(factor)} times" if factor >= 1000.0 else f"{factor:.0f} times"


def tenfold(number: float) -> str:
    """A large number by its power of ten: 10²⁰."""
    if number < 1000.0:
        return f"a factor of {number:.0f}"
    return "10" + str(round(math.log10(number))).translate(SUPERSCRIPTS)


# ---- growth


def growth_of(picture: RunPicture) -> tuple[float, bool]:
    """The growth of the state relative to the true motion, and True; without one relative to the first state, and False."""
    scales = picture.scene.scales if picture.scene.exact is not None else _lengths(picture.run)[:, 0]
    ratios = [
        float(length[np.isfinite(length)].max(initial=0.0)) / scale
        for length, scale in zip(_lengths(picture.run), scales, strict=True)
        if scale > 0.0
    ]
    return max(ratios, default=0.0), picture.scene.exact is not None


def _lengths(run: Run) -> Array:
    """The length of v and of y at each saved state, shape (2, saved)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.array([np.linalg.norm(block.reshape(len(run.t), -1), axis=1) for block in (run.v, run.y)])
