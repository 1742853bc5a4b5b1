"""Everything that is asked of a run: checked here, once, before any work.

``integrate`` makes a ``Request`` of its arguments; so do ``World``, ``explain`` and ``export`` of theirs, and whatever makes many
runs. What stands beside each other in a constructor is what an option goes with.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape, Whole
from ..base.reprs import of_member
from ..errors import ArgumentError, ShapeError, UnsupportedError
from ..model.compatibility import (
    fits_own_times,
    fits_together,
    forced,
    goes_back,
    goes_on_by_a_rule,
    goes_with_series,
    not_of_a_step,
    velocities,
)
from ..model.controls import ConstraintControl, EnergyControl, a_control
from ..model.methods import Method
from ..model.methods import method as find_method
from ..model.methods import methods as every_method
from ..model.systems import Sinusoid, System
from ..model.systems.base import TINY, a_system
from ..reference.acceptance import Acceptance
from . import continuation, engine, positive
from .result import AdaptiveState
from .tolerance import order_of_series, tolerances_of

if TYPE_CHECKING:
    from ..base.literals import Backend, RunForm
    from .continuation import Continuation
    from .events import Event

FORMS: tuple[RunForm, ...] = ("direct", "matrix", "power")
BACKENDS: tuple[Backend, ...] = ("rust", "numpy")

#: The memory of a run besides its saved states: so many numbers for each number of a state (the start, the carry, the final
#: state), and so many bytes for each saved time (its step number and the time).
NUMBERS_PER_STATE, BYTES_PER_TIME = 4, 16

#: Default of ``max_steps``: the most steps of a member of a run with a tolerance.
MOST_STEPS = 1_000_000


class Options(NamedTuple):
    """What a user says of a run, unchecked: the arguments of ``integrate`` in their order, None where nothing was said."""

    v: Any = None
    y: Any = None
    dt: Any = None
    steps: Any = None
    every: Any = None
    tolerance: Any = None
    at: Any = None
    control: Any = None
    force: Any = None
    record: Any = None
    events: Any = None
    form: Any = "direct"
    fused: Any = None
    dtype: Any = None
    t0: Any = None
    start: Any = None
    max_steps: Any = None
    max_step: Any = None
    jumps: Any = None
    positive: Any = None
    progress: Any = False
    threads: Any = None
    backend: Any = "rust"
    start_step: Any = None
    resume: Any = None


class StepControl(NamedTuple):
    """What a request with adaptive steps has beside its plan.

    Attributes:
        pacing: the times at which states are saved, and how many steps may be made, as the engine takes them.
        paces: where members stand before the first step.
        t0: the time of the start, of all members or of each.
        times: those at which states are saved, in the direction of the run.
        going_on: what goes on with the run: ``max_step``, ``jumps``, ``positive``.
        every: how many accepted steps there are from one saved state to the next; None where no steps are saved.
        start: the times, in the direction of the plan, and the states from which members go on.
    """

    pacing: engine.Pacing
    paces: Array
    t0: Array
    times: Array
    going_on: dict[str, Any]
    every: int | None
    start: tuple[Array, Array, Array]


class Request(NamedTuple):
    """A run that was asked for, checked. Nothing can be wrong with it but what the steps bring.

    Attributes:
        plan: what is stepped, by which method, how long and in which arithmetic, as the engine takes it.
        system: what the run is of, with its control; that of the plan may have means of samples over steps.
        v: velocities at the start, over the whole batch, or what the method carries; of a world the array that is stepped.
        y: coordinates, likewise.
        carried: whether ``v`` is what the method carries.
        before: the step at which members diverged in earlier pieces; None if none did.
        record: quantities to record.
        events: what is looked for; None if nothing is.
        start: how the method was started.
        progress: whether a bar is shown.
        slot: of a world, what the method carries beside ``v``.
        step_control: what adaptive steps need; None with fixed steps.
    """

    plan: engine.Plan
    system: System
    v: Array
    y: Array
    carried: bool = False
    before: Whole | None = None
    record: Sequence[str] = ()
    events: list[Event] | None = None
    start: str | None = None
    progress: bool = False
    slot: Array | None = None
    step_control: StepControl | None = None

    @classmethod
    def of(cls, system: System, method: str | Method, options: Options) -> Request:
        """A run with fixed or adaptive steps, as the options say."""
        before = None
        if options.resume is not None:
            options, before = _going_on(options)
        if options.tolerance is not None or options.at is not None or (before is not None and before.adaptive):
            return cls.adaptive(system, method, options, before)
        return cls.fixed(system, method, options, before)

    @classmethod
    def fixed(cls, system: System, method: str | Method, options: Options, before: Continuation | None = None) -> Request:
        """A run with steps of one length."""
        (
            v, y, dt, steps, every, _, _, control, force, record, events, form, fused, dtype, t0, start, max_steps, max_step,
            jumps, kept_positive, progress, threads, backend, start_step, _,
        ) = options  # fmt: skip
        how, system, v = _stepped(system, method, v, y)
        fused, single = _arithmetic(fused, dtype)
        if before is not None:
            continuation.changes_on(before, events)
        if max_steps is not None:
            raise ArgumentError("max_steps: goes with tolerance= and at= only; how many steps of fixed length there are is steps")
        if max_step is not None or jumps is not None or kept_positive is not None:
            given = (("max_step", max_step), ("jumps", jumps), ("positive", kept_positive))
            name = next(name for name, option in given if option is not None)
            raise ArgumentError(f"{name}: goes with tolerance= and at= only; steps of fixed length are dt long, whatever comes")
        if dt is None or steps is None:
            missing = " and ".join(name for name, value in (("dt", dt), ("steps", steps)) if value is None)
            raise ArgumentError(f"{missing}: needed for fixed steps, got None; for adaptive steps give tolerance= and at=")
        form = checks.known("form", form, FORMS)
        backend = checks.known("backend", backend, BACKENDS)
        if form != "direct":
            _goes_with_matrices(system, how, form, force)
        watched = None if events is None else _events(events, form)
        control = a_control(control)
        if form == "power":
            goes_on_by_a_rule(system)
        dt = checks.step(dt)
        if single:
            from . import float32  # only such runs need it

            dt = float32.step(system, how, form, dt)
        if before is not None:
            continuation.goes_on_alike(before, how, dt)
        t0 = 0.0 if t0 is None else checks.beginning(t0)
        steps = checks.count("steps", steps, 1)
        start_step = 0 if start_step is None else checks.count("start_step", start_step, 0, checks.LAST_STEP - steps)
        last = _last_time(t0, dt, start_step, steps)
        system.check_time(last)
        if single:
            float32.check_inputs(system, last)
        if dt < 0.0:
            goes_back(system, control)
        every = None if every is None else checks.count("every", every, 1)
        record = quantities(system, record)
        workers = 0 if threads is None else checks.count("threads", threads, 1, 4096)
        choice = how.start_choice(start)

        bad = None if before is None else before.first_bad_step
        v = checks.block("v", v, system.v_shape, system.axes, finite=bad is None)
        y = checks.block("y", y, system.y_shape, system.axes, finite=bad is None)
        batches = {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
        if control is not None:
            batches["control"] = control.batch
        if isinstance(t0, np.ndarray):
            batches["t0"] = np.shape(t0)
            fits_own_times(system, single)
        if force is not None:
            forced(system)
            force = checks.block("force", force, system.v_shape, system.axes)
            batches["force"] = force.shape[len(system.v_shape) :]
        batch = checks.batch_shape(batches)
        rows = prod(system.v_shape) + prod(system.y_shape)
        if isinstance(t0, np.ndarray):
            t0 = spread(t0, (), batch)
            rows += 1  # the times, which are each member's own
        plan = engine.Plan(
            system, how, batch, dt, t0, start_step, steps, every, choice, workers, backend, form, None, (), fused, single=single
        )
        # What the core does not record is computed from the saved states, with some of them in between.
        recorded = 0
        for name in record:
            recorded += prod(system.quantities[name]) if name in system.quantities else 3 * rows
        checks.fits(
            "the saved states",
            plan.kept * (rows + recorded) + NUMBERS_PER_STATE * (rows + 1),
            batch,
            "keep less with every= or split the batch",
            beside=plan.kept * BYTES_PER_TIME,
        )
        if single:
            for name, block in (("v", v), ("y", y), ("force", force)):
                checks.fits_single(name, block)
            if control is not None:  # whose target is that of the start as it is stepped
                v, y = (np.asarray(block, np.float32).astype(np.float64) for block in (v, y))
        v, y = spread(v, system.v_shape, batch), spread(y, system.y_shape, batch)
        if control is not None:
            system = _controlled(system, how, control, v, y, dt)
        system = system.stepped_by(how)
        stepped = system.over_steps(how, checks.once_of(t0) if isinstance(t0, np.ndarray) else t0, dt)
        carried = False
        if before is not None and before.carry is not None and (carried := before.holds(system, batch, v, y)):
            v = spread(np.asarray(before.carry, np.float64), system.v_shape, batch)
        if bad is not None:
            bad = checks.diverged_before(bad, v, y, batch)
        if force is not None:
            plan = plan._replace(force=spread(force, system.v_shape, batch))
        if record or stepped is not plan.system:
            # In float32 they are computed from the saved states, in float64.
            kept = () if single else tuple(name for name in record if name in system.quantities)
            plan = plan._replace(system=stepped, record=kept)
        started = how.starts[choice] if how.starts else None
        return cls(plan, system, v, y, carried, bad, record, watched, started, checks.flag("progress", progress))

    @classmethod
    def adaptive(cls, system: System, method: str | Method, options: Options, before: Continuation | None = None) -> Request:
        """A run in which every member has steps of its own."""
        how, system, v = _stepped(system, method, options.v, options.y)
        fused, single = _arithmetic(options.fused, options.dtype)
        if before is not None:
            continuation.changes_on(before, options.events)
        _goes_with_times(options, before)
        watched = None if options.events is None else _events(options.events, "direct")
        control = _goes_with_a_tolerance(system, how, a_control(options.control), options, before)
        if single:
            from . import float32  # only such runs need it

            float32.check(system, how)
        t0 = checks.numbers("t0", 0.0 if options.t0 is None else options.t0, unit="units of time")
        times = checks.numbers("at", options.at, unit="units of time")
        if times.ndim == 0 or times.size == 0:
            raise ShapeError(f"at: expected times along the first axis, got shape {times.shape}")
        v = checks.block("v", v, system.v_shape, system.axes)
        y = checks.block("y", options.y, system.y_shape, system.axes)
        batches = {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
        batches |= {"t0": t0.shape, "at": times.shape[1:]}
        checks.batch_shape(batches)  # before t0 and at are compared
        backward = _is_backward(times, t0)
        acting = system.keeper if control is None else control
        if backward and acting is not None and getattr(acting, "acts_on_rates", True):
            raise UnsupportedError(
                f"at: {acting!r} leads a state back to its target as time goes on, so backward in time it leads away from it; "
                f"use a projection"
            )
        sign = -1.0 if backward else 1.0
        backend = checks.known("backend", options.backend, BACKENDS)
        budget = MOST_STEPS if options.max_steps is None else checks.count("max_steps", options.max_steps, 1)
        acceptance = Acceptance(system.groups, positive=positive.checked_places(system, options.positive, v, y))
        numbers = prod(system.v_shape) + prod(system.y_shape)
        groups = sum(acceptance.counts(prod(system.v_shape), prod(system.y_shape)))
        pace = None
        if before is not None:
            pace = _pace_of(before, how, groups)
            acceptance = acceptance._replace(own=len(pace) == engine.PACE_NUMBERS + 3 * groups)
        first = most_step = None
        if pace is not None:
            if options.dt is not None:
                raise ArgumentError("dt: the run that goes on has its next step already")
            batches["resume"] = pace.shape[1:]
        elif options.dt is not None:
            first = checks.numbers("dt", options.dt, unit="units of time")
            if (sign * first <= 0.0).any():
                raise ArgumentError(
                    f"dt: expected a step {'below' if backward else 'above'} zero, as at= goes, got {checks.short(options.dt)}"
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
        force = options.force
        if force is not None:
            forced(system)
            force = checks.block("force", force, system.v_shape, system.axes)
            batches["force"] = force.shape[len(system.v_shape) :]
        tolerances = None
        if pace is None:
            tolerances = tolerances_of(options.tolerance, system, acceptance, checks.batch_shape(batches))
            acceptance = acceptance._replace(own=tolerances.of_groups)
            shapes = {"relative": tolerances.relative.shape}
            if tolerances.absolute is not None:
                shapes["absolute"] = tolerances.absolute.shape
            batches["tolerance"] = checks.batch_shape({name: shape[tolerances.of_groups :] for name, shape in shapes.items()})
        batch = checks.batch_shape(batches)
        if pace is not None and pace.shape[1:] != batch:
            raise ShapeError(f"resume: expected a run of batch {batch}, got one of batch {pace.shape[1:]}")
        for end in (t0, times):
            system.check_time(float(np.abs(end).max()))
            if single:
                float32.check_inputs(system, float(np.abs(end).max()))
        every = None if options.every is None else checks.count("every", options.every, 1)
        if every is not None and len(times) > 1:
            raise ShapeError(
                f"at: with every= expected one time, that of the end, got {len(times)}; the states between are those of the steps"
            )
        record = quantities(system, options.record)
        workers = 0 if options.threads is None else checks.count("threads", options.threads, 1, 4096)
        checks.fits(
            "the saved states",
            len(times) * numbers + (NUMBERS_PER_STATE + 3) * (numbers + 1),
            batch,
            "ask for fewer times or split the batch",
            beside=len(times) * (prod(batch) if times.ndim > 1 else 1) * BYTES_PER_TIME,
        )
        if every is not None:
            checks.fits(
                f"the saved states of up to max_steps = {budget} steps",
                (budget // every + 2) * (numbers + 1),
                batch,
                "give a smaller max_steps= or a larger every=, or split the batch",
            )
        t0, times = _of_the_run(t0, times, batch)
        since = sign * t0 if pace is None else np.maximum(pace[engine.TARGET], sign * t0)
        _ascending(sign * times, since, sign, pace is not None)
        v, y = spread(v, system.v_shape, batch), spread(y, system.y_shape, batch)
        if single:
            v, y = float32.rounded_state(v, y)
            if tolerances is not None:
                from ..reference.adaptive import sizes

                lengths = sizes(v, y, (len(system.v_shape), len(system.y_shape)), acceptance.groups)
                float32.check_tolerance(tolerances.relative, tolerances.absolute, lengths)
        progress = checks.flag("progress", options.progress)
        if control is not None:
            system = system.controlled(control, v, y, TINY)
        relative = tolerances.relative if tolerances is not None else _relative(pace, acceptance, groups)
        order = order_of_series(how, relative.min(axis=0) if acceptance.own else relative)
        begin: Any = sign * t0 if t0.ndim else float(sign * t0)
        plan = engine.Plan(
            system, how, batch, 1.0, begin, threads=workers, backend=backend, fused=fused, order=order, acceptance=acceptance,
            backward=backward, force=None if force is None else spread(force, system.v_shape, batch), single=single,
        )  # fmt: skip
        at = np.ascontiguousarray(sign * times)
        pacing = engine.Pacing(at, budget, pace is None, None if jumps is None else np.sort(sign * jumps, axis=0))
        standing = (sign * t0 if pace is None else continuation.standing(pace)), v, y
        if before is None:
            assert tolerances is not None
            paces = engine.paces(plan, first, tolerances, most_step, pacing)
        else:
            paces, v, y, begins = continuation.taken_up(plan, pacing, before, v, y)
            pacing = pacing._replace(begins=begins)
            if most_step is not None:
                paces[engine.MOST_STEP] = most_step
        going_on = {"max_step": options.max_step, "jumps": options.jumps, "positive": options.positive}
        going_on = {name: each for name, each in going_on.items() if each is not None}
        step_control = StepControl(pacing, paces, t0, times, going_on, every, standing)
        return cls(plan, system, v, y, not pacing.begins, None, record, watched, progress=progress, step_control=step_control)

    @classmethod
    def in_place(cls, system: System, method: str | Method, options: Options) -> Request:
        """Steps of a user's own arrays; of those of a run that goes on, copies."""
        before, own = None, options
        if options.resume is not None:
            options, before = _going_on(options)
            continuation.changes_on(before, options.events)
            if before.adaptive:
                raise ArgumentError(
                    "resume: expected a run with fixed steps, or a world, got one with adaptive steps; start anew from its last "
                    "state: v=run.v[-1], y=run.y[-1], t0=float(run.t[-1])"
                )
        fused, single = _arithmetic(options.fused, options.dtype)
        kind: Any = np.float32 if single else np.float64
        if before is not None:
            kept = {name: getattr(options, name) for name in ("v", "y", "force") if getattr(own, name) is None}
            copies = {name: np.array(array, kind, order="C") for name, array in kept.items() if array is not None}
            options = options._replace(**copies)
        v, y, start, events = options.v, options.y, options.start, options.events
        how, system, _ = _stepped(system, method, v, y)
        system = copy.deepcopy(system)
        dt = checks.step(options.dt)
        if single:
            from . import float32  # only such worlds need it

            dt = float32.step(system, how, "direct", dt)
        if before is not None:
            continuation.goes_on_alike(before, how, dt)
        t0 = 0.0 if options.t0 is None else checks.number("t0", options.t0, unit="units of time")
        batch = checks.shape_of("y", y)[len(system.y_shape) :]
        v = np.empty((0, *batch), np.dtype(kind)) if velocities(system, v) is not v else v
        v = checks.in_place("v", v, (*system.v_shape, *batch), dtype=kind)
        y = checks.in_place("y", y, (*system.y_shape, *batch), dtype=kind)
        if np.shares_memory(v, y):
            raise ArgumentError("v and y: expected two arrays to step in place, got arrays that share memory")
        force = options.force
        if force is not None:
            forced(system)
            force = checks.in_place("force", force, v.shape, "to read before the steps", written=False, dtype=kind)
            if np.shares_memory(force, v) or np.shares_memory(force, y):
                raise ArgumentError("force: expected an array of its own, got one that shares memory with v or y")
        if checks.batch_shape({"system": system.batch, "v and y": batch}) != batch:
            raise ShapeError(f"v and y: the system's batch {system.batch} does not broadcast to theirs, {batch}")
        first = 0 if options.start_step is None else checks.count("start_step", options.start_step, 0)
        choice = how.start_choice(start)
        stepped, control = system, a_control(options.control)
        if dt < 0.0:
            goes_back(system, control)
        if control is not None:
            if checks.batch_shape({"control": control.batch, "v and y": batch}) != batch:
                raise ShapeError(f"control: its batch {control.batch} does not broadcast to that of v and y, {batch}")
            stepped = _controlled(system, how, control, np.asarray(v, np.float64), np.asarray(y, np.float64), dt).stepped_by(how)
        slot = None
        if before is not None and before.carry is not None and before.holds(stepped, batch, v, y):
            slot = np.array(before.carry, dtype=kind).reshape(-1)
        if single:
            float32.check_inputs(stepped, abs(t0) + first * abs(dt))
        stepped.check_time(abs(t0) + first * abs(dt))
        seen = stepped.over_steps(how, t0, dt)
        plan = engine.Plan(seen, how, batch, dt, t0, first, choice=choice, fused=fused, force=force, single=single)
        watched = None if events is None else _events(events, "direct")
        return cls(plan, stepped, v, y, slot is not None, events=watched, start=start, slot=slot)

    @classmethod
    def one_step(cls, system: System, method: str | Method, options: Options, batch: Shape | None = None) -> Request:
        """A step as text, without a run: nothing need be known of its start, nor ``dt``; ``batch`` if not that of the arguments.

        The state is that of an example, v = 0 and y = 1, 2, 3, … where it is not given.
        """
        how, system = find_method(method), a_system(system)
        states = () if options.v is None and options.y is None else (options.v, options.y)
        system = system.for_state_shapes(*(0.0 if each is None else each for each in states))
        fits_together(system, how)
        dt = 1.0 if options.dt is None else checks.number("dt", options.dt, positive=True, unit="units of time")
        t0 = 0.0 if options.t0 is None else checks.number("t0", options.t0, unit="units of time")
        fused, single = _arithmetic(options.fused, options.dtype)
        control, form = a_control(options.control), checks.known("form", options.form, ("direct", "matrix"))
        if form != "direct" and (fused or control is not None):
            raise UnsupportedError("form: form='matrix' goes without fused=, attempt= and control=")
        if form != "direct" and not system.linear:
            raise UnsupportedError(f"form: only linear systems have a transition matrix, and {system!r} is not linear")
        if single:
            from . import float32

            dt = float32.step(system, how, form, dt)
            float32.check_inputs(system, t0)
        choice = how.start_choice(options.start)
        if options.force is not None:
            forced(system)
        shapes = {"v": system.v_shape, "y": system.y_shape, "force": system.v_shape}
        given = {name: getattr(options, name) for name in shapes if getattr(options, name) is not None}
        blocks = {name: checks.block(name, block, shapes[name], system.axes) for name, block in given.items()}
        batches = {"system": system.batch, "control": () if control is None else control.batch}
        batches |= {name: block.shape[len(shapes[name]) :] for name, block in blocks.items()}
        batch = checks.batch_shape(batches) if batch is None else checks.batch_shape(batches | {"members": batch})
        for name, block in blocks.items():
            if single:
                checks.fits_single(name, block)
                block = np.asarray(np.asarray(block, np.float32), np.float64)
            blocks[name] = spread(block, shapes[name], batch)
        v, y, force = (blocks.get(name) for name in shapes)
        if control is not None:
            system = _under(system, control, v, y, batch, None if options.dt is None else dt)
            fits_together(system, how)
            system = system.stepped_by(how)
        stepped = system if options.dt is None else system.over_steps(how, t0, dt)
        plan = engine.Plan(stepped, how, batch, dt, t0, choice=choice, fused=fused, form=form, force=force, single=single)
        first = np.arange(1.0, 1.0 + prod(system.y_shape)).reshape(system.y_shape)
        v = spread(np.zeros(system.v_shape), system.v_shape, batch) if v is None else v
        return cls(plan, system, v, spread(first, system.y_shape, batch) if y is None else y)


