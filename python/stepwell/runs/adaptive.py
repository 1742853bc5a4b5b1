"""Runs with adaptive steps: every member has steps of its own."""

from __future__ import annotations

import warnings
from contextlib import nullcontext
from functools import partial
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape, Whole
from ..base.reprs import of_member, share
from ..errors import ArgumentError, DTypeError, ShapeError, ToleranceWarning, UnsupportedError
from ..model.compatibility import forced, goes_with_series, not_of_a_step
from ..model.controls import a_control
from ..model.methods import Method
from ..model.methods import methods as every_method
from ..model.systems import System
from ..model.systems.base import TINY
from ..reference.acceptance import Acceptance
from . import continuation, engine
from . import positive as _positive
from .request import BACKENDS, BYTES_PER_TIME, NUMBERS_PER_STATE, bar_of, quantities, spread
from .result import AdaptiveState, Paces, Run
from .stops import warn_of_stops

if TYPE_CHECKING:
    from collections.abc import Callable

    from .events import Event

#: Default of ``max_steps``: the most steps of a member of a run with a tolerance.
MOST_STEPS = 1_000_000
#: An absolute tolerance above this fraction of the largest length of a block so far gives a warning.
MAX_ABSOLUTE_SHARE = 0.01


class AdaptiveOptions(NamedTuple):
    """What goes with a tolerance only, as the user gave it.

    Attributes:
        tolerance: as ``integrate`` takes it.
        at: the times at which states are saved.
        max_steps: the most attempts of a member.
        max_step: the longest step.
        jumps: times that no step crosses.
        positive: which components must not become negative.
    """

    tolerance: Any
    at: Any
    max_steps: Any = None
    max_step: Any = None
    jumps: Any = None
    positive: Any = None


