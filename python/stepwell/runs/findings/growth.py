"""Growth by fixed steps that are beyond their stability limit: it is finite, often for long, and means nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...base import registry
from ...base.arrays import Array
from ...base.checks import once_of
from ...errors import AccuracyWarning, UnsupportedError
from ...model.compatibility import TURNING
from ...model.methods import Method
from ...model.systems import NBody, System
from ..finding import Finding, Found
from ..result import Run
from . import Case, State

#: A state is looked at once it is this many times as long as at the start; from rest, once it is this many units long.
GROWN = 1e6
#: As ``GROWN``, where a force may turn the velocity: some methods then grow by a little at every step, however short.
GROWN_OF_TURNING = 10.0
#: So many numbers are compared at once.
AT_ONCE = 4096
#: Lengths between this and its reciprocal have squares with all of their digits.
SQUARABLE = 1e-140
#: The step explains growth if its eigenvalues make at least this share of its logarithm, and those of the rates at most that.
BY_STEPS, BY_MOTION = 0.5, 0.25
#: The most numbers in the matrices of the members that grew; members beyond that are not examined.
MOST_NUMBERS = 1_000_000


def of_run(case: Case) -> Finding | None:
    """The members of a run with fixed steps that grew by its steps alone."""
    assert case.start is not None
    grown = of_last_piece(case.run, case.start, case.run.steps)
    return None if grown is None else grown.finding()


def of_last_piece(run: Run, start: State, steps: int) -> Found | None:
    """The members that grew by this many fixed steps alone; the last of these steps are those of the run."""
    if _is_tame(run, start):
        return None
    v, y = (np.broadcast_to(block, end.shape) for block, end in zip(start, (run.v[-1], run.y[-1]), strict=True))
    t = run.t0 + (run.start_step + run.steps - steps) * run.dt
    return growth(run.system, run.method, run.dt, steps, t, (v, y), (run.v[-1], run.y[-1]))


def _least_growth(system: System) -> float:
    return GROWN_OF_TURNING if system.uncontrolled.velocity_term in TURNING else GROWN


def lengths(system: System, v: Array, y: Array) -> Array:
    """The length of each member's state, both blocks together, shape (*batch)."""
    axes = tuple(range(len(system.v_shape))), tuple(range(len(system.y_shape)))
    v, y = (np.asarray(block, dtype=np.float64) for block in (v, y))
    with np.errstate(all="ignore"):
        if v.ndim == len(system.v_shape) and y.ndim == len(system.y_shape):
            length = np.asarray(np.sqrt(_square(v) + _square(y)))  # for one member, ten times as fast
        else:
            length = np.asarray(np.sqrt((v * v).sum(axis=axes[0]) + (y * y).sum(axis=axes[1])))
        if (length > SQUARABLE).all() and (length < 1.0 / SQUARABLE).all():
            return length
        # The squares overflow or underflow.
        unit = np.maximum(*(np.abs(block).max(axis=own, initial=0.0) for block, own in zip((v, y), axes, strict=True)))
        unit = np.where((unit > 0.0) & (unit < np.inf), unit, 1.0)
        squares = (((block / unit) ** 2).sum(axis=own) for block, own in zip((v, y), axes, strict=True))
        return np.asarray(unit * np.sqrt(sum(squares)))