def _under(system: System, control: Any, v: Array | None, y: Array | None, batch: Shape, dt: float | None) -> System:
    """The system under control; without a state the control needs all of its numbers, unless they do not matter (no ``dt``)."""
    if v is not None and y is not None and dt is not None:
        return system.controlled(control, v, y, dt)
    if dt is not None and not system.keeps(control) and not isinstance(control, ConstraintControl) and control.target is None:
        raise ArgumentError("control: expected one with a target, or v and y, of which it keeps the energy")
    if dt is not None and isinstance(control, EnergyControl) and control.gain is None:
        raise ArgumentError("control: expected one with a gain, or v and y, to which relative= relates it")
    return system.under(control, batch)


def _going_on(options: Options) -> tuple[Options, Continuation]:
    """The options, with those of the run that goes on where nothing else was said."""
    before = continuation.of(options.resume)
    for name in ("t0", "start_step"):
        if getattr(options, name) is not None:
            raise ArgumentError(
                f"{name}: the run that goes on has its own, got {checks.short(getattr(options, name))}; to begin elsewhere, "
                f"start anew from its last state: v=run.v[-1], y=run.y[-1]"
            )
    known = {"v": before.v, "y": before.y} | before.options
    return options._replace(**{name: each for name, each in known.items() if getattr(options, name) is None}), before


