"""Runs: one trajectory or a hundred thousand."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
from math import prod
from typing import Any

import numpy as np

from . import _checks, engine
from ._checks import Array
from .control import EnergyControl, Projection
from .errors import ArgumentError, DivergenceWarning, DTypeError, ShapeError, ToleranceWarning, UnsupportedError
from .methods import Method
from .methods import method as find_method
from .methods import methods as every_method
from .reference.types import Whole
from .result import Collision, Paces, Run, Status
from .systems import NBody, Sampled, System

BACKENDS = ("rust", "numpy")
FORMS = ("direct", "matrix", "power")

#: A warning says which bodies met if the member can be run again in so many steps times numbers, a moment. Otherwise
#: ``Run.collisions`` is there to ask.
QUICK = 10_000_000


def integrate(
    system: System,
    method: str | Method,
    *,
    v: Any,
    y: Any,
    dt: float | None = None,
    steps: int | None = None,
    tolerance: Any = None,
    at: Any = None,
    max_steps: int = 1_000_000,
    every: int | None = None,
    record: Sequence[str] = (),
    t0: float = 0.0,
    start_step: int = 0,
    start: str | None = None,
    carry: Any = None,
    first_bad_step: Any = None,
    control: EnergyControl | Projection | None = None,
    form: str = "direct",
    threads: int | None = None,
    backend: str = "rust",
    progress: bool = False,
) -> Run:
    """Step a system, or a batch of it.

    Every parameter of the system and both blocks broadcast; batch axes come last. One diverged member never touches its
    neighbours. The result is the same to the last bit on every CPU, for every number of threads, with either backend, alone or
    in company, in one piece or in several.

    Args:
        system: what to step.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block at the start, shape (*block, *batch), or one number for all.
        y: coordinate block at the start, likewise.
        dt: the step, in units of time, above zero. With a tolerance, the step to try first; a thousandth of the time if None.
        steps: how many steps, one or more.
        tolerance: in place of ``steps``: every member chooses its own steps so that the estimated error of each stays below this,
            relative to the length of each block and beside it (error ≤ tolerance·(1 + length)); or a pair (relative,
            absolute). Each broadcasts over the batch. Methods that can say so by ``error_order``: merson, fehlberg, fehlberg_5,
            dop853.
        at: with a tolerance, the times at which to keep the state, ascending, from t0 on. They are reached exactly.
        max_steps: with a tolerance, the most steps of a member, rejected ones counted.
        every: keep the state every so many steps, with the first and the last; None keeps the last alone.
        record: quantities to record of every kept state, ``run.recorded``: "energy", and what else the system names in its
            ``quantities``. Bodies find their energy beside the force of the next step, at little cost.
        t0: time of step 0. Step k is at t0 + k·dt, computed so and never accumulated.
        start_step: number of the first step. A run in pieces (``run.resume``) equals the run in one piece to the bit.
        start: how a method with a choice starts; see ``method(…).starts``.
        carry: what a method carries in the place of v, from ``run.resume``; ``v`` is then not used.
        first_bad_step: members that diverged before, from ``run.resume``; only they may begin with NaN or infinities.
        control: what keeps the energy: an ``EnergyControl`` or a ``Projection``.
        form: ``"direct"``; ``"matrix"`` for the transition matrix of a linear system (Appendix B); ``"power"`` for powers of it,
            which make any number of steps at once and need inputs that are constants or sinusoids.
        threads: how many threads share the members, or the pairs of many bodies; None for as many as pay.
        backend: ``"rust"``, or ``"numpy"`` for the reference.
        progress: show a progress bar (needs rich).

    Returns:
        A ``Run``.

    Raises:
        ArgumentError: before any work: what was given and what was expected.
        UnsupportedError: if the method cannot do the system.
        KeyboardInterrupt: within a tenth of a second of Ctrl-C.

    Warns:
        DivergenceWarning: how many members left the finite range, which first, and when. Nothing computed is lost.
    """
    if not isinstance(system, System):
        raise DTypeError(f"system: expected a stepwell system such as Oscillator(), got {type(system).__name__}")
    how = find_method(method)
    system = system.sized(v, y)
    fits_together(system, how)
    if tolerance is not None or at is not None:
        fixed = {
            "steps": steps,
            "every": every,
            "start": start,
            "carry": carry,
            "first_bad_step": first_bad_step,
            "control": control,
        }
        fixed |= {"start_step": start_step or None, "form": None if form == "direct" else form}
        _only_fixed(fixed)
        return _adapt(system, how, v, y, dt, tolerance, at, max_steps, record, t0, threads, backend, progress)
    if dt is None or steps is None:
        missing = " and ".join(name for name, given in (("dt", dt), ("steps", steps)) if given is None)
        raise ArgumentError(f"{missing}: expected with fixed steps; or give tolerance= and at= for steps of chosen length")
    form = _checks.known("form", form, FORMS)
    backend = _checks.known("backend", backend, BACKENDS)
    if form != "direct" and not system.linear:
        raise UnsupportedError(f"form: only linear systems have a transition matrix, and {system!r} is not linear")
    if control is not None and not isinstance(control, (EnergyControl, Projection)):
        raise DTypeError(f"control: expected an EnergyControl or a Projection, got {type(control).__name__}")
    if form == "power":
        _goes_on_by_a_rule(system)
    dt = _checks.number("dt", dt, positive=True, unit="units of time")
    t0 = _checks.number("t0", t0, unit="units of time")
    steps = _checks.count("steps", steps, 1)
    start_step = _checks.count("start_step", start_step, 0, _checks.LAST_STEP - steps)
    system.check_time(max(abs(t0 + k * dt) for k in (start_step, start_step + steps)))
    every = None if every is None else _checks.count("every", every, 1)
    record = _quantities(system, record)
    workers = 0 if threads is None else _checks.count("threads", threads, 1, 4096)
    choice = how.start_choice(start)
    if carry is not None and how.carry is None:
        raise ArgumentError(f"carry: {how.name} carries nothing but v between steps")

    finite = first_bad_step is None
    v = _checks.block("v", v, system.v_shape, system.axes, finite=finite)
    if carry is not None:
        v = _checks.block("carry", carry, system.v_shape, system.axes, finite=finite)
    y = _checks.block("y", y, system.y_shape, system.axes, finite=finite)
    batches = {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    batch = _checks.batch_shape(batches if control is None else batches | {"control": control.batch})
    rows = prod(system.v_shape) + prod(system.y_shape)
    kept = 1 if every is None else steps // every + 2
    _checks.fits("the kept states", rows * (kept + 1), batch, "keep less with every= or split the batch")
    v, y = _spread(v, system.v_shape, batch), _spread(y, system.y_shape, batch)
    if control is not None:
        system = system.controlled(control, v, y, dt)
        fits_together(system, how)
    before = _checks.diverged_before(first_bad_step, v, y, batch)

    with _bar(f"{how.title}, {steps} steps") if progress else nullcontext(None) as told:
        beside = tuple(name for name in record if name in system.quantities)
        plan = engine.Plan(system, how, batch, dt, t0, start_step, steps, every, choice, workers, backend, form, told, beside)
        out = engine.advance(plan, v, y, before, carried=carry is not None)
    if isinstance(system, NBody) and (out.first_bad > start_step).any():
        v, y = v.copy(), y.copy()  # kept for ``collisions``; the arrays that were given are the user's to change
    run = Run(
        t=t0 + (start_step + plan.saves.astype(np.float64)) * dt,
        v=out.v,
        y=out.y,
        status=np.asarray(out.first_bad >= 0).view(np.int8),  # Status.OK is 0 and Status.DIVERGED 1
        first_bad_step=out.first_bad,
        carry=None if how.carry is None else out.slot,
        system=system,
        method=how,
        dt=dt,
        t0=t0,
        start_step=start_step,
        steps=steps,
        start=how.starts[choice] if how.starts else None,
        collision=partial(_collision, plan, v, y, carry is not None) if isinstance(system, NBody) else None,
        recorded=out.recorded,
        work=out.work,
    )
    if "energy" in record and "energy" not in run.recorded:
        run.recorded["energy"] = run.energy
    _warn(run, before)
    return run


def _only_fixed(given: dict[str, Any]) -> None:
    """Raise if something was given that goes with fixed steps only."""
    if wrong := [name for name, value in given.items() if value is not None]:
        raise ArgumentError(f"{', '.join(wrong)}: goes with fixed steps only, and tolerance= or at= was given")


def _adapt(
    system: System,
    how: Method,
    v: Any,
    y: Any,
    dt: Any,
    tolerance: Any,
    at: Any,
    max_steps: Any,
    record: Sequence[str],
    t0: Any,
    threads: int | None,
    backend: str,
    progress: bool,
) -> Run:
    """The run with a tolerance."""
    if how.error_order is None:
        able = ", ".join(m.name for m in every_method() if m.error_order is not None)
        raise UnsupportedError(f"tolerance: {how.name} does not estimate its error, so it cannot choose its steps; use {able}")
    if tolerance is None or at is None:
        raise ArgumentError(f"{'tolerance' if tolerance is None else 'at'}: expected too, since the other was given")
    t0 = _checks.number("t0", t0, unit="units of time")
    times = _checks.numbers("at", at, unit="units of time")
    if times.ndim != 1 or len(times) == 0:
        raise ShapeError(f"at: expected times along one axis, got shape {times.shape}")
    if times[0] < t0 or (np.diff(times) <= 0).any():
        raise ArgumentError(
            f"at: expected times that ascend from t0 = {t0:g} on, got {times[:5].tolist()}{'…' * (len(times) > 5)}"
        )
    system.check_time(max(abs(t0), abs(float(times[-1]))))
    backend = _checks.known("backend", backend, BACKENDS)
    budget = _checks.count("max_steps", max_steps, 1)
    pair = tolerance if isinstance(tolerance, tuple) else (tolerance, tolerance)
    if len(pair) != 2:
        raise ShapeError(f"tolerance: expected a number or a pair (relative, absolute), got {len(pair)} of them")
    relative, absolute = (_checks.numbers("tolerance", each, positive=True) for each in pair)
    if dt is None:
        dt = 1e-3 * (float(times[-1]) - t0) or 1.0
    first = _checks.numbers("dt", dt, positive=True, unit="units of time")
    v = _checks.block("v", v, system.v_shape, system.axes)
    y = _checks.block("y", y, system.y_shape, system.axes)
    batch = _checks.batch_shape(
        {"system": system.batch, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
        | {"tolerance": np.broadcast_shapes(relative.shape, absolute.shape), "dt": first.shape}
    )
    record = _quantities(system, record)
    workers = 0 if threads is None else _checks.count("threads", threads, 1, 4096)
    numbers = prod(system.v_shape) + prod(system.y_shape)
    _checks.fits("the kept states", numbers * (len(times) + 1), batch, "ask for fewer times or split the batch")
    v, y = _spread(v, system.v_shape, batch), _spread(y, system.y_shape, batch)
    with _bar(f"{how.title} to t = {times[-1]:g}") if progress else nullcontext(None) as told:
        plan = engine.Plan(system, how, batch, 1.0, t0, threads=workers, backend=backend, progress=told)
        out = engine.adapt(plan, engine.Pacing(times.tolist(), first, relative, absolute, budget), v, y)
    run = Run(
        t=times,
        v=out.v,
        y=out.y,
        status=out.status.astype(np.int8),
        first_bad_step=np.where(out.status == 0, -1, out.accepted + 1),
        carry=None,
        system=system,
        method=how,
        dt=1.0,
        t0=t0,
        start_step=0,
        steps=0,
        start=None,
        paces=Paces(out.t, out.h, out.accepted, out.rejected, how.evaluations * (out.accepted + out.rejected)),
    )
    for name in record:
        run.recorded[name] = run.quantity(name)
    _warn_of_stops(run)
    return run


#: Why a member of a run with a tolerance stopped, in words.
_WHY = {
    Status.BUDGET: "out of max_steps",
    Status.UNDERFLOW: "the step that the tolerance asks for is too small to move the time",
    Status.NOT_FINITE: "no step, however small, gives finite numbers",
}


def _warn_of_stops(run: Run) -> None:
    if not run.status.any() or run.paces is None:
        return
    stopped = run.status != 0
    time = float(run.paces.t[stopped].min())
    first = tuple(int(i) for i in np.argwhere(stopped & (run.paces.t == time))[0])
    who = f"member {first if len(first) != 1 else first[0]}" if first else "the only member"
    warnings.warn(
        f"{np.count_nonzero(stopped)} of {stopped.size} member(s) stopped before t = {run.t[-1]:g}; first {who} at t = {time:g}: "
        f"{_WHY[Status(int(run.status[first]))]}",
        ToleranceWarning,
        stacklevel=4,
    )


def _collision(plan: engine.Plan, v: Array, y: Array, carried: bool, index: tuple[int, ...], step: int) -> Collision:
    """Which bodies were nearest in the last state that was finite: the member is run again up to there, alone."""
    system, steps = plan.system, step - 1 - plan.first
    assert isinstance(system, NBody)
    alone, y = system.member(index, plan.batch), _checks.member(y, index)
    if steps > 0:
        again = plan._replace(system=alone, batch=(), steps=steps, every=None, form="direct", progress=None, record=())
        y = engine.advance(again, _checks.member(v, index), y, carried=carried).y[-1]
    bodies, distance = alone.closest(y)
    return Collision(index, step, bodies, distance)


def fits_together(system: System, method: Method) -> None:
    """Raise if the method cannot do the system."""
    if not method.needs_acceleration:
        return
    if not system.second_order:
        raise UnsupportedError(f"{method.name} needs a second-order system, ÿ = a(t, y); {system!r} is not one")
    if system.velocity_term is not None:
        raise UnsupportedError(
            f"{method.name} needs forces that do not depend on the velocity, but {system!r} has {system.velocity_term}; "
            f"use false_euler, or leave {system.velocity_term} out"
        )


def _quantities(system: System, record: Sequence[str]) -> list[str]:
    """What to record, each once; raise if the system does not have it."""
    given = [record] if isinstance(record, str) else list(record)
    known = list(dict.fromkeys(["energy", *system.quantities]))
    for name in given:
        _checks.known("record", name, known)
    if "energy" in given and "energy" not in system.quantities:
        v, y = (np.zeros((*shape, *system.batch)) for shape in (system.v_shape, system.y_shape))
        system.energy(v, y)  # raises if there is none, before any work
    return list(dict.fromkeys(given))


def _goes_on_by_a_rule(system: System) -> None:
    """Raise if an input cannot be carried by a power of the transition matrix."""
    for name, given in system.given_inputs().items():
        if isinstance(given, Sampled) and not given.constant:
            raise UnsupportedError(
                f"form: many steps are one power only if the inputs go on by a rule, as constants and sinusoids do, but {name} "
                f"changes from sample to sample; use form='matrix' or 'direct'"
            )


def _spread(array: Array, block: tuple[int, ...], batch: tuple[int, ...]) -> Array:
    """A state over the whole batch."""
    axes = array.shape[len(block) :]
    if axes == batch:
        return array
    if not array.ndim:
        return _checks.over(array, batch)
    return np.broadcast_to(array.reshape((*block, *(1,) * (len(batch) - len(axes)), *axes)), (*block, *batch))


def _bar(title: str) -> Any:
    try:
        from ._progress import bar
    except ImportError:
        raise UnsupportedError("progress: a progress bar needs rich; pip install 'stepwell[progress]'") from None
    return bar(title)


def _warn(run: Run, before: Whole | None) -> None:
    """Warn of the members that diverged in this run."""
    if not np.count_nonzero(run.status):
        return
    bad = run.first_bad_step >= 0 if before is None else (run.first_bad_step >= 0) & (before < 0)
    if not bad.any():
        return
    step = int(run.first_bad_step[bad].min())
    first = tuple(int(i) for i in np.argwhere(bad & (run.first_bad_step == step))[0])
    who = f"member {first if len(first) != 1 else first[0]}" if first else "the only member"
    met = ""
    if run.collision is not None and (step - run.start_step) * run.v[-1].size // bad.size <= QUICK:
        pair = run.collision(first, step)
        if pair.distance < np.inf:
            met = f"; bodies {pair.bodies[0]} and {pair.bodies[1]} were {pair.distance:.3g} apart before it"
    warnings.warn(
        f"{np.count_nonzero(bad)} of {bad.size} member(s) diverged; first {who} at step {step} "
        f"(t = {run.t0 + step * run.dt:g}), by {run.method.name} with dt = {run.dt:g}{met}",
        DivergenceWarning,
        stacklevel=3,
    )
