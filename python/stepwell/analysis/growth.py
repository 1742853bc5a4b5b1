"""Growth by fixed steps that are beyond their stability limit: it is finite, often for long, and means nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array, Shape, Whole
from ..base.checks import once_of
from ..base.immutable import by_value
from ..base.reprs import first_of, share
from ..errors import AccuracyWarning, DivergenceWarning, UnsupportedError
from ..model.compatibility import TURNING
from ..model.methods import Method
from ..model.systems import NBody, Springs, System
from ..runs.findings import Finding, at_places, may_have_amounts, warn_of

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

#: The warning also says the stability limit if a state has no more numbers than this.
SMALL_SYSTEM = 8

#: A world first checks its state after ``FIRST_CHECK`` steps. Each interval is twice the one before, up to ``LAST_CHECK`` steps:
#: by then a state that grows by a thousandth a step has grown a millionfold. Calls of ``step`` may be shorter or longer.
FIRST_CHECK, LAST_CHECK, ENDLESS = 8, 16_384, 1 << 62


def _grown(system: System) -> float:
    """From which growth on a state is looked at."""
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


@by_value
class Growth(NamedTuple):
    """Members that grew by their steps alone.

    Attributes:
        members: their places in the flattened batch.
        first: the place of the first of them in the batch.
        size: how much the first of them grew, in words.
        why: why it grew, and what to do.
    """

    members: Whole
    first: tuple[int, ...]
    size: str
    why: str

    @property
    def number(self) -> int:
        """How many members grew."""
        return len(self.members)

    def finding(self, shape: Shape) -> Finding:
        """The finding for a batch of this shape."""
        size = math.prod(shape)
        text = f"{share(self.number, shape, size)} {self.size}{first_of(self.number, self.first, size)}: {self.why}"
        return at_places(AccuracyWarning, text, self.members, shape)


def growth(
    system: System, method: Method, dt: Any, steps: int, t: Any, start: tuple[Array, Array], end: tuple[Array, Array]
) -> Growth | None:
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
        many = np.isfinite(after) & (after / before > _grown(system))
    n = math.prod(system.v_shape) + math.prod(system.y_shape)
    if (
        not many.any()
        or n * n > MOST_NUMBERS
        or system.contacts
        or system.has_stick_friction
        or system.controller is not None
        or isinstance(system, NBody)
    ):
        return None
    suspects = np.flatnonzero(many)[: MOST_NUMBERS // (n * n)]
    try:
        factors = _Factors(system, method, dt, t, start, many.shape)
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
    length = factors.step(suspects[k])
    why = (
        f"each step of {length:g} by {method.name} multiplies a disturbance of the start by {radius[k]:.4g}, and the motion "
        f"itself does not grow; {factors.limit(suspects[k])}"
    )
    first = tuple(int(i) for i in np.unravel_index(suspects[k], many.shape))
    return Growth(suspects[by_steps], first, f"grew {_power_of_ten(float(grown[k]))}-fold in {steps} steps", why)


def _power_of_ten(logarithm: float) -> str:
    """The number with this natural logarithm, written as 3e+52; it may be beyond the range of floats."""
    exponent, rest = divmod(logarithm / math.log(10.0), 1.0)
    digit = round(10.0**rest)
    return f"{digit}e+{int(exponent):02d}" if digit < 10 else f"1e+{int(exponent) + 1:02d}"


class _Factors:
    """The factors by which a step, and the motion itself, multiply disturbances of the start, for some members of a batch."""

    def __init__(self, system: System, method: Method, dt: Any, t: Any, start: tuple[Array, Array], batch: Shape) -> None:
        from .stability.some_members import Batch

        self._system, self._method, self._dt = system.without_inputs() if system.linear else system, method, dt
        self._each = None if np.ndim(dt) == 0 else np.broadcast_to(dt, batch).reshape(-1)
        v, y = (None, None) if system.linear else start
        self._batch = Batch(self._system, method, v, y, batch)
        self._t = np.broadcast_to(t, batch).reshape(-1) if np.ndim(t) else t

    def _own(self, members: Whole) -> tuple[System, Any, Array | None, Array | None]:
        """The system of some members, their time, and their start if the eigenvalues depend on it."""
        own, v, y = self._batch.of(members)
        return own, self._t if np.ndim(self._t) == 0 else self._t[members], v, y

    def radius(self, members: Whole) -> Array:
        """For each member the spectral radius of a step."""
        from .stability import eigen, maps

        (own, t, v, y), dt = self._own(members), np.asarray(self._dt if self._each is None else self._each[members])
        step = maps.transition(own, self._method, dt) if v is None or y is None else maps.jacobian(own, self._method, dt, t, v, y)
        return np.broadcast_to(np.abs(eigen.eigenvalues(step)).max(axis=0), members.shape)

    def rate(self, members: Whole) -> Array:
        """For each member the largest growth exponent of its rates over a step."""
        from .stability import eigen, maps

        (own, t, v, y), dt = self._own(members), self._dt if self._each is None else self._each[members]
        exponents = eigen.eigenvalues(maps.rates(own, t, v, y)).real
        return np.broadcast_to((dt * exponents).max(axis=0) if self._each is None else dt * exponents.max(axis=0), members.shape)

    def step(self, member: int) -> float:
        return float(self._dt if self._each is None else self._each[member])

    def limit(self, member: int) -> str:
        """The advice for a member, with its stability limit where that is quickly computed."""
        from .stability import maps

        if sum(maps.size(self._system)) > SMALL_SYSTEM:
            return "use a shorter step; stability_limit says how short"
        dt = self.step(member)
        if dt < 0.0 or self._method.is_implicit:  # whose growth is not that of a linear system
            return "use a shorter step"
        own, t, v, y = self._own(np.array([member]))
        if v is None and not self._system.batch:
            limit = _limit_of_linear(self._system, self._method)
        else:
            limit = _limit(own, self._method, v, y, t)
        if limit == 0.0:
            return f"{self._method.name} is stable with no step here: take rk4 with a short one, or implicit_midpoint"
        return f"its stability limit is {limit:.6g}" if limit < dt else "use a shorter step"


def _limit(system: System, method: Method, v: Array | None, y: Array | None, t: Any) -> float:
    from .stability.limit import limit_of

    return float(np.max(limit_of(system, method, v, y, t).stable))


@lru_cache(maxsize=64)
def _limit_of_linear(system: System, method: Method) -> float:
    """Kept, since it takes longer to find than most runs, and often one system runs with one step after another."""
    return _limit(system, method, None, None, 0.0)


def _square(block: Array) -> float:
    """The sum of the squares of all numbers."""
    if block.size == 1:
        number = float(block.item())
        return number * number
    numbers = block.reshape(-1)
    # Not by BLAS, whose threads wait where cores are busy, and whose sums differ from machine to machine.
    return float(np.einsum("i,i->", numbers, numbers))


def finding_of(run: Any, start: tuple[Array, Array]) -> Finding | None:
    """The finding for the members of a run with fixed steps that grew by its steps alone, from this start; None if none did."""
    if _is_tame(run, start) or (grown := _of_run(run, start, run.steps)) is None:
        return None
    return grown.finding(run.status.shape)


def of_last_piece(run: Any, start: tuple[Array, Array], steps: int) -> Growth | None:
    """The members that grew by this many fixed steps alone; the last of these steps are those of the run."""
    return None if _is_tame(run, start) else _of_run(run, start, steps)


def _of_run(run: Any, start: tuple[Array, Array], steps: int) -> Growth | None:
    v, y = (np.broadcast_to(block, end.shape) for block, end in zip(start, (run.v[-1], run.y[-1]), strict=True))
    t = run.t0 + (run.start_step + run.steps - steps) * run.dt
    return growth(run.system, run.method, run.dt, steps, t, (v, y), (run.v[-1], run.y[-1]))


def _is_tame(run: Any, start: tuple[Array, Array]) -> bool:
    """True if it is certain, without the length of each member, that none has grown: so it is for nearly all runs.

    Then all numbers at the end, taken as one vector, are not so many times as long as the shortest member at the start.
    """
    after = math.sqrt(_square(run.v[-1]) + _square(run.y[-1]))
    return any(least > SQUARABLE and after <= _grown(run.system) * least for least in _shortest(run, start))


def _shortest(run: Any, start: tuple[Array, Array]) -> Iterator[float]:
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


def watched(
    make: Callable[..., bool], loop: Any, system: System, method: Method, dt: float, v: Array, y: Array, grows: bool
) -> Callable[..., None]:
    """``make``, the ``step`` of a world, that warns once if the state is no longer finite.

    With ``grows``, it checks the state now and then as well, and warns once of growth by steps alone.
    """
    grows = grows and v.size + y.size <= MOST_NUMBERS
    start = (np.array(v, dtype=np.float64), np.array(y, dtype=np.float64)) if grows else (v, y)
    first, t0 = loop.step_number, loop.t
    every, has_diverged = FIRST_CHECK, False
    left = every if grows else ENDLESS
    waits, pause = 0, 1

    def check() -> int:
        """Check the state, and return the number of steps until the next check, ``ENDLESS`` if there is none."""
        nonlocal every
        if loop.changes:
            return ENDLESS  # what was set may explain the growth
        grown = growth(system, method, dt, loop.step_number - first, t0, start, (v, y))
        if grown is not None:
            warn_of([grown.finding(v.shape[len(system.v_shape) :])], 3)
            return ENDLESS
        about = system.doubt(y[np.newaxis])
        if isinstance(system, Springs) and system.keeper is None and about is None:
            from ..runs import known_energy  # only such worlds need it

            of = SimpleNamespace(system=system, method=method, dt=dt)
            about = known_energy.gain(of, list(zip(start, (v, y), strict=True)), known_energy.GAINED)
        if about is not None:
            warn_of([Finding(AccuracyWarning, *about)], 3)
            return ENDLESS
        every *= 2
        return every if every <= LAST_CHECK else ENDLESS

    def diverged() -> None:
        nonlocal has_diverged
        has_diverged = True
        both = zip((v, y), (system.v_shape, system.y_shape), strict=True)
        lost = np.any([~np.isfinite(block).all(axis=tuple(range(len(own)))) for block, own in both], axis=0)
        which = first_of(int(lost.sum()), tuple(np.argwhere(lost)[0].tolist()), lost.size)
        where = f"step {loop.step_number} (t = {loop.t:g}), by {method.name} with dt = {dt:g}"
        text = f"{share(int(lost.sum()), lost.shape, lost.size, 'the state')} diverged{which}, before {where}"
        warn_of([Finding(DivergenceWarning, text, lost)], 3)

    def step(n: int = 1) -> None:
        """Make n steps in place."""
        nonlocal left
        if make(n) and not has_diverged:
            diverged()
        left -= n or 1  # None is one step, too
        if left <= 0:
            left = check()

    if not (grows and y.size and may_have_amounts(system)):
        return step
    from ..runs.negative import negative  # only such worlds need it

    def step_of_amounts(n: int = 1) -> None:
        """Make n steps in place; after calls 1, 2, 4, … negative numbers are looked for, which takes ten times a short step."""
        nonlocal waits, pause
        waits -= 1
        looks = waits <= 0 and not y.min() < 0.0  # else it was set so
        step(n)
        if waits > 0:
            return
        waits = pause = min(2 * pause, LAST_CHECK)
        if not looks or loop.changes or not y.min() < 0.0:
            return
        if (amounts := negative(system, method, (start[1], y), loop.t)) is not None:
            warn_of([amounts.finding(v.shape[len(system.v_shape) :])], 2)
            waits = ENDLESS

    return step_of_amounts
