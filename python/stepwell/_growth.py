"""Growth by fixed steps that are beyond their stability limit: it is finite, often for long, and means nothing."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ._brief import first_of, share
from ._checks import Array, Shape, member
from .errors import AccuracyWarning, UnsupportedError
from .method_records import Method
from .systems import NBody, System

#: A state that is so many times as long as at the start is looked at; from rest, so many units long.
GROWN = 1e6

#: Lengths between this and its reciprocal have squares with all of their digits.
SQUARABLE = 1e-140

#: The step explains growth if its eigenvalues make at least this share of its logarithm, and those of the rates at most that.
BY_STEPS, BY_MOTION = 0.5, 0.25

#: Matrices of more numbers, for all members together, are not computed.
MOST_NUMBERS = 1_000_000

#: Of systems of up to so many numbers a state the limit is told, too.
SMALL_SYSTEM = 8

#: A world checks its state after so many calls of ``step``, then after twice as many more, and so on up to the last number:
#: what grows by a thousandth a step has grown a million times by then.
FIRST_LOOK, LAST_LOOK = 8, 16_384


def lengths(system: System, v: Array, y: Array) -> Array:
    """The length of each member's state, both blocks together, shape (*batch)."""
    axes = tuple(range(len(system.v_shape))), tuple(range(len(system.y_shape)))
    v, y = (np.asarray(block, dtype=np.float64) for block in (v, y))
    with np.errstate(all="ignore"):
        if v.ndim == len(system.v_shape) and y.ndim == len(system.y_shape):
            length = np.asarray(np.sqrt(np.vdot(v, v) + np.vdot(y, y)))  # of one member, ten times as fast
        else:
            length = np.asarray(np.sqrt((v * v).sum(axis=axes[0]) + (y * y).sum(axis=axes[1])))
        if (length > SQUARABLE).all() and (length < 1.0 / SQUARABLE).all():
            return length
        # Squares beyond what a float has.
        unit = np.maximum(*(np.abs(block).max(axis=own, initial=0.0) for block, own in zip((v, y), axes, strict=True)))
        unit = np.where((unit > 0.0) & (unit < np.inf), unit, 1.0)
        squares = (((block / unit) ** 2).sum(axis=own) for block, own in zip((v, y), axes, strict=True))
        return np.asarray(unit * np.sqrt(sum(squares)))


def text_of(
    system: System, method: Method, dt: float, steps: int, t: float, start: tuple[Array, Array], before: Array, after: Array
) -> str | None:
    """What is to be said of members that grew, or None.

    Args:
        system: what was stepped, with its control.
        method: by which.
        dt: the step.
        steps: how many were made.
        t: the time of the start.
        start: v and y there.
        before: the members' lengths there.
        after: and at the end.
    """
    with np.errstate(all="ignore"):
        grown = np.log(after) - np.log(np.where(before > 0.0, before, 1.0))  # the quotient may be no float
        many = np.isfinite(after) & (grown > math.log(GROWN))
    if not many.any() or system.contacts or system.rubbing is not None or isinstance(system, NBody):
        return None
    index = tuple(np.argwhere(many)[0].tolist())
    try:
        radius, rate = _eigenvalues(system, method, dt, t, start, many.shape, index) or (0.0, 0.0)
    except UnsupportedError:
        return None
    told, made = float(grown[index]), steps * math.log(max(radius, 1.0))
    if not (made >= BY_STEPS * told and rate * dt * steps <= BY_MOTION * told):
        return None
    some = int(np.count_nonzero(many))
    return (
        f"{share(some, many.shape, many.size)} grew {_power_of_ten(told)}-fold in {steps} steps"
        f"{first_of(some, index, many.size)}: each step of {dt:g} by {method.name} multiplies a disturbance of the start by "
        f"{radius:.4g}, and the motion itself does not grow; {_limit(system, method, dt, t, start, index)}"
    )


def _power_of_ten(logarithm: float) -> str:
    """A number, as 3e+52, of its natural logarithm; it may be beyond the floats."""
    exponent, rest = divmod(logarithm / math.log(10.0), 1.0)
    digit = round(10.0**rest)
    return f"{digit}e+{int(exponent):02d}" if digit < 10 else f"1e+{int(exponent) + 1:02d}"


