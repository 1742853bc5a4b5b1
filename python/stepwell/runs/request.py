"""A run as it is requested: every argument is checked here, once, before any work.

``integrate``, ``World``, ``explain``, ``export`` and everything that makes many runs turn their arguments into a ``Request``.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape, Whole
from ..errors import ArgumentError, ShapeError, UnsupportedError
from ..model.compatibility import (
    bounces_within_limits,
    fits_own_times,
    fits_together,
    forced,
    goes_back,
    goes_with_a_controller,
    not_with_exact,
    one_state,
    samples_meet_steps,
    velocities,
)
from ..model.methods import Method, of_operations
from ..model.systems import System
from ..model.systems.base import TINY, a_system
from ..reference.acceptance import Acceptance
from . import continuation, engine
from .options import Options
from .options.checked import Checked, refuse
from .options.single import check_matrix_form
from .start import (
    check_algebraic,
    checked_system,
    controlled,
    last_time,
    options_of_resumed,
    under_control,
)

if TYPE_CHECKING:
    from .continuation import Continuation
    from .events import Event

#: The memory of a run besides its saved states: NUMBERS_PER_STATE for each number of a state (the start, the carry, the final
#: state), and BYTES_PER_TIME for each saved time (its step number and the time).
NUMBERS_PER_STATE, BYTES_PER_TIME = 4, 16


class StepControl(NamedTuple):
    """The part of a request with adaptive steps besides its plan.

    Attributes:
        pacing: the times at which states are saved, and the most steps, as the engine takes them.
        paces: the step-size controllers before the first step.
        t0: the time of the start, of all members or of each.
        times: those at which states are saved, in the direction of the run.
        every: the accepted steps from one saved state to the next; None if no steps are saved.
        start: the times, in the direction of the plan, and the states from which members go on.
    """

    pacing: engine.Pacing
    paces: Array
    t0: Array
    times: Array
    every: int | None
    start: tuple[Array, Array, Array]


class Request(NamedTuple):
    """A run as it was requested, with every argument checked.

    Attributes:
        plan: system, method, steps and arithmetic, as the engine takes them.
        system: the user's system with its control; that of the plan may have means of samples over steps.
        v: velocities at the start, over the whole batch, or what the method carries; for a world the array that is stepped.
        y: coordinates, likewise.
        carried: whether ``v`` is what the method carries.
        before: the step at which members diverged in earlier pieces; None if none did.
        record: quantities to record.
        events: the events to locate; None if there are none.
        start: how the method was started.
        progress: whether a bar is shown.
        slot: for a world, what the method carries besides ``v``.
        step_control: what adaptive steps need; None with fixed steps.
        options: all options, as they were checked; None for a step.
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
    options: Checked | None = None

    @property
    def going_on(self) -> dict[str, Any]:
        """The options that hold for a run that goes on, too."""
        return {} if self.options is None else self.options.going_on()

    @classmethod
    def of(cls, system: System, method: str | Method, options: Options) -> Request:
        """A run with fixed or adaptive steps, as the options say."""
        before = None
        if options.resume is not None:
            options, before = options_of_resumed(options)
        if options.tolerance is not None or options.at is not None or (before is not None and before.adaptive):
            return cls.adaptive(system, method, options, before)
        return cls.fixed(system, method, options, before)

    @classmethod
    def fixed(cls, system: System, method: str | Method, options: Options, before: Continuation | None = None) -> Request:
        """A run with steps of one length."""
        method, system, v = checked_system(system, method, options.v, options.y)
        asked = Checked(options._replace(v=v), None, system=system, method=method, before=before)
        if before is not None:
            continuation.changes_on(before, options.events)
        if missing := [name for name in ("dt", "steps") if not asked.given(name)]:
            raise ArgumentError(
                f"{' and '.join(missing)}: needed for fixed steps, got None; for adaptive steps give tolerance= and at="
            )
        form, control, single, dt = asked["form"], asked["control"], asked["dtype"], asked["dt"]
        if method.is_exact and form == "direct":
            form = "matrix"  # which its steps are
            not_with_exact(method, force=options.force, events=options.events, control=control)
        if form != "direct":
            check_matrix_form(system, method, form, options.force)
        watched = asked["events"]
        if before is not None:
            continuation.goes_on_alike(before, method, dt)
        t0, steps, every, start_step = asked["t0"], asked["steps"], asked["every"], asked["start_step"]
        last = last_time(t0, dt, start_step, steps)
        system.check_time(last)
        if single:
            from . import float32  # only such runs need it

            float32.check_inputs(system, last)
        if dt < 0.0:
            goes_back(system, control)
        record, v, y, force = asked["record"], asked["v"], asked["y"], asked["force"]
        if isinstance(t0, np.ndarray):
            fits_own_times(system, single)
        of_plan = asked.of_plan()
        batch = checks.batch_shape(asked.batches())
        rows = prod(system.v_shape) + prod(system.y_shape)
        if isinstance(t0, np.ndarray):
            t0 = checks.spread(t0, (), batch)
            rows += 1  # the times, which are each member's own
        plan = engine.Plan(system, method, batch, dt, t0, steps=steps, every=every, form=form, **of_plan)
        # In float32, in the matrix forms and with events quantities are computed from the saved states, which do not tell what a
        # controller has put out.
        shapes, later = system.recorded_shapes(), form != "direct" or single or watched is not None
        while_stepping = tuple(name for name in record if not later or name not in system.quantities)
        recorded = sum(prod(shapes[name]) for name in record)
        checks.fits(
            "the saved states",
            plan.save_count * (rows + recorded) + NUMBERS_PER_STATE * (rows + 1),
            batch,
            "keep less with every= or split the batch",
            beside=plan.save_count * BYTES_PER_TIME,
        )
        if single:
            for name, block in (("v", v), ("y", y), ("force", force)):
                checks.fits_single(name, block)
            if control is not None:  # whose target is that of the start as it is stepped
                v, y = (np.asarray(block, np.float32).astype(np.float64) for block in (v, y))
        v, y = checks.spread(v, system.v_shape, batch), checks.spread(y, system.y_shape, batch)
        if control is not None:
            system = controlled(system, method, control, v, y, dt)
        if before is None:
            check_algebraic(system, y, t0)
        system = system.stepped_by(method)
        samples_meet_steps(system, method, t0, dt)
        bounces_within_limits(system, method, dt)
        stepped = system.over_steps(method, checks.once_of(t0) if isinstance(t0, np.ndarray) else t0, dt)
        carried = False
        if before is not None and before.carry is not None and (carried := before.holds(system, batch, v, y)):
            of_slot = (plan.slot_numbers,) if method.kept else system.v_shape
            v = checks.spread(np.asarray(before.carry, np.float64), of_slot, batch)
        bad = None if before is None else before.first_bad_step
        if bad is not None:
            bad = checks.diverged_before(bad, v, y, batch)
        if force is not None:
            plan = plan._replace(force=checks.spread(force, system.v_shape, batch))
        if record or stepped is not plan.system:
            plan = plan._replace(system=stepped, record=while_stepping)
        if stepped.controller is not None:
            goes_with_a_controller(stepped, method, events=options.events)
            plan = plan._replace(memory=_memory(stepped, batch, before))
        started = method.starts[plan.choice] if method.starts else None
        return cls(plan, system, v, y, carried, bad, record, watched, started, asked["progress"], options=asked)

    @classmethod
    def adaptive(cls, system: System, method: str | Method, options: Options, before: Continuation | None = None) -> Request:
        """A run in which every member has steps of its own."""
        from . import adaptive_options  # only such runs need them
        from .options import positive
        from .options.tolerance import order_of_series, tolerances_of

        method, system, v = checked_system(system, method, options.v, options.y)
        if before is not None:
            continuation.changes_on(before, options.events)
        goes_with_a_controller(system, method, tolerance=True)
        because = "tolerance= or at= was given" if before is None else "the run that goes on has adaptive steps"
        if before is not None and not before.adaptive:
            raise ArgumentError(
                "resume: expected a run with adaptive steps, since tolerance= or at= was given, got one with fixed steps; start "
                "anew from its last state: v=run.v[-1], y=run.y[-1], t0=run.t[-1]"
            )
        asked = Checked(options._replace(v=v), f"and {because}", system=system, method=method, before=before)
        adaptive_options.check_times(options.tolerance is not None or before is not None, options.at)
        control, single, y = asked["control"], asked["dtype"], asked["y"]
        adaptive_options.check_estimates(system, method, control, options, before)
        if single:
            from . import float32  # only such runs need it

            float32.check(system, method)
        t0, times, v, force = np.asarray(asked["t0"]), asked["at"], asked["v"], asked["force"]
        batches = asked.batches()
        checks.batch_shape({name: batches.get(name, ()) for name in ("system", "v", "y", "t0", "at")})  # which are compared next
        backward = adaptive_options.is_backward(times, t0)
        acting = system.keeper if control is None else control
        if backward and acting is not None and getattr(acting, "acts_on_rates", True):
            raise UnsupportedError(
                f"at: {acting!r} leads a state back to its target as time goes on, so backward in time it leads away from it; "
                f"use a projection"
            )
        sign = -1.0 if backward else 1.0
        of_plan = asked.of_plan()
        places = positive.checked_places(system, asked["positive"], v, y)
        acceptance = Acceptance(system.groups, positive=places, compensated=method.has_series)
        numbers = prod(system.v_shape) + prod(system.y_shape)
        low = method.has_series * numbers
        groups = sum(acceptance.counts(prod(system.v_shape), prod(system.y_shape)))
        pace, first, most_step, budget = None, asked["dt"], asked["max_step"], asked["max_steps"]
        if before is not None:
            pace = adaptive_options.pace_of(before, method, groups, low)
            acceptance = acceptance._replace(own=len(engine.own_tolerances(pace, groups, low)) > 0)
            if first is not None:
                raise ArgumentError("dt: the run that goes on has its next step already")
            batches["resume"] = pace.shape[1:]
        elif first is not None:
            if (sign * first <= 0.0).any():
                raise ArgumentError(
                    f"dt: expected a step {'below' if backward else 'above'} zero, as at= goes, got {checks.short(options.dt)}"
                )
            first = sign * first
        jumps = adaptive_options.jump_times(system, asked["jumps"], t0, times)
        if jumps is not None:
            batches["jumps"] = jumps.shape[1:]
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
        if system.all_inputs():
            for end in (t0, times):
                system.check_time(float(np.abs(end).max()))
                if single:
                    float32.check_inputs(system, float(np.abs(end).max()))
        every, record = asked["every"], asked["record"]
        if every is not None and len(times) > 1:
            raise ShapeError(
                f"at: with every= expected one time, that of the end, got {len(times)}; the states between are those of the steps"
            )
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
        t0, times = adaptive_options.times_of_run(t0, times, batch)
        if jumps is not None and (t0.ndim or jumps.ndim > 1):  # bracketed by the times of each member
            jumps = checks.spread(jumps, jumps.shape[:1], batch)
        since = sign * t0 if pace is None else np.maximum(pace[engine.TARGET], sign * t0)
        adaptive_options.check_ascending(sign * times, since, sign, pace is not None)
        v, y = checks.spread(v, system.v_shape, batch), checks.spread(y, system.y_shape, batch)
        if single:
            v, y = float32.rounded_state(v, y)
            if tolerances is not None:
                from ..reference.adaptive import sizes

                lengths = sizes(v, y, (len(system.v_shape), len(system.y_shape)), acceptance.groups)
                float32.check_tolerance(tolerances.relative, tolerances.absolute, lengths)
        if tolerances is not None:
            check_algebraic(system, y, t0, tolerances)
        if control is not None:
            system = system.controlled(control, v, y, TINY)
        relative = (
            tolerances.relative if tolerances is not None else adaptive_options.relative_tolerances(pace, acceptance, groups, low)
        )
        order = order_of_series(method, relative.min(axis=0) if acceptance.own else relative)
        begin: Any = sign * t0 if t0.ndim else float(sign * t0)
        plan = engine.Plan(
            system, method, batch, 1.0, begin, order=order, acceptance=acceptance, backward=backward,
            force=None if force is None else checks.spread(force, system.v_shape, batch), **of_plan,
        )  # fmt: skip
        at = np.ascontiguousarray(sign * times)
        pacing = engine.Pacing(at, budget, pace is None, None if jumps is None else np.sort(sign * jumps, axis=0))
        standing = (sign * t0 if pace is None else continuation.standing(pace)), v, y
        if before is None:
            assert tolerances is not None
            paces = engine.paces(plan, first, tolerances if single else tolerances.of_steps(method), most_step, pacing)
        else:
            paces, v, y, begins = continuation.taken_up(plan, pacing, before, v, y)
            pacing = pacing._replace(begins=begins)
            if most_step is not None:
                paces[engine.MOST_STEP] = most_step
        step_control = StepControl(pacing, paces, t0, times, every, standing)
        return cls(
            plan, system, v, y, not pacing.begins, None, record, asked["events"], progress=asked["progress"],
            step_control=step_control, options=asked,
        )  # fmt: skip

    @classmethod
    def in_place(cls, system: System, method: str | Method, options: Options) -> Request:
        """A world: steps in place on the user's arrays, or on copies of those of the run that goes on."""
        before, own = None, options
        if options.resume is not None:
            options, before = options_of_resumed(options)
            continuation.changes_on(before, options.events)
            if before.adaptive:
                raise ArgumentError(
                    "resume: expected a run with fixed steps, or a world, got one with adaptive steps; start anew from its last "
                    "state: v=run.v[-1], y=run.y[-1], t0=float(run.t[-1])"
                )
        refuse(options, "World")
        kind: Any = np.float32 if options.dtype is not None and checks.is_single(options.dtype) else np.float64
        if before is not None:
            resumed = {name: getattr(options, name) for name in ("v", "y", "force") if getattr(own, name) is None}
            copies = {name: np.array(array, kind, order="C") for name, array in resumed.items() if array is not None}
            options = options._replace(**copies)
        v, y, start, events = options.v, options.y, options.start, options.events
        method, system, _ = checked_system(system, method, v, y)
        system = copy.deepcopy(system)
        asked = Checked(options, None, way="World", system=system, method=method)
        if not asked.given("dt"):
            raise ArgumentError("dt: expected a number other than zero in units of time, got None")
        single, dt, t0, first, control = asked["dtype"], asked["dt"], asked["t0"], asked["start_step"], asked["control"]
        if before is not None:
            continuation.goes_on_alike(before, method, dt)
        of_plan = asked.of_plan()
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
        stepped = system
        if dt < 0.0:
            goes_back(system, control)
        if control is not None:
            if checks.batch_shape({"control": control.batch, "v and y": batch}) != batch:
                raise ShapeError(f"control: its batch {control.batch} does not broadcast to that of v and y, {batch}")
            wide_v, wide_y = np.asarray(v, np.float64), np.asarray(y, np.float64)
            stepped = controlled(system, method, control, wide_v, wide_y, dt).stepped_by(method)
        slot = None
        goes_with_a_controller(stepped, method, events=events)
        if before is not None and before.carry is not None and before.holds(stepped, batch, v, y):
            slot = np.array(before.carry, dtype=kind).reshape(-1)
        if single:
            from . import float32  # only such worlds need it

            float32.check_inputs(stepped, abs(t0) + first * abs(dt))
        stepped.check_time(abs(t0) + first * abs(dt))
        not_with_exact(method, force=force, events=events, control=control)
        samples_meet_steps(stepped, method, t0, dt)
        bounces_within_limits(stepped, method, dt)
        if before is None and first == 0:
            check_algebraic(stepped, y, t0)
        seen = stepped.over_steps(method, t0, dt)
        plan = engine.Plan(seen, method, batch, dt, t0, force=force, **of_plan)
        if seen.controller is not None:
            plan = plan._replace(memory=_memory(seen, batch, before))
            if slot is not None and plan.memory is not None:
                slot = np.concatenate([slot, plan.memory.reshape(-1).astype(kind)])
        return cls(plan, stepped, v, y, slot is not None, events=asked["events"], start=start, slot=slot, options=asked)

    @classmethod
    def one_step(cls, system: System, method: str | Method, options: Options, batch: Shape | None = None) -> Request:
        """A step to be written as text, for which neither a start nor ``dt`` is needed.

        Without a start the state is v = 0 and y = 1, 2, 3, … ``batch`` is the batch if the arguments do not have it.
        """
        method, system = of_operations(method), a_system(system)
        states = () if options.v is None and options.y is None else (options.v, options.y)
        system = system.for_state_shapes(*(0.0 if each is None else each for each in states))
        fits_together(system, method)
        asked = Checked(
            options._replace(dt=1.0 if options.dt is None else options.dt), None, way="step", system=system, method=method
        )
        dt, t0, fused, single, control, form = (asked[name] for name in ("dt", "t0", "fused", "dtype", "control", "form"))
        if form != "direct" and (fused or control is not None):
            raise UnsupportedError("form: form='matrix' goes without fused=, attempt= and control=")
        if form != "direct":
            one_state("form", method)
        if form != "direct" and not system.linear:
            raise UnsupportedError(f"form: only linear systems have a transition matrix, and {system!r} is not linear")
        if single:
            from . import float32

            float32.check_inputs(system, t0)
        choice = asked["start"]
        shapes = {"v": system.v_shape, "y": system.y_shape, "force": system.v_shape}
        blocks = {name: asked[name] for name in shapes if asked.given(name)}
        batches = asked.batches()
        batch = checks.batch_shape(batches) if batch is None else checks.batch_shape(batches | {"members": batch})
        for name, block in blocks.items():
            if single:
                checks.fits_single(name, block)
                block = np.asarray(np.asarray(block, np.float32), np.float64)
            blocks[name] = checks.spread(block, shapes[name], batch)
        v, y, force = (blocks.get(name) for name in shapes)
        if control is not None:
            system = under_control(system, control, v, y, batch, None if options.dt is None else dt)
            fits_together(system, method)
            system = system.stepped_by(method)
        stepped = system if options.dt is None else system.over_steps(method, t0, dt)
        plan = engine.Plan(stepped, method, batch, dt, t0, choice=choice, fused=fused, form=form, force=force, single=single)
        if stepped.controller is not None:
            goes_with_a_controller(stepped, method)
            plan = plan._replace(memory=_memory(stepped, batch, None))
        first = np.arange(1.0, 1.0 + prod(system.y_shape)).reshape(system.y_shape)
        v = checks.spread(np.zeros(system.v_shape), system.v_shape, batch) if v is None else v
        return cls(plan, system, v, checks.spread(first, system.y_shape, batch) if y is None else y)


def _memory(system: System, batch: Shape, before: Continuation | None) -> Array:
    """The memory of the sampled controller of a system at the start of a run."""
    known = None if before is None else before.remembered(system, batch)
    return system.controller.at_start(system, batch) if known is None else known