def adaptive_run(
    system: System,
    how: Method,
    v: Any,
    y: Any,
    dt: Any,
    options: AdaptiveOptions,
    record: Any,
    t0: Any,
    continued_from: tuple[Any, Any, Any] | None,
    control: Any,
    force: Any,
    fused: bool,
    threads: int | None,
    backend: str,
    progress: bool,
    asked: list[Event] | None,
) -> tuple[Run, tuple[Array, Array] | None, Callable[[Whole], tuple[Array, Array, Array]]]:
    """The run with a tolerance, where it began, and a function that finds between which y some of its members have been.

    There is no start if it continues ``continued_from``: a carry, its method and what it is for.
    """
    control = _steppable(system, how, a_control(control), options, continued_from)
    t0 = checks.numbers("t0", t0, unit="units of time")
    times = checks.numbers("at", options.at, unit="units of time")
    if times.ndim == 0 or times.size == 0:
        raise ShapeError(f"at: expected times along the first axis, got shape {times.shape}")
    v = checks.block("v", v, system.v_shape, system.axes)
    y = checks.block("y", y, system.y_shape, system.axes)
    batches = {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    batches |= {"t0": t0.shape, "at": times.shape[1:]}
    checks.batch_shape(batches)  # before t0 and at are compared
    backward = _is_backward(times, t0)
    if backward and (acting := system.keeper if control is None else control) is not None and getattr(acting, "pushes", True):
        raise UnsupportedError(
            f"at: {acting!r} leads a state back to its target as time goes on, so backward in time it leads away from it; "
            f"use a projection"
        )
    sign = -1.0 if backward else 1.0
    backend = checks.known("backend", backend, BACKENDS)
    budget = MOST_STEPS if options.max_steps is None else checks.count("max_steps", options.max_steps, 1)
    acceptance = Acceptance(system.groups, positive=_positive.checked_places(system, options.positive, v, y))
    numbers = prod(system.v_shape) + prod(system.y_shape)
    groups = sum(acceptance.counts(prod(system.v_shape), prod(system.y_shape)))
    carry = None
    if continued_from is not None:
        carry = _paces_of(how, continued_from, groups, numbers)
        acceptance = acceptance._replace(own=len(carry) == engine.PACE_NUMBERS + 3 * groups + numbers)
    first = most_step = None
    if carry is not None:
        if dt is not None:
            raise ArgumentError("dt: the run that goes on has its next step already")
        batches["carry"] = carry.shape[1:]
    elif dt is not None:
        first = checks.numbers("dt", dt, unit="units of time")
        if (sign * first <= 0.0).any():
            raise ArgumentError(
                f"dt: expected a step {'below' if backward else 'above'} zero, as at= goes, got {checks.short(dt)}"
            )
        first = sign * first
        batches["dt"] = first.shape
    if options.max_step is not None:
        most_step = checks.numbers("max_step", options.max_step, positive=True, unit="units of time")
        batches["max_step"] = most_step.shape
    jumps = _jumps(system, options.jumps, t0, times)
    if jumps is not None:
        batches["jumps"] = jumps.shape[1:]
    if control is not None:
        batches |= {"control": control.batch}
    if force is not None:
        forced(system)
        force = checks.block("force", force, system.v_shape, system.axes)
        batches["force"] = force.shape[len(system.v_shape) :]
    tolerances = None
    if carry is None:
        tolerances = _tolerances(options.tolerance, system, acceptance, checks.batch_shape(batches))
        acceptance = acceptance._replace(own=tolerances.of_groups)
        shapes = {"relative": tolerances.relative.shape}
        if tolerances.absolute is not None:
            shapes["absolute"] = tolerances.absolute.shape
        batches["tolerance"] = checks.batch_shape({name: shape[tolerances.of_groups :] for name, shape in shapes.items()})
    batch = checks.batch_shape(batches)
    if carry is not None and carry.shape[1:] != batch:
        raise ShapeError(f"carry: expected that of a run of batch {batch}, got one of batch {carry.shape[1:]}")
    for end in (t0, times):
        system.check_time(float(np.abs(end).max()))
    record = quantities(system, record)
    workers = 0 if threads is None else checks.count("threads", threads, 1, 4096)
    checks.fits(
        "the saved states",
        len(times) * numbers + (NUMBERS_PER_STATE + 3) * (numbers + 1),
        batch,
        "ask for fewer times or split the batch",
        beside=len(times) * (prod(batch) if times.ndim > 1 else 1) * BYTES_PER_TIME,
    )
    t0, times = _of_the_run(t0, times, batch)
    since = sign * t0 if carry is None else np.maximum(carry[engine.TARGET], sign * t0)
    _ascending(sign * times, since, sign, carry is not None)
    v, y = spread(v, system.v_shape, batch), spread(y, system.y_shape, batch)
    ended, adapt = None, engine.adapt
    if asked is not None:
        from .events import adaptive  # only such runs need it

        ended = adaptive.AdaptiveRun(asked)
        adapt = ended.adapt
    with bar_of(f"{how.title} to t = {times[-1].max():g}") if checks.flag("progress", progress) else nullcontext(None) as told:
        if control is not None:
            system = system.controlled(control, v, y, TINY)
        relative = tolerances.relative if tolerances is not None else _relative(carry, acceptance, groups)
        order = order_of_series(how, relative.min(axis=0) if acceptance.own else relative)
        begin: Any = sign * t0 if t0.ndim else float(sign * t0)
        plan = engine.Plan(
            system, how, batch, 1.0, begin, threads=workers, backend=backend, progress=told, fused=fused, order=order,
            acceptance=acceptance, backward=backward, force=None if force is None else spread(force, system.v_shape, batch),
        )  # fmt: skip
        at = np.ascontiguousarray(sign * times)
        pacing = engine.Pacing(at, budget, carry is None, None if jumps is None else np.sort(sign * jumps, axis=0))
        if carry is None or continued_from is None:
            assert tolerances is not None
            paces = engine.paces(plan, first, tolerances, most_step, pacing)
        else:
            paces, v, y, begins = continuation.taken_up(plan, pacing, carry, str(continued_from[2]), v, y)
            pacing = pacing._replace(begins=begins)
            if most_step is not None:
                paces[engine.MOST_STEP] = most_step
        out = adapt(plan, pacing, paces, v, y)
    accepted, rejected, extra_steps = out.paces[engine.COUNTS].astype(np.int64)
    # Saved states and the step that is held for them are by the same coefficients, but where operations are fused.
    again = out.paces[engine.HELD] > 0.0 if how.has_series and not fused else extra_steps
    evaluations = out.evaluations * (accepted + rejected + again)
    stopped = np.count_nonzero(out.status) > 0
    given_again = {"max_step": options.max_step, "jumps": options.jumps, "positive": options.positive}
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
        t0=t0 if t0.ndim else t0.item(),
        start_step=0,
        steps=0,
        start=None,
        paces=Paces(sign * out.paces[engine.TIME], sign * out.paces[engine.STEP], accepted, rejected, evaluations),
        controller_state=AdaptiveState(
            out.last_v,
            out.last_y,
            _aimed(out.paces, at[-1]),
            times[-1],
            how.name,
            {name: each for name, each in given_again.items() if each is not None},
        ),
        fused=fused,
        force=plan.force,
        work=None if system.control is None else out.paces[engine.WORK] / engine.pushes(system.control, how.attempt_evaluations),
    )
    for name in record:
        run.recorded[name] = run.quantity(name)
    if stopped:
        run.stopped_at = np.where(out.status == 0, np.nan, sign * out.paces[engine.TIME])
        warn_of_stops(run)
    if not acceptance.own and (out.paces[engine.ABSOLUTE] > engine.LEAST).any():
        _warn_of_lost(out.paces, groups)
    if ended is not None:
        ended.tell(run)
    return run, (v, y) if pacing.begins else None, partial(_visited, plan, pacing, paces, v, y)