def _stepped(system: Any, method: str | Method, v: Any, y: Any) -> tuple[Method, System, Any]:
    """Method and system of a run, and the velocities at its start."""
    how = find_method(method)
    system = a_system(system)
    if y is None:
        raise ArgumentError("y: expected the coordinates at the start, got None; or the run that goes on, resume=run")
    system = system.for_state_shapes(v, y)
    v = velocities(system, v)
    fits_together(system, how)
    return how, system, v


def _arithmetic(fused: Any, dtype: Any) -> tuple[bool, bool]:
    """Whether steps have fused multiply-adds, and whether they are of float32."""
    return fused is not None and checks.flag("fused", fused), dtype is not None and checks.is_single(dtype)


def _controlled(system: System, how: Method, control: Any, v: Array, y: Array, dt: float) -> System:
    """The system under control, the target that of the state if the control has none."""
    system = system.controlled(control, v, y, dt)
    fits_together(system, how)
    return system


def _events(events: Any, form: str) -> list[Event]:
    """The events that were asked for."""
    from .events.event import several

    if form != "direct":
        raise UnsupportedError(
            f"events: goes with form='direct' only, got form={form!r}; a located event ends a shorter step, and a "
            f"matrix is of steps of one length"
        )
    return several(events)


def _goes_with_matrices(system: System, how: Method, form: str, force: Any) -> None:
    """Raise if there is no transition matrix."""
    if force is not None:
        raise UnsupportedError(
            f"force: goes with form='direct' only, got form={form!r}; the matrices of a step have no term for it: "
            f"give the linear system an input"
        )
    if not system.linear:
        raise UnsupportedError(f"form: only linear systems have a transition matrix, and {system!r} is not linear")
    if how.has_series and any(isinstance(each, Sinusoid) for each in system.given_inputs().values()):
        raise UnsupportedError(
            f"form: {how.name} takes the derivatives of inputs too, and the transition matrix their values only; "
            f"use form='direct'"
        )


