"""``lyapunov``: how fast neighbouring motions separate, by the derivative of every step."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import partial
from itertools import pairwise
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.interrupts import POLL, available
from ...base.reprs import cell, counted, facts, share
from ...errors import ArgumentError, DivergenceWarning, ShapeError, UnsupportedError
from ...model.compatibility import fits_together, one_state
from ...model.derivatives.traced import Traced, together
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import System
from ...model.systems.base import a_system
from ...reference.bits import NOT_SIGN, and_bits, less, sqrt, where
from ...reference.log import log
from ...reference.trig import cos
from ...runs import engine
from ...runs.adaptive_options import check_times
from ...runs.events.members import Members
from ...runs.execution import quietly
from ..stability import maps
from ..stability.analysis import velocities
from .variational import Variational

#: Steps between two orthonormalisations by default: few enough that rounding does not make the vectors parallel.
EVERY = 10

#: About the most operations of a step before it is differentiated: as many as for a step by a series.
MAX_OPERATIONS = 100_000

#: The least operations between two orthonormalisations for which a thread is worthwhile; and the most between two checks for an
#: interruption.
OPERATIONS_OF_A_THREAD, OPERATIONS_AT_ONCE = 2_000_000, 1 << 26

#: The most operations of a tape that steps all vectors of a member.
MAX_TOGETHER = 20_000


class Lyapunov(ValueEquality):
    """Lyapunov exponents of a batch of motions.

    Attributes:
        system: the system.
        method: the method that stepped it.
        dt: the step; None with a tolerance.
        t: times up to which ``history`` averages, shape (orthonormalisations,).
        exponents: mean growth per unit of time, the largest first, shape (k, *batch).
        history: mean growth per unit of time up to each of these times, in the order of the orthonormalised vectors, shape
            (orthonormalisations, k, *batch). The changes towards the end show how far the exponents have converged.
        v: the velocities at the end, shape (*block, *batch), or what the method carries in their place.
        y: the coordinates at the end.
    """

    def __init__(
        self, system: System, method: Method, dt: float | None, t: Array, exponents: Array, history: Array, v: Array, y: Array
    ) -> None:
        self.system = system
        self.method = method
        self.dt = dt
        self.t = t
        self.exponents = exponents
        self.history = history
        self.v, self.y = v, y

    @property
    def sum(self) -> Array:
        """The sum of the exponents, shape (*batch); if these are all, the mean rate at which volumes in state space grow."""
        return np.asarray(_total(self.exponents))

    @property
    def dimension(self) -> Array:
        """The Kaplan-Yorke dimension, shape (*batch); NaN unless all exponents were computed.

        It is the largest number of leading exponents whose sum is not negative, plus the fraction of the next one that makes the
        sum zero.
        """
        k, n = len(self.exponents), sum(maps.size(self.system))
        members = self.exponents.shape[1:]
        if k < n:
            return np.full(members, np.nan)
        dimension, so_far = np.zeros(members), np.zeros(members)
        counting = np.ones(members, dtype=np.bool_)
        for each in self.exponents:
            whole = counting & (so_far + each >= 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(counting & ~whole, so_far / np.abs(each), 0.0)
            dimension = dimension + np.where(whole, 1.0, share)
            so_far, counting = so_far + each, whole
        return dimension

    def _repr_html_(self) -> str:
        pairs = [("system", repr(self.system)), ("method", self.method.title), ("averaged up to t", cell(float(self.t[-1])))]
        if self.exponents.ndim > 1:
            pairs += [("members", str(prod(self.exponents.shape[1:]))), ("largest", cell(float(np.nanmax(self.exponents))))]
        else:
            pairs += [(f"λ{i + 1}", cell(float(each))) for i, each in enumerate(self.exponents)]
        return facts("Lyapunov exponents", pairs)

    def __repr__(self) -> str:
        members = self.exponents.shape[1:]
        what = counted(prod(members), "member") if members else ", ".join(f"{each:.6g}" for each in self.exponents)
        return f"<Lyapunov exponents of {self.system!r} by {self.method.name}: {what}>"


def lyapunov(
    system: System,
    method: str | Method,
    *,
    y: Any,
    dt: float | None = None,
    steps: int | None = None,
    v: Any = None,
    exponents: int | str = 1,
    transient: int = 0,
    every: int | None = None,
    t0: float = 0.0,
    tolerance: Any = None,
    at: Any = None,
    threads: int | None = None,
) -> Lyapunov:
    """Lyapunov exponents of a motion, or of a batch: the mean rates at which small disturbances grow.

    Disturbances are stepped by the exact derivative of each step of the method. So the exponents are exactly those of the
    numerical trajectory, and those of the motion up to the method's error; a Runge-Kutta method thereby integrates the
    variational equations. At intervals the disturbances are orthonormalised and their growth is recorded (Benettin et al. 1980).
    The states are those of ``integrate``, to the bit. The core steps the state and its disturbances together, as fast as
    equations with the same number of operations.

    With ``tolerance`` and ``at`` in place of ``dt`` and ``steps`` the variational equations are integrated together with the
    motion, in adaptive steps, each member with its own. The states agree with those of ``integrate`` to this tolerance, not to
    the bit: errors of disturbances count, too, as steps that are good for a motion at rest are far too long for them.

    Args:
        system: the system; parameters may be arrays.
        method: its name, or what ``stepwell.method`` returns.
        y: coordinates at the start, shape (*block, *batch), or one number for all.
        dt: the step, in units of time, above zero; with a tolerance the step to try first, or None.
        steps: the number of steps over which growth is averaged, one or more.
        v: velocities at the start, like y; None for a system without velocities.
        exponents: how many of the largest exponents; or "all".
        transient: the number of steps before these, in which the motion approaches its attractor and disturbances their
            directions; with a tolerance, the number of intervals between the times t0 and those of ``at``.
        every: steps from one orthonormalisation to the next; 10 if None. In between, rounding must not make the vectors parallel:
            (largest − smallest)·every·dt must stay below some 30.
        t0: time of the first step.
        tolerance: as in ``integrate``, a number or a pair (relative, absolute), for series and methods with an ``error_order``.
        at: with a tolerance, the times of the orthonormalisations, ascending, after t0, and so close that the vectors do not
            become parallel in between.
        threads: how many threads share the members; None for as many as are worthwhile.

    Returns:
        ``Lyapunov``: ``exponents`` of shape (k, *batch), and their history.

    Raises:
        UnsupportedError: if the method cannot step the system, a step has no derivative, or its derivative is too long.

    Warns:
        DivergenceWarning: if members left the finite range, or stopped before the last time; their exponents are NaN.

    Example:
        >>> result = sw.lyapunov(sw.Pendulum(1.0, 0.1), "rk4", v=0.0, y=1.0, dt=0.1, steps=1000, exponents="all")
        >>> round(float(result.sum), 4)  # −2·D·ω₀
        -0.2
    """
    settings: dict[str, Any] = {"exponents": exponents, "transient": transient, "t0": t0, "keep_history": True}
    settings["threads"] = None if threads is None else checks.count("threads", threads, 1, 4096)
    if tolerance is not None or at is not None:
        if wrong := [name for name, value in (("steps", steps), ("every", every)) if value is not None]:
            raise ArgumentError(f"{', '.join(wrong)}: works with fixed steps only, and tolerance= or at= was given")
        result = adaptive_averages(system, method, v, y, tolerance, at, dt=dt, **settings)
    else:
        if missing := [name for name, value in (("dt", dt), ("steps", steps)) if value is None]:
            raise ArgumentError(f"{' and '.join(missing)}: expected with fixed steps; for adaptive steps give tolerance= and at=")
        result = averages(system, method, v, y, dt, steps, every=every, **settings)
    _warn(result.exponents)
    return result


def averages(
    system: System,
    method: str | Method,
    v: Any,
    y: Any,
    dt: Any,
    steps: Any,
    *,
    exponents: int | str,
    transient: int,
    every: int | None,
    t0: float,
    keep_history: bool,
    threads: int | None,
    look: Callable[[], object] = lambda: None,
) -> Lyapunov:
    """``lyapunov`` with fixed steps, without a warning.

    Without ``keep_history`` the history has only the last averages. ``look`` is called at each orthonormalisation.
    """
    method = find_method(method)
    system, v, y = _start(system, method, v, y)
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    t0 = checks.number("t0", t0, unit="units of time")
    steps = checks.count("steps", steps, 1)
    transient = checks.count("transient", transient, 0)
    every = min(EVERY if every is None else checks.count("every", every, 1), steps)
    n = sum(maps.size(system))
    k = _how_many(exponents, n)
    if not t0 + (transient + steps) * dt < np.inf:
        raise ArgumentError(f"dt, steps: expected a time that stays finite, got {steps} steps of {dt:g}")
    system.check_time(max(abs(t0), abs(t0 + (transient + steps) * dt)))
    members = together(system, v, y)
    _not_too_long(system, method, members, dt)
    noted = -(-steps // every) if keep_history else 1
    checks.fits("the exponents over time", noted * k + 6 * n * (k + 1), members, "take fewer steps, or a larger every=")
    v, y = checks.spread(v, system.v_shape, members), checks.spread(y, system.y_shape, members)
    tapes, count = _Tapes(system, method, k), prod(members)
    motions = _motions(tapes, engine.Plan(system, method, members, dt, t0), v, y, tapes.shares(count, every, threads))
    history = np.empty((noted, k, count))

    def average(motion: _Motion, some: slice, look: Callable[[], object]) -> None:
        for first in range(0, transient, every):
            motion.go(min(every, transient - first), look)
        motion.grown[...] = 0.0
        for first in range(0, steps, every):
            end = min(first + every, steps)
            motion.go(end - first, look)
            history[first // every if keep_history else 0][:, some] = motion.grown / (end * dt)

    if len(motions) == 1:
        average(*motions[0], look)
    else:
        _in_threads([partial(average, *each) for each in motions])
    states = np.concatenate([motion.state() for motion, _ in motions], axis=1)
    n_v = maps.size(system)[0]
    v, y = states[:n_v].reshape((*system.v_shape, *members)), states[n_v:].reshape((*system.y_shape, *members))
    ends = np.minimum(every * np.arange(1, noted + 1), steps) if keep_history else np.array([steps])
    history = history.reshape((noted, k, *members))
    return Lyapunov(system, method, dt, t0 + (transient + ends) * dt, _in_order(history[-1]), history, v, y)


def adaptive_averages(
    system: System,
    method: str | Method,
    v: Any,
    y: Any,
    tolerance: Any,
    at: Any,
    *,
    exponents: int | str,
    transient: int,
    t0: float,
    keep_history: bool,
    threads: int | None,
    dt: Any = None,
    max_steps: int | None = None,
    look: Callable[[], object] = lambda: None,
) -> Lyapunov:
    """``lyapunov`` with a tolerance, without a warning. Members that stop before the last time have exponents NaN."""
    method = find_method(method)
    system, v, y = _start(system, method, v, y)
    check_times(tolerance is not None, at)
    t0 = checks.number("t0", t0, unit="units of time")
    times = np.atleast_1d(checks.numbers("at", at, unit="units of time"))
    if times.ndim > 1:
        raise ShapeError(f"at: expected times along one axis, the same for all members, got shape {times.shape}")
    if not times.size or (np.diff(times, prepend=t0) <= 0.0).any():
        raise ArgumentError(f"at: expected times after t0 = {t0:g}, ascending, got {checks.short(at)}")
    transient = checks.count("transient", transient, 0, len(times) - 1)
    n_v, n_y = maps.size(system)
    n = n_v + n_y
    k = _how_many(exponents, n)
    of_steps = (dt, *(tolerance if isinstance(tolerance, tuple) else (tolerance,)))
    arrays = {f"tolerance[{i - 1}]" if i else "dt": each for i, each in enumerate(of_steps) if isinstance(each, np.ndarray)}
    members = together(system, v, y, **arrays)
    noted = len(times) - transient if keep_history else 1
    checks.fits("the exponents over time", noted * k + 12 * n * (k + 1), members, "take fewer times")
    count = prod(members)
    per_member = [_of_members(each, members) for each in of_steps]
    both = ((v, system.v_shape), (y, system.y_shape))
    states = np.concatenate([checks.spread(block, shape, members).reshape(prod(shape), count) for block, shape in both])
    vectors = np.array(np.broadcast_to(_orthonormal(_generic(n, k))[0][:, :, np.newaxis], (n, k, count)))
    whole = Members(engine.Plan(Variational(system, k), method, members, 1.0))
    going, left = np.arange(count), whole.plan(np.arange(count)).system
    longest, grown, history = np.zeros(count), np.zeros((k, count)), np.full((noted, k, count), np.nan)
    began = t0 if transient == 0 else float(times[transient - 1])
    for i, (begin, end) in enumerate(zip([t0, *times.tolist()], times.tolist(), strict=False)):
        # Only the directions of disturbances matter, but the error is relative to the length of the block that includes them.
        with np.errstate(over="ignore"):
            longest[going] = np.maximum(longest[going], np.sqrt((states[n_v:, going] ** 2).sum(axis=0)))
        unit = np.where(longest[going] > 0.0, longest[going], 1.0)
        beside = np.concatenate([states[n_v:, going], (unit * vectors[..., going]).reshape(n * k, -1)])
        first, *parts = (each(going) for each in per_member)
        settings: dict[str, Any] = {"tolerance": tuple(parts) if isinstance(tolerance, tuple) else parts[0]}
        settings |= {"dt": first if i == 0 else None, "max_steps": max_steps, "threads": threads}
        run = quietly(left, method, v=states[:n_v, going], y=beside, t0=begin, at=[end], **settings)
        states[:, going] = np.concatenate([run.v[-1], run.y[-1, :n_y]])
        vectors[..., going], lengths = _orthonormal(run.y[-1, n_y:].reshape(n, k, -1) / unit)
        grown[:, going] += _log(lengths)
        if (stopped := run.status != 0).any():
            going = going[~stopped]
            if not going.size:
                break
            left = whole.plan(going).system
        if i == transient - 1:
            grown[...] = 0.0
        elif i >= transient:
            history[i - transient if keep_history else 0][:, going] = grown[:, going] / (end - began)
        look()
    v, y = states[:n_v].reshape((*system.v_shape, *members)), states[n_v:].reshape((*system.y_shape, *members))
    history = history.reshape((noted, k, *members))
    return Lyapunov(system, method, None, times[-noted:], _in_order(history[-1]), history, v, y)


def _start(system: System, method: Method, v: Any, y: Any) -> tuple[System, Array, Array]:
    """The system with the shapes of the state, and the blocks of the state, checked."""
    system = a_system(system).for_state_shapes(v, y)
    fits_together(system, method)
    one_state("lyapunov", method)
    system.not_in_a_loop("lyapunov")
    v = checks.block("v", velocities(system, v), system.v_shape, system.axes)
    return system, v, checks.block("y", y, system.y_shape, system.axes)


def _of_members(value: Any, members: tuple[int, ...]) -> Callable[[Any], Any]:
    """The function that takes indices of members in the flattened batch and returns the value of each, or one for all."""
    if not isinstance(value, np.ndarray):
        return lambda _some: value
    wide = np.broadcast_to(value, members).reshape(-1)
    return lambda some: wide[some]


def _in_order(exponents: Array) -> Array:
    """The exponents, the largest first, shape (k, *members)."""
    return np.take_along_axis(exponents, np.argsort(-exponents, axis=0, kind="stable"), axis=0)


class _Tapes:
    """The tapes of a step with its derivative along vectors, and of their orthonormalisation.

    One tape steps the state and all vectors of a member, so that the state is stepped once for all of them, and another tape
    makes them orthonormal. Where these are too long, each vector is stepped with a copy of the state, and NumPy makes the vectors
    orthonormal.

    Attributes:
        n: how many numbers a state has.
        k: the number of vectors.
        together: whether one tape steps all vectors.
        operations: about how many operations a step of a member with all its vectors has.
    """

    def __init__(self, system: System, method: Method, k: int) -> None:
        traced = Traced(system, "step", method)
        self.n, self.k = traced.length, k
        self.together = k == 1 or k * len(traced.tape) + 8 * k * k * self.n <= MAX_TOGETHER
        following = traced.along(k if self.together else 1)
        self.step = traced.tape.equations([], following)
        self.operations = len(traced.tape) * (1 if self.together else k)
        if self.together:
            tape, following = _orthonormalisation(self.n, k)
            self.orthonormalise = tape.equations([], following)

    def shares(self, members: int, every: int, threads: int | None) -> int:
        """The number of threads that share the members: this one, or as many as are worthwhile for None."""
        if threads is None:
            threads = min(available(), int(members * every * self.operations // OPERATIONS_OF_A_THREAD))
        return max(1, min(threads, members))


class _Motion:
    """States and their disturbances, while the core steps them.

    Attributes:
        grown: the sum of the logarithms of the growth of each vector, shape (k, members).
    """

    def __init__(self, tapes: _Tapes, plan: engine.Plan, v: Array, y: Array) -> None:
        self.tapes = tapes
        n, k, count = tapes.n, tapes.k, plan.members
        system, method = plan.system, plan.method
        with np.errstate(all="ignore"):
            slot = method.steps.start(system.scaled(plan.dt, plan.batch), 0, plan.t0, v, y) if method.carry else v
        start = np.concatenate(
            [
                np.broadcast_to(each, (*shape, *plan.batch)).reshape(-1, count)
                for each, shape in ((slot, system.v_shape), (y, system.y_shape))
            ]
        )
        # The vectors lie along one axis before the members. They are no unit vectors, since one of these might lie in a direction
        # that never grows: at a turning point, a change of the velocity is a change along the motion.
        vectors = _orthonormal(_generic(n, k))[0][:, :, np.newaxis]
        if tapes.together:
            numbers = np.empty((n + n * k + k, count))
            self.slots, self.vectors = numbers[:n], numbers[n : n + n * k].reshape(n, k, count)
            self.slots[...], self.grown = start, numbers[n + n * k :]
            self._step = _world(plan, tapes.step, numbers[: n + n * k])
            self._orthonormalise = _world(plan, tapes.orthonormalise, numbers[n:])
        else:
            numbers = np.empty((2 * n, k, count))
            numbers[:n] = start[:, np.newaxis]
            self.slots, self.vectors, self.grown = numbers[:n, 0], numbers[n:], np.empty((k, count))
            self._step = _world(plan._replace(batch=(k, *plan.batch)), tapes.step, numbers)
        self.vectors[...], self.grown[...] = vectors, 0.0
        self._at_once = max(1, OPERATIONS_AT_ONCE // (count * tapes.operations))

    def go(self, steps: int, look: Callable[[], object]) -> None:
        """Make a number of steps, calling ``look`` now and then; then make the vectors orthonormal and record their growth."""
        for first in range(0, steps, self._at_once):
            self._step.step(min(self._at_once, steps - first))
            look()
        if self.tapes.together:
            self._orthonormalise.step(1)
        else:
            self.vectors[...], lengths = _orthonormal(self.vectors)
            self.grown += _log(lengths)

    def state(self) -> Array:
        """The velocities, or what the method carries in their place, and the coordinates, shape (n, members)."""
        return self.slots.copy()


def _motions(tapes: _Tapes, plan: engine.Plan, v: Array, y: Array, shares: int) -> list[tuple[_Motion, slice]]:
    """The motions of all members in this many shares, each with its slice of the flattened batch."""
    count = plan.members
    if shares == 1:
        return [(_Motion(tapes, plan, v, y), slice(0, count))]
    whole, edges = Members(plan), [count * i // shares for i in range(shares + 1)]
    v, y = (block.reshape((*block.shape[: block.ndim - len(plan.batch)], count)) for block in (v, y))
    parts = [slice(*each) for each in pairwise(edges)]
    return [(_Motion(tapes, whole.plan(np.arange(count)[some]), v[..., some], y[..., some]), some) for some in parts]


def _world(plan: engine.Plan, step: _core.Equations, numbers: Array) -> _core.World:
    """The world that makes this step with these numbers, in place."""
    parameters = plan.system.parameters(plan.batch, series=plan.method.has_derivatives)
    model = _core.ModelSpec(plan.system.kernel, plan.method.key, [*parameters, ("step()", step)])
    return _core.World(model, plan, np.empty(0), numbers.reshape(-1))


class _Stopped(Exception):  # noqa: N818 (not an error)
    """Another thread was interrupted, or failed."""


def _in_threads(works: Sequence[Callable[[Callable[[], object]], None]]) -> None:
    """Run each in a thread of its own; after Ctrl-C or an error the others end at their next ``look``."""
    stop = threading.Event()

    def look() -> None:
        if stop.is_set():
            raise _Stopped

    pool = ThreadPoolExecutor(len(works), thread_name_prefix="lyapunov")
    try:
        left = {pool.submit(work, look) for work in works}
        while left:
            done, left = wait(left, timeout=POLL, return_when=FIRST_EXCEPTION)
            for each in done:
                each.result()
    finally:
        stop.set()
        pool.shutdown(wait=True)


def _orthonormalisation(n: int, k: int) -> tuple[_core.Tape, list[_core.Symbol]]:
    """The tape that makes k vectors of n numbers orthonormal and adds the logarithms of their growth to sums, and its results."""
    tape = _core.Tape()
    state = np.array([tape.state(i) for i in range(n * k + k)], dtype=object)
    vectors, lengths = _orthonormal(state[: n * k].reshape(n, k))
    return tape, [*vectors.reshape(-1), *(before + _log(length) for before, length in zip(state[n * k :], lengths, strict=True))]


def _not_too_long(system: System, method: Method, members: tuple[int, ...], dt: float) -> None:
    """Raise if a step has so many operations that its derivative would take minutes and gigabytes to write."""
    if system.kernel not in _core.systems():
        return
    operations = _core.operations(engine.model(engine.Plan(system, method, members, dt)))
    if operations > MAX_OPERATIONS:
        raise UnsupportedError(
            f"lyapunov: expected a step of at most {MAX_OPERATIONS:,} operations, since it is differentiated operation by "
            f"operation, got about {operations:,} for {system!r} by {method.name}; take fewer bodies, masses or springs"
        )


def _how_many(exponents: Any, n: int) -> int:
    if isinstance(exponents, str):
        checks.known("exponents", exponents, ("all",))
        return n
    return checks.count("exponents", exponents, 1, n)


def _generic(n: int, k: int) -> Array:
    """Vectors, k of n numbers, that are unlikely to be orthogonal to any motion, with the same bits on every machine."""
    i, j = 1.0 + np.arange(n)[:, np.newaxis], np.arange(k)
    return cos(1.7 * i + 2.3 * i * j)


def _total(values: Any) -> Any:
    """The sum over the first axis, in its order."""
    return np.add.accumulate(values, axis=0)[-1]


def _largest(values: Any) -> Any:
    """The largest magnitude over the first axis."""
    largest = and_bits(values[0], NOT_SIGN)
    for each in values[1:]:
        size = and_bits(each, NOT_SIGN)
        largest = where(less(largest, size), size, largest)
    return largest


def _orthonormal(vectors: Any) -> tuple[Any, Any]:
    """The vectors made orthonormal one after the other, and the length of each one's part orthogonal to those before it.

    By Gram-Schmidt, twice for each vector, which is as accurate as Householder's method; every sum has a fixed order. The shapes
    are (n, k, *members) and (k, *members), of numbers or symbols. Vectors are scaled before their lengths are computed, so that
    nothing overflows.
    """
    done, lengths = np.empty_like(vectors), np.empty(vectors.shape[1:], vectors.dtype)
    with np.errstate(all="ignore"):
        for j in range(vectors.shape[1]):
            x = vectors[:, j]
            for _ in range(2):
                for i in range(j):
                    x = x - _total(done[:, i] * x) * done[:, i]
            size = _largest(x)
            x = x / size
            length = sqrt(_total(x * x))
            done[:, j] = x / length
            lengths[j] = size * length
    return done, lengths


def _log(x: Any) -> Any:
    """The logarithm of numbers or of a symbol: −∞ for 0 or less, and NaN for subnormal numbers, infinity and NaN."""
    ordinary = (x >= np.finfo(np.float64).tiny) & (x <= np.finfo(np.float64).max)
    with np.errstate(all="ignore"):
        return where(ordinary, log(where(ordinary, x, 1.0)), where(x <= 0.0, -np.inf, np.nan))


def _warn(exponents: Array) -> None:
    lost = np.isnan(exponents).any(axis=0)
    if lost.any():
        some = int(lost.sum())
        warnings.warn(
            f"{share(some, lost.shape, lost.size)} left the range of finite numbers; "
            f"{'its' if some == 1 else 'their'} exponents are NaN",
            DivergenceWarning,
            stacklevel=3,
        )
