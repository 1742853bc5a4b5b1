"""Runs: one trajectory or a hundred thousand."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..base import buffer_pool, checks, registry
from ..base.arrays import Array, Whole
from ..base.reprs import first_of, of_member, share
from ..errors import ArgumentError, DivergenceWarning, UnsupportedError
from ..model.compatibility import (
    changes_on,
    fits_own_times,
    fits_together,
    forced,
    goes_back,
    goes_on_alike,
    goes_on_by_a_rule,
    velocities,
)
from ..model.controls import AnyControl, a_control
from ..model.methods import Method
from ..model.methods import method as find_method
from ..model.systems import NBody, Sinusoid, System
from ..model.systems.base import a_system
from . import continuation, encounters, engine
from .adaptive import AdaptiveOptions, adaptive_run
from .diagnostics import warn_of_nonsense
from .request import BACKENDS, BYTES_PER_TIME, NUMBERS_PER_STATE, bar_of, goes_with_times, quantities, spread, time_of
from .result import Run

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..base.literals import Backend, RunForm
    from .events import Event

FORMS: tuple[RunForm, ...] = ("direct", "matrix", "power")


def integrate(
    system: System,
    method: str | Method,
    *,
    v: Any = None,
    y: Any,
    dt: float | None = None,
    steps: int | None = None,
    every: int | None = None,
    tolerance: Any = None,
    at: Any = None,
    control: AnyControl | None = None,
    force: Any = None,
    record: str | Sequence[str] | None = (),
    events: Any = None,
    form: RunForm = "direct",
    fused: bool = False,
    dtype: Any = "float64",
    t0: Any = 0.0,
    start: str | None = None,
    max_steps: int | None = None,
    max_step: Any = None,
    jumps: Any = None,
    positive: Any = None,
    progress: bool = False,
    threads: int | None = None,
    backend: Backend = "rust",
    start_step: int = 0,
    carry: Any = None,
    carried_by: str | None = None,
    carried_for: str | None = None,
    first_bad_step: Any = None,
    dt_before: float | None = None,
    changed_by: Any = None,
) -> Run:
    """Step a system, or a batch of it.

    Every parameter of the system and both blocks broadcast; batch axes come last. A member that diverges does not affect the
    others. The result is the same to the last bit on every CPU, for every number of threads, with either backend, alone or
    in a batch, in one piece or in several.

    Most runs need ``v``, ``y``, ``dt``, ``steps`` and ``every``, or ``tolerance`` and ``at``. The last six, from
    ``start_step`` on, are those of a run that continues another: ``**run.resume`` gives them, and they are not written by hand.

    Args:
        system: what to step.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block at the start, shape (*block, *batch), or one number for all; a first-order system has none.
        y: coordinate block at the start, likewise.
        dt: the step, in units of time, below zero to go back; if None in a continued run, that of it. With a tolerance, the step
            to try first; if None, a hundredth of the time in which the state changes at the start, or from rest 2⁻²⁰ units of
            time, or that part of a run of less than 2⁻¹⁵ units.
        steps: number of steps, one or more.
        every: save the state every so many steps, and at the first and the last; None saves the last alone.
        tolerance: in place of ``steps``, for adaptive steps: every member has steps of its own, such that the estimated error of
            each stays below this. One number is relative: of own equations to the largest that each component has been, so that
            units do not matter; of built-in systems, whose directions are equivalent, to the largest length of each block. For a
            component that decays to nothing, or a stiff one, give a tuple (relative, absolute): it allows relative·size +
            absolute with the present size, as SciPy's rtol and atol, the absolute part in the units of the state. Each is a
            number, an array over the batch, or one with a number for each component, shape (*block, …) of y, which v has too; a
            list is refused. A run that continues by ``carry`` has its tolerance already. For methods with an ``error_order``:
            merson, fehlberg, fehlberg_5, dop853, taylor.
        at: with a tolerance, the times at which to save the state, from t0 on, ascending, or descending for a run backward in
            time; shape (times,), or (times, *batch) for times of each member. A state within a step is computed by an extra step
            from its start. Steps do not depend on these times, unless the extra step errs by more than is tolerated: the
            step missed something and is rejected.
        control: an ``EnergyControl`` or a ``Projection``, to keep the energy constant, or another control or projection; with a
            tolerance, too, where a projection acts on accepted steps. Verlet and leapfrog go without.
        force: what is added to v̇ in every stage, constant over the run, in the units of v per unit of time: for bodies a force
            per mass, that is an acceleration. Shape (*block, *batch) of v, or one number for all. With fixed and adaptive steps;
            in a ``World`` it may change.
        record: quantities to record of every saved state, ``run.recorded``: "energy", and those that the system names in its
            ``quantities``; nothing if None. Bodies compute their energy together with the force of the next step, at little cost.
        events: quantities of a state whose changes of sign are located to the accuracy of the method, ``run.events``: a function
            g(t, v, y), an ``Event``, which may also stop a member, or a list of them. Goes with fixed and adaptive steps in the
            direct form (docs/howto/events.md).
        form: ``"direct"``; ``"matrix"`` for the transition matrix of a linear system (Appendix B); ``"power"`` for powers of it,
            which make any number of steps at once and need inputs that are constants or sinusoids.
        fused: compute each step with fused multiply-adds, a·b + c rounded once. The bits differ from those without, and are the
            same on every machine and with either backend. For steps of up to some 4000 operations.
        dtype: ``"float64"`` or ``"float32"``, half the width and twice the members in a vector: start, parameters and dt are
            rounded to it once, and so is the result of every operation of a step; v and y are returned in it. The bits are the
            same on every machine and with either backend. For fixed steps of up to some 4000 operations in the direct form.
        t0: time of step 0, a number, or an array over the batch for a time of each member; ``run.t`` then has shape
            (saved, *batch). Step k is at t0 + k·dt, computed by this formula and never accumulated. With a tolerance, the time of
            the start, likewise.
        start: how to start a method that has several ways; see ``method(…).starts``.
        max_steps: with a tolerance, the most steps of a member, including rejected ones; a million if None.
        max_step: with a tolerance, the longest step, in units of time, a number or an array over the batch. What lasts for less
            than a step may be stepped over without a sign: give this, or ``jumps``, where rates change suddenly in time.
        jumps: with a tolerance, times at which rates jump, shape (jumps,), or (jumps, *batch) for jumps of each member. No step
            crosses one; behind it the step is chosen anew. Those of sampled inputs, and comparisons of your own equations with
            the time, are known without.
        positive: with a tolerance, the components that must not become negative: True for all of y, or one or a list of indices
            of y, or of tuples such as ("v", 0). A step that makes one negative is rejected; a member stops where no step is small
            enough.
        progress: show a progress bar, in a terminal or in a notebook.
        threads: how many threads share the members, or the pairs of many bodies; None for as many as are worthwhile.
        backend: ``"rust"``, or ``"numpy"`` for the reference.
        start_step: number of the first step. A run in pieces (``run.resume``) equals the run in one piece to the bit.
        carry: what a method carries in place of v, from ``run.resume``; ``v`` is then not used. With a tolerance, the state of
            the step-size controller.
        carried_by: the method of that carry, from ``run.resume``. Any other method is then refused, since its carry has another
            meaning.
        carried_for: for which system and state that carry holds, from ``run.resume``. With other parameters or equations, another
            control, or a ``v`` or ``y`` of your own, the run begins anew from ``v`` and ``y``; with a tolerance at the last time
            that was asked for, and with the tolerance of before.
        first_bad_step: members that diverged before, from ``run.resume``: the step at which they did, or −1, shape (*batch); only
            they may begin with NaN or infinities.
        dt_before: the step so far, from ``run.resume``. Another ``dt`` is then refused, since t0 + k·dt would be another time.
        changed_by: names of the events that changed the state so far, from ``run.resume``. ``events`` is then needed: the same
            events again, or ``[]`` to go on without.

    Returns:
        A ``Run``.

    Raises:
        ArgumentError: before any work: what was given and what was expected.
        UnsupportedError: if the method cannot do the system.
        KeyboardInterrupt: within a tenth of a second of Ctrl-C.

    Warns:
        DivergenceWarning: how many members left the finite range, which first, and when. Nothing computed is lost.
        ToleranceWarning: how many members stopped before the last time of ``at``, and why; or that an absolute tolerance is so
            large that the motion is lost in it.
        AccuracyWarning: if a run stayed finite and can be seen to mean nothing: a pendulum turned so far that its angle has no
            sine; a state grew a million times by fixed steps that are beyond the stability limit at the start; bodies that
            nothing controls ended with an energy of another size, or with a tolerance any system whose energy or declared
            invariant is constant; a motion along a line passed a barrier that is higher than its energy; bodies met within one
            step, which is then named. That is looked for where it is little work against the run, or where there is reason to
            (docs/howto/nbody.md); not in the pieces of a run that carries something. ``Run.encounters`` checks every step.

    Example:
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, every=50)
        >>> run.y.round(6)
        array([ 1.      ,  0.283658, -0.839075])
    """
    how = find_method(method)
    system = a_system(system).for_state_shapes(v, y)
    v = velocities(system, v)
    fits_together(system, how)
    fused = checks.flag("fused", fused)
    single = checks.is_single(dtype)
    changes_on(events, changed_by)
    if single and (tolerance is not None or at is not None):
        raise UnsupportedError("dtype: float32 goes with fixed steps only, and tolerance= or at= was given; use dt= and steps=")
    if tolerance is not None or at is not None:
        fixed = {
            "steps": steps,
            "every": every,
            "start": start,
            "first_bad_step": first_bad_step,
            "dt_before": dt_before,
        }
        if not isinstance(form, str) or form != "direct":
            fixed["form"] = form
        if not isinstance(start_step, int) or start_step != 0:
            fixed["start_step"] = start_step
        _only_fixed(fixed)
        goes_with_times(tolerance is not None or carry is not None, at)
        went = None if carry is None else (carry, carried_by, carried_for)
        asked = None if events is None else _asked(events, "direct")
        options = AdaptiveOptions(tolerance, at, max_steps, max_step, jumps, positive)
        run, begun, visited = adaptive_run(
            system, how, v, y, dt, options, record, t0, went, control, force, fused, threads, backend, progress, asked
        )
        warn_of_nonsense(run, begun if _is_one_motion(asked) else None, visited)
        return run
    if max_steps is not None:
        raise ArgumentError("max_steps: goes with tolerance= and at= only; how many steps of fixed length there are is steps")
    for name, option in (("max_step", max_step), ("jumps", jumps), ("positive", positive)):
        if option is not None:
            raise ArgumentError(f"{name}: goes with tolerance= and at= only; steps of fixed length are dt long, whatever comes")
    dt = dt_before if dt is None else dt
    if dt is None or steps is None:
        missing = " and ".join(name for name, given in (("dt", dt), ("steps", steps)) if given is None)
        raise ArgumentError(f"{missing}: needed for fixed steps, got None; for adaptive steps give tolerance= and at=")
    form = checks.known("form", form, FORMS)
    backend = checks.known("backend", backend, BACKENDS)
    if fused and form != "direct":
        raise UnsupportedError(f"fused: goes with form='direct' only, got form={form!r}")
    if form != "direct" and force is not None:
        raise UnsupportedError(f"force: goes with form='direct' only, got form={form!r}; a linear system has inputs")
    if form != "direct" and not system.linear:
        raise UnsupportedError(f"form: only linear systems have a transition matrix, and {system!r} is not linear")
    asked = None if events is None else _asked(events, form)
    control = a_control(control)
    if form != "direct" and how.has_series and any(isinstance(each, Sinusoid) for each in system.given_inputs().values()):
        raise UnsupportedError(
            f"form: {how.name} takes the derivatives of inputs too, and the transition matrix their values only; "
            f"use form='direct'"
        )
    if form == "power":
        goes_on_by_a_rule(system)
    dt = checks.step(dt)
    if single:
        from . import float32  # only such runs need it

        dt = float32.step(system, how, form, dt, events=asked is not None)
    goes_on_alike(how, dt, carried_by, dt_before)
    t0 = checks.beginning(t0)
    steps = checks.count("steps", steps, 1)
    start_step = checks.count("start_step", start_step, 0, checks.LAST_STEP - steps)
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
    if carry is not None and how.carry is None and carried_by is not None:
        raise ArgumentError("carry: it is that of a run with a tolerance, which goes on with at= and without dt= and steps=")
    if carry is not None and how.carry is None:
        raise ArgumentError(f"carry: {how.name} carries nothing but v between steps")

    finite = first_bad_step is None
    v = checks.block("v", v, system.v_shape, system.axes, finite=finite)
    slot = None if carry is None else checks.block("carry", carry, system.v_shape, system.axes, finite=finite)
    y = checks.block("y", y, system.y_shape, system.axes, finite=finite)
    batches = {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    if slot is not None:
        batches["carry"] = slot.shape[len(system.v_shape) :]
    if control is not None:
        batches["control"] = control.batch
    if has_own_times := isinstance(t0, np.ndarray):
        batches["t0"] = np.shape(t0)
        fits_own_times(system, single)
    if force is not None:
        forced(system)
        force = checks.block("force", force, system.v_shape, system.axes)
        batches["force"] = force.shape[len(system.v_shape) :]
    batch = checks.batch_shape(batches)
    rows = prod(system.v_shape) + prod(system.y_shape)
    if has_own_times:
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
        for name, block in (("v", v), ("y", y), ("carry", slot), ("force", force)):
            checks.fits_single(name, block)
        if control is not None:  # whose target is that of the start as it is stepped
            v, y = (np.asarray(block, np.float32).astype(np.float64) for block in (v, y))
    v, y = spread(v, system.v_shape, batch), spread(y, system.y_shape, batch)
    if control is not None:
        system = system.controlled(control, v, y, dt)
        fits_together(system, how)
        if single:
            float32.check_control(system)
    system = system.stepped_by(how)
    stepped = system.over_steps(how, checks.once_of(t0) if has_own_times else t0, dt)
    carried = slot is not None and continuation.holds(carried_for, system, batch, v, y)
    if slot is not None and carried:
        v = spread(slot, system.v_shape, batch)
    before = checks.diverged_before(first_bad_step, v, y, batch, start_step)

    if force is not None:
        plan = plan._replace(force=spread(force, system.v_shape, batch))
    if record or stepped is not plan.system:
        # In float32 they are computed from the saved states, in float64.
        kept = () if single else tuple(name for name in record if name in system.quantities)
        plan = plan._replace(system=stepped, record=kept)
    make: Callable[[engine.Plan], engine.Outcome] = partial(engine.advance, v=v, y=y, before=before, carried=carried)
    ended = None
    if asked is not None:
        from .events import driver  # only such runs need it

        ended = driver.Run(asked, v, y, before, carried)
        make = ended.made
    if checks.flag("progress", progress):
        with bar_of(f"{how.title}, {steps} steps") as told:
            out = make(plan._replace(progress=told))
    else:
        out = make(plan)
    collides, alone = isinstance(system, NBody), plan.of_core()  # bodies know no time
    if collides:
        v, y = _kept(v), _kept(y)  # for ``collisions`` and ``encounters``; the arrays that were given are the user's to change
    run = Run(
        t=_times(plan),
        v=out.v,
        y=out.y,
        # Status.OK is 0 and Status.DIVERGED 1
        status=np.asarray(out.first_bad >= 0).view(np.int8) if out.diverged else np.zeros(batch, np.int8),
        first_bad_step=out.first_bad,
        carry=None if how.carry is None else out.slot,
        system=system,
        method=how,
        dt=dt,
        t0=t0,
        start_step=start_step,
        steps=steps,
        start=how.starts[choice] if how.starts else None,
        fused=fused,
        collision=partial(encounters.collision, alone, v, y, carried) if collides else None,
        encounter=partial(encounters.of_member, alone, v, y, carried, steps) if collides else None,
        overshoots=partial(encounters.overshoots, alone, v, y, carried, steps) if collides else None,
        recorded=out.recorded,
        work=out.work,
        force=plan.force,
    )
    if ended is not None:
        ended.tell(run)
    if single:
        run.recorded |= {name: run.quantity(name) for name in record}
    for name in plan.record:
        if name not in run.recorded:
            run.recorded[name] = run.quantity(name)
    if "energy" in record and "energy" not in run.recorded:
        run.recorded["energy"] = run.energy
    if out.diverged:
        _warn(run, before, None if carried else (v, y))
    begun = None if carried or before is not None or not _is_one_motion(asked) else (v, y)
    warn_of_nonsense(run, begun)
    registry.task("warn_of_growth")(run, begun)
    return run


def _is_one_motion(events: Sequence[Event] | None) -> bool:
    """Whether no event changes the state, so that its end tells of its start."""
    return not any(event.then for event in events or ())


def _asked(events: Any, form: str) -> list[Event]:
    """The events that were asked for."""
    from .events.event import several

    if form != "direct":
        raise UnsupportedError(f"events: goes with form='direct' only, got form={form!r}")
    return several(events)


def _times(plan: engine.Plan) -> Array:
    """t0 + k·dt of every saved state; there may be millions of them."""
    if plan.every is None:
        return np.array([plan.t0 + (plan.first + plan.steps) * plan.dt])
    t: Array = buffer_pool.empty((plan.kept,))
    _core.times(plan.of_core(), t)
    return plan.t0 + t.reshape(-1, *(1,) * len(plan.batch)) if isinstance(plan.t0, np.ndarray) else t


def _last_time(t0: Any, dt: float, start_step: int, steps: int) -> float:
    """The largest time in size; raise if one does not move on, or is not finite."""
    begin, end = t0 + start_step * dt, t0 + (start_step + steps) * dt
    index: tuple[int, ...] = ()
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


def _only_fixed(given: dict[str, Any]) -> None:
    """Raise if something was given that goes with fixed steps only."""
    if wrong := [name for name, value in given.items() if value is not None]:
        raise ArgumentError(f"{', '.join(wrong)}: goes with fixed steps only, and tolerance= or at= was given")


def _kept(array: Array) -> Array:
    """A copy that is as small as what it was spread from."""
    own = checks.once_of(array).copy()
    return own if own.shape == array.shape else np.broadcast_to(own, array.shape)


def _warn(run: Run, before: Whole | None, start: tuple[Array, Array] | None) -> None:
    """Warn of the members that diverged in this run; ``start`` is where it began, if not from what a method carries."""
    if not np.count_nonzero(run.status):
        return
    bad = run.first_bad_step >= 0 if before is None else (run.first_bad_step >= 0) & (before < 0)
    if not bad.any():
        return
    step = int(run.first_bad_step[bad].min())
    first = tuple(np.argwhere(bad & (run.first_bad_step == step))[0].tolist())
    met = ""
    if run.collision is not None and (step - run.start_step) * run.v[-1].size // bad.size <= encounters.MAX_RERUN:
        pair = run.collision(first, step)
        if pair.distance < np.inf:
            met = f"; bodies {pair.bodies[0]} and {pair.bodies[1]} were {pair.distance:.3g} apart before it"
    if start is not None and step == run.start_step + 1 and not met:
        from .stops import of_the_start  # only such runs need it

        t = time_of(run, run.start_step, first)
        if wrong := of_the_start(run.system, run.status.shape, run.t0 + run.start_step * run.dt, start, first):
            met = f"; {wrong} at the start, t = {t:g}"
    some = int(np.count_nonzero(bad))
    warnings.warn(
        f"{share(some, bad.shape, bad.size)} diverged{first_of(some, first, bad.size)} at step {step} "
        f"(t = {time_of(run, step, first):g}), by {run.method.name} with dt = {run.dt:g}{met}",
        DivergenceWarning,
        stacklevel=3,
    )