def quantities(system: System, record: Any) -> list[str]:
    """What to record, each once; raise if the system does not have it."""
    if record is None or (type(record) is tuple and not record):
        return []
    names = [record] if isinstance(record, str) else checks.several("record", record, "quantities")
    known = list(dict.fromkeys(["energy", *system.quantities]))
    for name in names:
        checks.known("record", name, known)
    if "energy" in names and "energy" not in system.quantities:
        v, y = (np.zeros((*shape, *system.batch)) for shape in (system.v_shape, system.y_shape))
        system.energy(v, y)  # raises if there is none, before any work
    return list(dict.fromkeys(names))


def spread(array: Array, block: Shape, batch: Shape) -> Array:
    """A state over the whole batch."""
    axes = array.shape[len(block) :]
    if axes == batch:
        return array
    if not array.ndim:
        return checks.over(array, batch)
    return np.broadcast_to(array.reshape((*block, *(1,) * (len(batch) - len(axes)), *axes)), (*block, *batch))


def _last_time(t0: Any, dt: float, start_step: int, steps: int) -> float:
    """The largest time in size; raise if one does not move on, or is not finite."""
    begin, end = t0 + start_step * dt, t0 + (start_step + steps) * dt
    index: Shape = ()
    if isinstance(t0, np.ndarray):
        wrong = (begin == end) | ~np.isfinite(end)
        if not wrong.any():
            return float(max(np.abs(each).max(initial=0.0) for each in (begin, end)))
        index = tuple(np.argwhere(wrong)[0].tolist())
        begin, end = begin[index], end[index]
    elif begin != end and np.isfinite(end):
        return float(max(abs(begin), abs(end)))
    raise ArgumentError(
        f"dt, t0: expected a time that moves on and stays finite, got t = {begin:g} at step {start_step} and t = {end:g} "
        f"after {steps} steps of {dt:g}{of_member(index)}"
    )