def _visited(
    plan: engine.Plan, pacing: engine.Pacing, paces: Array, v: Array, y: Array, index: Whole
) -> tuple[Array, Array, Array]:
    from .events.attempts import extremes  # only runs beside a barrier need it

    return extremes(plan, pacing, paces, v, y, index)


def _steppable(system: System, how: Method, control: Any, options: AdaptiveOptions, continued_from: Any) -> Any:
    """The control, if the method can step the system with a tolerance; what has to be given is there."""
    if how.error_order is None:
        able = ", ".join(m.name for m in every_method() if m.error_order is not None)
        raise UnsupportedError(f"tolerance: {how.name} does not estimate its error, so it cannot choose its steps; use {able}")
    if system.stick_friction is not None:
        raise UnsupportedError(
            f"tolerance: {system!r} has friction that sticks; what it does depends on the step, so the error of a step cannot be "
            f"estimated; use dt= and steps="
        )
    if system.contacts:
        raise UnsupportedError(f"tolerance: goes with systems that meet no surfaces, got {system!r}; use dt= and steps=")
    if how.has_series:
        goes_with_series(system, control)
        if options.positive is not None:
            raise UnsupportedError(
                f"positive: {how.name} rejects no step for the sign of a component; use a method that does, such as dop853"
            )
    not_of_a_step(system.keeper if control is None else control)
    if options.tolerance is not None and continued_from is not None:
        raise ArgumentError("tolerance: given twice, for carry has that of the run that goes on")
    return control


def _is_backward(times: Array, t0: Array) -> bool:
    """Whether the last times are before the start; of all members alike."""
    ahead = times[-1] - t0
    if (ahead > 0.0).any() and (ahead < 0.0).any():
        raise ArgumentError("at: expected all members to go forward in time, or all backward, got some of each")
    return bool((ahead < 0.0).any()) or (not (ahead > 0.0).any() and len(times) > 1 and bool((times[1] < times[0]).any()))


def _of_the_run(t0: Array, times: Array, batch: Shape) -> tuple[Array, Array]:
    """Times of the start and of saved states, as the run keeps them: copies, those of members over the whole batch."""
    if t0.ndim:
        t0 = spread(t0, (), batch)
    if times.ndim > 1:
        times = spread(times, times.shape[:1], batch)
    return t0.copy(), times.copy()


def _ascending(times: Array, since: Array, sign: float, goes_on: bool) -> None:
    """Raise unless times go on from where members stand, in the direction of the run."""
    ascends = (times[0] >= since) & (np.diff(times, axis=0) > 0.0).all(axis=0)
    if ascends.all():
        return
    index = tuple(np.argwhere(~ascends)[0].tolist())
    shown = (sign * (checks.member(times, index) if times.ndim > 1 else times)).tolist()
    start = sign * np.broadcast_to(since, ascends.shape)[index]
    word = "descend" if sign < 0.0 else "ascend"
    begin = f"the last time of the run that goes on, {start:g}, on" if goes_on else f"t0 = {start:g} on"
    raise ArgumentError(f"at: expected times that {word} from {begin}, got {shown[:5]}{'…' * (len(shown) > 5)}{of_member(index)}")


