"""Runs with adaptive steps: every member has steps of its own."""

from __future__ import annotations

import warnings
from contextlib import nullcontext
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _checks, _going_on, engine
from ._brief import share
from ._checks import Array
from ._runs import BACKENDS, BYTES_PER_TIME, NUMBERS_PER_STATE, bar_of, quantities, spread
from ._stops import warn_of_stops
from .compatible import goes_with_series, not_of_a_step
from .control import a_control
from .errors import ArgumentError, DTypeError, ShapeError, ToleranceWarning, UnsupportedError
from .method_records import Method
from .method_records import methods as every_method
from .result import AdaptiveState, Paces, Run
from .systems import System
from .systems.base import TINY

if TYPE_CHECKING:
    from .events import Event
    from .reference.adaptive import Pace

#: Default of ``max_steps``: the most steps of a member of a run with a tolerance.
MOST_STEPS = 1_000_000
#: An absolute tolerance above this fraction of the largest length of a block so far gives a warning.
MAX_ABSOLUTE_SHARE = 0.01


def adaptive_run(
    system: System,
    how: Method,
    v: Any,
    y: Any,
    dt: Any,
    tolerance: Any,
    at: Any,
    max_steps: Any,
    record: Any,
    t0: Any,
    went: tuple[Any, Any, Any] | None,
    control: Any,
    fused: bool,
    threads: int | None,
    backend: str,
    progress: bool,
    asked: list[Event] | None,
) -> tuple[Run, tuple[Array, Array] | None]:
    """The run with a tolerance, and where it began, if it did not go on from ``went``: a carry, its method and what it is for."""
    if how.error_order is None:
        able = ", ".join(m.name for m in every_method() if m.error_order is not None)
        raise UnsupportedError(f"tolerance: {how.name} does not estimate its error, so it cannot choose its steps; use {able}")
    if system.rubbing is not None:
        raise UnsupportedError(
            f"tolerance: {system!r} has friction that sticks; what it does depends on the step, so the error of a step cannot be "
            f"estimated; use dt= and steps="
        )
    if system.contacts:
        raise UnsupportedError(f"tolerance: goes with systems that meet no surfaces, got {system!r}; use dt= and steps=")
    control = a_control(control)
    if how.has_series:
        goes_with_series(system, control)
    not_of_a_step(system.keeper if control is None else control)
    if at is None or (tolerance is None) == (went is None):
        if at is not None and went is not None:
            raise ArgumentError("tolerance: given twice, for carry has that of the run that goes on")
        raise ArgumentError(f"{'at' if at is None else 'tolerance'}: expected too, since the other was given")
    t0 = _checks.number("t0", t0, unit="units of time")
    times = _checks.numbers("at", at, unit="units of time")
    if times.ndim != 1 or len(times) == 0:
        raise ShapeError(f"at: expected times along one axis, got shape {times.shape}")
    carry = None if went is None else _paces_of(system, how, went)
    since = t0 if carry is None else float(carry[engine.TARGET].max(initial=t0))
    if times[0] < since or (len(times) > 1 and (np.diff(times) <= 0).any()):
        begin = f"t0 = {t0:g} on" if carry is None else f"the last time of the run that goes on, {since:g}, on"
        raise ArgumentError(f"at: expected times that ascend from {begin}, got {times[:5].tolist()}{'…' * (len(times) > 5)}")
    last = float(times[-1])
    system.check_time(max(abs(t0), abs(last)))
    backend = _checks.known("backend", backend, BACKENDS)
    budget = MOST_STEPS if max_steps is None else _checks.count("max_steps", max_steps, 1)
    v = _checks.block("v", v, system.v_shape, system.axes)
    y = _checks.block("y", y, system.y_shape, system.axes)
    batches = {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    if carry is None:
        relative, absolute = _tolerances(tolerance)
        first = None if dt is None else _checks.numbers("dt", dt, positive=True, unit="units of time")
        tolerances = {"relative": relative.shape} | ({} if absolute is None else {"absolute": absolute.shape})
        batches["tolerance"] = _checks.batch_shape(tolerances)
        if first is not None:
            batches["dt"] = first.shape
    else:
        if dt is not None:
            raise ArgumentError("dt: the run that goes on has its next step already")
        batches["carry"] = carry.shape[1:]
    if control is not None:
        batches |= {"control": control.batch}
    batch = _checks.batch_shape(batches)
    if carry is not None and carry.shape[1:] != batch:
        raise ShapeError(f"carry: expected that of a run of batch {batch}, got one of batch {carry.shape[1:]}")
    record = quantities(system, record)
    workers = 0 if threads is None else _checks.count("threads", threads, 1, 4096)
    numbers = prod(system.v_shape) + prod(system.y_shape)
    _checks.fits(
        "the saved states",
        len(times) * numbers + NUMBERS_PER_STATE * (numbers + 1),
        batch,
        "ask for fewer times or split the batch",
        beside=len(times) * BYTES_PER_TIME,
    )
    v, y = spread(v, system.v_shape, batch), spread(y, system.y_shape, batch)
    ended, adapt = None, engine.adapt
    if asked is not None:
        from .events import adaptive  # only such runs need it

        ended = adaptive.AdaptiveRun(asked)
        adapt = ended.adapt
    with bar_of(f"{how.title} to t = {times[-1]:g}") if _checks.flag("progress", progress) else nullcontext(None) as told:
        if control is not None:
            system = system.controlled(control, v, y, TINY)
        order = order_of_series(how, relative if carry is None else carry[engine.RELATIVE])
        plan = engine.Plan(system, how, batch, 1.0, t0, threads=workers, backend=backend, progress=told, fused=fused, order=order)
        if went is None or carry is None:
            paces, begins = engine.paces(plan, first, relative, absolute), True
        else:
            paces, v, y, begins = _going_on.taken_up(system, carry, str(went[2]), v, y)
        out = adapt(plan, engine.Pacing(np.ascontiguousarray(times), budget, begins), paces, v, y)
    accepted, rejected, extra_steps = out.paces[engine.COUNTS].astype(np.int64)
    # Saved states and the step that is held for them are by the same coefficients, but where operations are fused.
    again = out.paces[engine.HELD] > 0.0 if how.has_series and not fused else extra_steps
    evaluations = out.evaluations * (accepted + rejected + again)
    stopped = np.count_nonzero(out.status) > 0
    run = Run(
        t=times,
        v=out.v,
        y=out.y,
        status=out.status.astype(np.int8),
        first_bad_step=np.where(out.status == 0, -1, accepted + 1) if stopped else np.full(batch, -1),
        carry=None,
        system=system,
        method=how,
        dt=1.0,
        t0=t0,
        start_step=0,
        steps=0,
        start=None,
        paces=Paces(out.paces[engine.TIME], out.paces[engine.STEP], accepted, rejected, evaluations),
        stand=AdaptiveState(out.last_v, out.last_y, _aimed(out.paces, last), last, how.name),
        fused=fused,
        work=None if system.control is None else out.paces[engine.WORK] / engine.pushes(system.control, how.attempt_evaluations),
    )
    for name in record:
        run.recorded[name] = run.quantity(name)
    if stopped:
        run.stopped_at = np.where(out.status == 0, np.nan, out.paces[engine.TIME])
        warn_of_stops(run)
    if np.count_nonzero(out.paces[engine.ABSOLUTE]):
        _warn_of_lost(engine.pace_of(out.paces, batch))
    if ended is not None:
        ended.tell(run)
    return run, (v, y) if begins else None


def _aimed(paces: Array, target: float) -> Array:
    """The same with another output time."""
    paces = paces.copy()
    paces[engine.TARGET] = target
    return paces


def order_of_series(method: Method, relative: Array) -> int:
    """The order of a series for relative tolerances; 0 of a method that has one order.

    Raises:
        UnsupportedError: if they ask for different orders.
    """
    if not method.has_series or not relative.size:
        return 0
    from .reference import series_pace  # only such runs need it

    least, most = (relative.item(),) * 2 if relative.size == 1 else (float(relative.min()), float(relative.max()))
    order = series_pace.order_of(least)
    if most != least and series_pace.order_of(most) != order:
        raise UnsupportedError(
            f"tolerance: expected tolerances of one order for all members, so that a member does not depend on others, got "
            f"{least:g} (order {order}) to {most:g} (order {series_pace.order_of(most)}); make a run for each"
        )
    return order


def _paces_of(system: System, method: Method, went: tuple[Any, Any, Any]) -> Array:
    """The numbers that say where the members stand of a run with a tolerance that goes on, and their states there."""
    carry, carried_by, carried_for = went
    for name, each, what in (("carried_by", carried_by, "the method"), ("carried_for", carried_for, "the digest")):
        if each is None:
            raise ArgumentError(f"{name}: expected {what} by which the run goes on, as run.resume has it")
    _going_on.a_digest(carried_for)
    by = _checks.known("carried_by", carried_by, [each.name for each in every_method()])
    if by != method.name:
        raise ArgumentError(f"carry: expected that of a run by {method.name}, got one by {by}")
    numbers = _checks.numbers("carry", carry, finite=False)
    of_state = prod(system.v_shape) + prod(system.y_shape)
    if numbers.shape[:1] != (engine.PACE_NUMBERS + of_state,):
        raise ShapeError(
            f"carry: with a tolerance expected that of run.resume, {engine.PACE_NUMBERS} numbers for each member and the "
            f"{of_state} of its state along the first axis, got shape {numbers.shape}"
        )
    return numbers


def _tolerances(tolerance: Any) -> tuple[Array, Array | None]:
    """The relative one, and the absolute one of a pair."""
    if isinstance(tolerance, list):
        raise DTypeError(
            "tolerance: expected a number, an array over the batch, or a tuple (relative, absolute), got a list, which might be "
            "meant as either; make it a NumPy array or a tuple"
        )
    if not isinstance(tolerance, tuple):
        return _checks.numbers("tolerance", tolerance, positive=True), None
    if len(tolerance) != 2:
        raise ShapeError(f"tolerance: expected a number or a pair (relative, absolute), got {len(tolerance)} of them")
    relative, absolute = (_checks.numbers("tolerance", each, positive=True) for each in tolerance)
    return relative, absolute


def lost_in_tolerance(pace: Pace) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Members whose absolute tolerance is most of what a step may err, and much of the motion itself, shape (*batch)."""
    lost = np.zeros(pace.t.shape, dtype=bool)
    if not pace.absolute.any():
        return lost
    for square in (pace.longest_v, pace.longest_y):
        longest = np.sqrt(square)
        lost |= (longest > 0.0) & (pace.absolute > pace.relative * longest) & (pace.absolute > MAX_ABSOLUTE_SHARE * longest)
    return lost


def _warn_of_lost(pace: Pace) -> None:
    """Warn of members that are lost in their absolute tolerance."""
    lost = lost_in_tolerance(pace)
    if lost.any():
        warnings.warn(
            f"tolerance: for {share(int(lost.sum()), lost.shape, lost.size)} the absolute part lets a step err by more "
            f"than {MAX_ABSOLUTE_SHARE:g} of the longest that v or y has been; give one number, which goes by these lengths, or "
            f"a smaller absolute part",
            ToleranceWarning,
            stacklevel=4,
        )