# ---- adaptive steps


def _goes_with_times(options: Options, before: Continuation | None) -> None:
    """Raise if something goes with fixed steps only, or if one of ``tolerance`` and ``at`` is missing."""
    if before is not None and not before.adaptive:
        raise ArgumentError(
            "resume: expected a run with adaptive steps, since tolerance= or at= was given, got one with fixed steps; start anew "
            "from its last state: v=run.v[-1], y=run.y[-1], t0=run.t[-1]"
        )
    fixed = {name: getattr(options, name) for name in ("steps", "start", "start_step")}
    if not isinstance(options.form, str) or options.form != "direct":
        fixed["form"] = options.form
    if wrong := [name for name, value in fixed.items() if value is not None]:
        why = "and the run that goes on has adaptive steps" if before is not None else "and tolerance= or at= was given"
        raise ArgumentError(f"{', '.join(wrong)}: goes with fixed steps only, {why}")
    goes_with_times(options.tolerance is not None or before is not None, options.at)


def goes_with_times(has_tolerance: bool, at: Any) -> None:
    """Raise if one of ``tolerance`` and ``at`` is missing, saying what it is."""
    if at is None:
        raise ArgumentError("at: expected too with tolerance=: the times at which states are saved, such as at=[t1, t2]")
    if not has_tolerance:
        raise ArgumentError("tolerance: expected too with at=: the error that a step may have, such as tolerance=1e-6")