def _eigenvalues(
    system: System, method: Method, dt: float, t: float, start: tuple[Array, Array], batch: Shape, index: tuple[int, ...]
) -> tuple[float, float] | None:
    """The largest magnitude of an eigenvalue of a member's step at the start, and the largest growth of its rates."""
    from .stability import eigen, maps

    n = sum(maps.size(system))
    if n * n * math.prod(batch) > MOST_NUMBERS:
        return None
    at = (None, None) if system.linear else start
    rates = maps.rates(system, t, *at)
    step = (
        maps.transition(system, method, np.asarray(dt))
        if system.linear
        else maps.jacobian(system, method, np.asarray(dt), t, *start)
    )
    aligned = (each.reshape(n, n, *(len(batch) + 2 - each.ndim) * (1,), *each.shape[2:]) for each in (rates, step))
    rate, step = (member(np.broadcast_to(each, (n, n, *batch)), index) for each in aligned)
    return float(np.abs(eigen.eigenvalues(step)).max()), float(eigen.eigenvalues(rate).real.max())


def _limit(system: System, method: Method, dt: float, t: float, start: tuple[Array, Array], index: tuple[int, ...]) -> str:
    """What to do, with the limit where it is known in a moment."""
    from .stability import maps
    from .stability.limit import limit_of

    if sum(maps.size(system)) > SMALL_SYSTEM or index:
        return "use a shorter step; stability_limit says how short"
    v, y = (None, None) if system.linear else start
    limit = limit_of(system, method, v, y, t).stable
    if limit == 0.0:
        return f"{method.name} is stable with no step here, use another method"
    return f"its stability limit is {limit:.6g}" if limit < dt else "use a shorter step"


def _square(block: Array) -> float:
    """The sum of the squares of all numbers; of one in a tenth of the time."""
    if block.size == 1:
        number = float(block.item())
        return number * number
    return float(np.vdot(block, block))


def warn_of(run: Any, start: tuple[Array, Array] | None) -> None:
    """Warn of members of a run with fixed steps that grew by its steps alone.

    Nearly all runs are seen to be tame by the squares of all their numbers.
    """
    if start is None:
        return
    ends = run.v[-1], run.y[-1]
    begun, ended = _square(start[0]) + _square(start[1]), _square(ends[0]) + _square(ends[1])
    tame = ended * ends[1].size <= GROWN * GROWN * begun * start[1].size
    if tame and (begun > SQUARABLE**2 or not any(block.any() for block in ends)):
        return
    v, y = (np.broadcast_to(block, end.shape) for block, end in zip(start, ends, strict=True))
    before, after = (lengths(run.system, *blocks) for blocks in ((v, y), ends))
    text = text_of(run.system, run.method, run.dt, run.steps, run.t0 + run.start_step * run.dt, (v, y), before, after)
    if text is not None:
        warnings.warn(text, AccuracyWarning, stacklevel=3)


def watched(loop: Any, system: System, method: Method, dt: float, v: Array, y: Array) -> Callable[..., None]:
    """The ``step`` of a world's loop, which checks the state from time to time, and warns once of growth by steps alone."""
    make: Callable[..., None] = loop.step
    if v.size + y.size > MOST_NUMBERS:
        return make
    v0, y0 = (np.array(block, dtype=np.float64) for block in (v, y))
    first, t0, before = loop.step_number, loop.t, lengths(system, v0, y0)
    left = every = FIRST_LOOK

    def look() -> int:
        """How many calls there are until the next check; below zero if there is none."""
        nonlocal every
        after = lengths(system, *(np.asarray(block, dtype=np.float64) for block in (v, y)))
        if np.any(after > GROWN * before):
            text = text_of(system, method, dt, loop.step_number - first, t0, (v0, y0), before, after)
            if text is not None:
                warnings.warn(text, AccuracyWarning, stacklevel=3)
                return -1
        every *= 2
        return every if every <= LAST_LOOK else -1

    def step(n: int = 1) -> None:
        """Make n steps in place."""
        nonlocal left
        make(n)
        left -= 1
        if left == 0:
            left = look()

    return step