def growth(system: System, method: Method, dt: Any, steps: int, t: Any, start: State, end: State) -> Found | None:
    """The members that grew by their steps alone, or None.

    Args:
        system: the system that was stepped, with its control.
        method: the method.
        dt: the step, one for all members or one above zero for each.
        steps: the number of steps.
        t: the time at the start, one for all members or one for each.
        start: v and y at the start, spread over the batch.
        end: v and y at the end.
    """
    with np.errstate(all="ignore"):
        before, after = lengths(system, *start), lengths(system, *end)
        before = np.where(before > 0.0, before, 1.0)
        many = np.isfinite(after) & (after / before > _least_growth(system))
    n = math.prod(system.v_shape) + math.prod(system.y_shape)
    if not many.any() or n * n > MOST_NUMBERS or isinstance(system, NBody):
        return None
    if system.contacts or system.has_stick_friction or system.controller is not None:
        return None
    suspects = np.flatnonzero(many)[: MOST_NUMBERS // (n * n)]
    try:
        factors = registry.task("growth_factors")(system, method, dt, t, start, many.shape)
        radius = factors.radius(suspects)
        # The quotient may overflow; its logarithm does not.
        grown = np.log(after.reshape(-1)[suspects]) - np.log(before.reshape(-1)[suspects])
        by_steps = np.flatnonzero(steps * np.log(np.maximum(radius, 1.0)) >= BY_STEPS * grown)
        if by_steps.size:
            by_steps = by_steps[factors.rate(suspects[by_steps]) * steps <= BY_MOTION * grown[by_steps]]
    except UnsupportedError:
        return None
    if not by_steps.size:
        return None
    k = by_steps[0]
    length = float(np.broadcast_to(dt, many.shape).reshape(-1)[suspects[k]])
    why = (
        f"each step of {length:g} by {method.name} multiplies a disturbance of the start by {radius[k]:.4g}, and the motion "
        f"itself does not grow; {factors.advice(suspects[k], length)}"
    )
    between = f" grew {_power_of_ten(float(grown[k]))}-fold in {steps} steps"
    return Found(AccuracyWarning, suspects[by_steps], many.shape, "", between, ":", why)


def _power_of_ten(logarithm: float) -> str:
    """The number with this natural logarithm, written as 3e+52; it may be beyond the range of floats."""
    exponent, rest = divmod(logarithm / math.log(10.0), 1.0)
    digit = round(10.0**rest)
    return f"{digit}e+{int(exponent):02d}" if digit < 10 else f"1e+{int(exponent) + 1:02d}"


def _is_tame(run: Run, start: State) -> bool:
    """True if it is certain, without the length of each member, that none has grown: so it is for nearly all runs.

    Then all numbers at the end, taken as one vector, are not so many times as long as the shortest member at the start.
    """
    after = math.sqrt(_square(run.v[-1]) + _square(run.y[-1]))
    return any(least > SQUARABLE and after <= _least_growth(run.system) * least for least in _shortest(run, start))


def _shortest(run: Run, start: State) -> Iterator[float]:
    """Lower bounds of the lengths of all members at the start, as few as are asked for; one at rest counts as one unit long."""
    if run.status.size == 1:
        squares = _square(start[0]) + _square(start[1])
        yield math.sqrt(squares) if squares > 0.0 or any(block.any() for block in start) else 1.0
        return
    least = 0.0
    for block, shape in ((start[1], run.system.y_shape), (start[0], run.system.v_shape)):
        own = once_of(block)
        if own.size == 1:
            bound = abs(float(own.item()))  # every member has this number, so NumPy's reductions are left out
        elif not own.size:
            bound = 0.0
        elif not shape:
            bound = _smallest(own)
        else:
            bound = float(np.abs(own).max(axis=tuple(range(len(shape)))).min())
        yield bound
        least = max(least, bound)
    if least == 0.0:
        before = lengths(run.system, *start)
        yield float(np.where(before > 0.0, before, 1.0).min(initial=np.inf))


def _smallest(numbers: Array) -> float:
    """The least size of some numbers; without an array as large as they are, which takes longer than the rest."""
    low, high = float(numbers.min()), float(numbers.max())
    if not low <= 0.0 <= high:
        return min(abs(low), abs(high))
    flat, room = numbers.reshape(-1), np.empty(AT_ONCE)
    parts = (flat[first : first + AT_ONCE] for first in range(0, flat.size, AT_ONCE))
    return min(float(np.abs(part, out=room[: part.size]).min()) for part in parts)


def _square(block: Array) -> float:
    if block.size == 1:
        number = float(block.item())
        return number * number
    numbers = block.reshape(-1)
    # Not by BLAS, whose threads wait where cores are busy, and whose sums differ from machine to machine.
    return float(np.einsum("i,i->", numbers, numbers))