def _goes_with_a_tolerance(system: System, how: Method, control: Any, options: Options, before: Continuation | None) -> Any:
    """The control, if the method can step the system with a tolerance; what has to be given is there."""
    if how.error_order is None:
        able = ", ".join(m.name for m in every_method() if m.error_order is not None)
        raise UnsupportedError(f"tolerance: {how.name} does not estimate its error, so it cannot choose its steps; use {able}")
    if system.stick_friction is not None:
        raise UnsupportedError(
            f"tolerance: {system!r} has friction that sticks; what it does depends on the step, so the error of a step cannot be "
            f"estimated; use dt= and steps="
        )
    if any(surface.way != "spring" for surface in system.contacts):
        raise UnsupportedError(
            f"tolerance: a bounce is an instant within a step, of which the estimated error knows nothing, got {system!r}; use "
            f'dt= and steps=, or surfaces with way="spring"'
        )
    if options.max_step is None and any(getattr(surface, "inside", True) is False for surface in system.contacts):
        raise UnsupportedError(
            f"tolerance: a step may pass a ball between its stages, which then do not feel it, got {system!r}; give max_step=, "
            f"shorter than a point takes past the ball"
        )
    if how.has_series:
        goes_with_series(system, control)
        if options.positive is not None:
            raise UnsupportedError(
                f"positive: {how.name} rejects no step for the sign of a component; use a method that does, such as dop853"
            )
    not_of_a_step(system.keeper if control is None else control)
    if options.tolerance is not None and before is not None:
        raise ArgumentError("tolerance: the run that goes on has its own")
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
    if system.all_inputs():
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


def _pace_of(before: Continuation, method: Method, groups: int) -> Array:
    """The numbers that say where the members stand of a run with a tolerance that goes on."""
    continuation.goes_on_alike(before, method)
    assert isinstance(before.carry, AdaptiveState)
    pace, expected = before.carry.pace, [engine.PACE_NUMBERS + each * groups for each in (1, 3)]
    if len(pace) not in expected:
        raise ShapeError(
            "resume: expected a run of a system whose errors are relative to as many lengths; start anew from its last state: "
            "v=run.v[-1], y=run.y[-1], t0=run.t[-1]"
        )
    return pace


def _relative(pace: Any, acceptance: Acceptance, groups: int) -> Array:
    """The relative tolerances of a run that goes on."""
    if not acceptance.own:
        return np.asarray(pace[engine.RELATIVE])
    return np.asarray(pace[engine.PACE_NUMBERS + groups : engine.PACE_NUMBERS + 2 * groups])
