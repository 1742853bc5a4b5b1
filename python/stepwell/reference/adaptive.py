"""Steps of chosen length: each member takes its own, so long that the estimate of its error stays within a tolerance.

The increments of a step h are h times those of a step of 1, so a system is scaled once and stretched to every step.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .types import Array, Blocks, Scaled, Whole

#: A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
#: (PI control, Gustafsson 1988), held between LEAST and MOST; after a rejected step there is no p and no growth. Where the error
#: is estimated in a higher order than LOW, it is SAFETY·r^(−3/32)·p^(1/32). The powers are dyadic so that square roots make them,
#: which are the same to the last bit everywhere.
SAFETY, LEAST, MOST = 0.9, 0.2, 5.0
LOW = 5
#: r below TINY counts as TINY; p's root, the sixteenth or the thirty-second, is that of 1e-4 or more.
TINY, CALM_ROOTS = 1e-10, (0.5623413251903491, 0.7498942093324558)

OK, BUDGET, UNDERFLOW, NOT_FINITE = 0, 2, 3, 4

#: ``attempt(s, t, h, v, y)``: the state after a step, the estimate of its error, and one that corrects it, if the method has one.
Attempt = Callable[[Scaled, Array, Array, Array, Array], tuple[Blocks, Blocks, Blocks | None]]


class Stretched:
    """A system scaled to a step of 1, stretched to each member's step."""

    def __init__(self, s: Scaled, h: Array) -> None:
        self.s, self.h = s, h

    def dv(self, t: Array, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.h * self.s.dv(t, v, y)  # type: ignore[arg-type, operator]  # a time for each member

    def dy(self, t: Array, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * self.s.dy(t, v, y)  # type: ignore[arg-type, operator]


class Outcome(NamedTuple):
    """Kept states, and for each member where it stands: time, next step, accepted and rejected steps, status."""

    v: Array
    y: Array
    t: Array
    h: Array
    accepted: Whole
    rejected: Whole
    status: Whole


def run(
    attempt: Attempt,
    s: Scaled,
    v: Array,
    y: Array,
    block_axes: tuple[int, int],
    *,
    t0: float,
    at: Sequence[float],
    first: Array,
    relative: Array,
    absolute: Array,
    budget: int,
    order: int,
) -> Outcome:
    """Go from t0 to each time of ``at``, ascending, exactly. Members that stop before have NaN from there on.

    ``order`` is the one in which the error is estimated.
    """
    batch, high = first.shape, order > LOW
    t, h, before, most = np.full(batch, t0), first, np.ones(batch), np.full(batch, MOST)
    accepted, rejected, error = np.zeros(batch), np.zeros(batch), np.zeros(batch)
    kept_v, kept_y = [], []
    with np.errstate(all="ignore"):
        for target in at:
            while True:
                rest = target - t
                last = h >= rest
                step = np.where(last, rest, h)
                running = (t < target) & (t + step > t) & (accepted + rejected < budget)
                if not running.any():
                    break
                (v1, y1), error_of, coarse_of = attempt(Stretched(s, step), t, step, v, y)  # type: ignore[arg-type]
                tolerated = [
                    allowed(old, new, axes, relative, absolute)
                    for old, new, axes in zip((v, y), (v1, y1), block_axes, strict=True)
                ]
                r2 = over(error_of, tolerated, block_axes)
                if coarse_of is not None:
                    r2 = np.where(r2 > 0.0, (r2 * r2) / (r2 + 0.01 * over(coarse_of, tolerated, block_axes)), r2)
                good = r2 <= 1.0  # NaN is not
                floored = np.where(r2 > TINY * TINY, r2, TINY * TINY)
                r16 = np.sqrt(np.sqrt(np.sqrt(np.sqrt(floored))))  # the eighth root of r
                r32 = np.sqrt(r16)
                r64 = np.sqrt(r32)
                factor = SAFETY / ((r32 if high else r16) * r64)
                factor = np.where(good, factor * before, factor)
                factor = np.where(factor > LEAST, factor, LEAST)
                ceiling = np.where(good, most, 1.0)
                factor = np.where(factor < ceiling, factor, ceiling)
                factor = np.where(r2 < np.inf, factor, LEAST)
                grown = step * factor
                # A step that was cut to end at the target says little: what was meant before it stands.
                grown = np.where(good & last & (grown < h), h, grown)
                took = running & good
                t = np.where(took, np.where(last, target, t + step), t)
                v, y = np.where(took, v1, v), np.where(took, y1, y)
                h = np.where(running, grown, h)
                root, calm = (r64, CALM_ROOTS[1]) if high else (r32, CALM_ROOTS[0])
                before = np.where(took, np.where(root > calm, root, calm), before)
                most = np.where(running, np.where(good, MOST, 1.0), most)
                accepted, rejected = accepted + took, rejected + (running & ~good)
                error = np.where(running, r2, error)
            there = t >= target
            kept_v.append(np.where(there, v, np.nan))
            kept_y.append(np.where(there, y, np.nan))
    done = t >= at[-1]
    spent = accepted + rejected >= budget
    status = np.where(done, OK, np.where(spent, BUDGET, np.where(error < np.inf, UNDERFLOW, NOT_FINITE)))
    return Outcome(
        np.stack(kept_v), np.stack(kept_y), t, h, accepted.astype(np.int64), rejected.astype(np.int64), status.astype(np.int64)
    )


def allowed(old: Array, new: Array, axes: int, relative: Array, absolute: Array) -> Array:
    """The square of the length of an error that is tolerated in a block: relative to the longer of the old and the new one."""
    a, b = length2(old, axes), length2(new, axes)
    length = absolute + relative * np.sqrt(np.where(a > b, a, b))
    return np.asarray(length * length)


def over(error: Blocks, tolerated: Sequence[Array], block_axes: tuple[int, int]) -> Array:
    """The square of an error over what is tolerated, of both blocks together."""
    (ev, ey), (nv, ny) = error, block_axes
    return np.asarray(length2(ev, nv) / tolerated[0] + length2(ey, ny) / tolerated[1])


def length2(block: Array, axes: int) -> Array:
    """The square of a block's length, number after number."""
    total = np.zeros(block.shape[axes:])
    for number in block.reshape((-1, *block.shape[axes:])):
        total = total + number * number
    return total