def _jumps(system: System, given: Any, t0: Array, times: Array) -> Array | None:
    """The times that no step crosses, ascending along the first axis: those of the user, of inputs and of the equations."""
    parts = []
    ahead = bool((times[-1] - t0).max() >= 0.0)
    if system.given_inputs():
        # Those after the last time count, too: the step that contains it goes on from there when the run is continued.
        parts.append(system.jumps(*((float(t0.min()), np.inf) if ahead else (-np.inf, float(t0.max())))))
    if system.reads_time:
        begin, end = min(float(times.min()), float(t0.min())), max(float(times.max()), float(t0.max()))
        parts.append(system.switching_times(begin, end))
    if given is not None:
        parts.append(np.atleast_1d(checks.numbers("jumps", given, unit="units of time")))
    if not any(len(part) for part in parts):
        return None
    together = checks.concatenated(parts)
    together[np.isnan(together)] = np.inf if ahead else -np.inf
    return np.unique(together) if together.ndim == 1 else np.sort(together, axis=0)


def _aimed(paces: Array, target: float) -> Array:
    """The same with another output time."""
    paces = paces.copy()
    paces[engine.TARGET] = target
    return paces


def order_of_series(method: Method, relative: Array) -> int:
    """The order of a series for relative tolerances, one for each member or all; 0 of a method that has one order.

    Of tolerances of components the least of a member counts.

    Raises:
        UnsupportedError: if they ask for different orders.
    """
    if not method.has_series or not relative.size:
        return 0
    from ..reference import series_pace  # only such runs need it

    least, most = (relative.item(),) * 2 if relative.size == 1 else (float(relative.min()), float(relative.max()))
    order = series_pace.order_of(least)
    if most != least and series_pace.order_of(most) != order:
        raise UnsupportedError(
            f"tolerance: expected tolerances of one order for all members, so that a member does not depend on others, got "
            f"{least:g} (order {order}) to {most:g} (order {series_pace.order_of(most)}); make a run for each"
        )
    return order


def _relative(carry: Any, acceptance: Acceptance, groups: int) -> Array:
    """The relative tolerances in a carry."""
    if not acceptance.own:
        return np.asarray(carry[engine.RELATIVE])
    return np.asarray(carry[engine.PACE_NUMBERS + groups : engine.PACE_NUMBERS + 2 * groups])


def _paces_of(method: Method, continued_from: tuple[Any, Any, Any], groups: int, of_state: int) -> Array:
    """The numbers that say where the members stand of a run with a tolerance that goes on, and their states there."""
    carry, carried_by, carried_for = continued_from
    for name, each, what in (("carried_by", carried_by, "the method"), ("carried_for", carried_for, "the digest")):
        if each is None:
            raise ArgumentError(f"{name}: expected {what} by which the run goes on, as run.resume has it")
    continuation.a_digest(carried_for)
    by = checks.known("carried_by", carried_by, [each.name for each in every_method()])
    if by != method.name:
        raise ArgumentError(f"carry: expected that of a run by {method.name}, got one by {by}")
    numbers = checks.numbers("carry", carry, finite=False)
    expected = [engine.PACE_NUMBERS + each * groups + of_state for each in (1, 3)]
    if numbers.shape[:1] not in [(each,) for each in expected]:
        raise ShapeError(
            f"carry: with a tolerance expected that of run.resume, {expected[0]} or {expected[1]} numbers for each member along "
            f"the first axis, got shape {numbers.shape}"
        )
    return numbers


def _tolerances(tolerance: Any, system: System, acceptance: Acceptance, batch: Shape) -> engine.Tolerances:
    """The relative one, and the absolute one of a pair: numbers over the batch, or of each component along the first axis."""
    if isinstance(tolerance, list):
        raise DTypeError(
            "tolerance: expected a number, an array, or a tuple (relative, absolute), got a list, which might be meant as "
            "either; make it a NumPy array or a tuple"
        )
    parts = tolerance if isinstance(tolerance, tuple) else (tolerance,)
    if isinstance(tolerance, tuple) and len(parts) != 2:
        raise ShapeError(f"tolerance: expected a number or a pair (relative, absolute), got {len(parts)} of them")
    relative = checks.numbers("tolerance", parts[0], positive=True)
    absolute = None if len(parts) == 1 else checks.not_negative("tolerance", parts[1])
    axes = len(system.y_shape)
    of_members = [
        part.ndim > axes and part.shape[:axes] == axes * (1,) and axes > 0 for part in (relative, absolute) if part is not None
    ]
    each = [relative] if absolute is None else [relative, absolute]
    each = [part.reshape(part.shape[axes:]) if one else part for part, one in zip(each, of_members, strict=True)]
    relative, absolute = each[0], each[1] if len(each) > 1 else None
    of_components = [not one and _is_of_components(part, system, batch) for part, one in zip(each, of_members, strict=True)]
    if not any(of_components):
        return engine.Tolerances(relative, absolute)
    of_groups = [_of_groups(part, own, system, acceptance) for part, own in zip(each, of_components, strict=True)]
    return engine.Tolerances(of_groups[0], of_groups[1] if len(of_groups) > 1 else None, of_groups=True)


def _is_of_components(part: Array, system: System, batch: Shape) -> bool:
    """Whether a tolerance is one for each component of y, shape (*block, …), and not one for each member."""
    axes = len(system.y_shape)
    fits = bool(axes) and part.ndim >= axes and part.shape[:axes] == system.y_shape
    if fits and not system.groups and part.ndim <= len(batch):
        return False  # the components of its blocks count together, so it is meant for members
    if fits and part.ndim <= len(batch) and part.shape == batch[len(batch) - part.ndim :]:
        raise ShapeError(
            f"tolerance: an array of shape {part.shape} may be meant for each component of y or for each member; give it the "
            f"shape (*block, *batch): {system.y_shape + len(batch) * (1,)} for components, {axes * (1,) + part.shape} for members"
        )
    return fits


def _of_groups(part: Array, of_components: bool, system: System, acceptance: Acceptance) -> Array:
    """A tolerance of each group: of several components the least."""
    n_v, n_y = prod(system.v_shape), prod(system.y_shape)
    groups = acceptance.groups or (0,) * n_v + (int(n_v > 0),) * n_y
    count = sum(acceptance.counts(n_v, n_y))
    if not of_components:
        return np.broadcast_to(part, (count, *part.shape))
    if n_v not in (0, n_y):
        raise ShapeError(
            f"tolerance: v and y have different shapes, {system.v_shape} and {system.y_shape}; give one number for all"
        )
    rows = part.reshape(n_y, *part.shape[len(system.y_shape) :])
    of_each = np.concatenate([rows, rows]) if n_v else rows
    least = np.full((count, *rows.shape[1:]), np.inf)
    for group, row in zip(groups, of_each, strict=True):
        least[group] = np.minimum(least[group], row)
    return least


def lost_in_tolerance(paces: Array, groups: int) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Members whose absolute tolerance is most of what a step may err, and much of the motion itself, shape (*batch).

    ``paces`` are the numbers of where they stand. The motion is that of the group that has been the largest.
    """
    absolute, relative = paces[engine.ABSOLUTE], paces[engine.RELATIVE]
    longest = paces[engine.PACE_NUMBERS : engine.PACE_NUMBERS + groups].max(axis=0, initial=0.0)
    lost = (longest > 0.0) & (absolute > relative * longest) & (absolute > MAX_ABSOLUTE_SHARE * longest)
    return np.asarray(lost, dtype=bool)


def _warn_of_lost(paces: Array, groups: int) -> None:
    """Warn of members that are lost in their absolute tolerance."""
    lost = lost_in_tolerance(paces, groups)
    if lost.any():
        warnings.warn(
            f"tolerance: for {share(int(lost.sum()), lost.shape, lost.size)} the absolute part lets a step err by more "
            f"than {MAX_ABSOLUTE_SHARE:g} of the longest that v or y has been; give one number, which goes by these lengths, or "
            f"a smaller absolute part",
            ToleranceWarning,
            stacklevel=4,
        )
