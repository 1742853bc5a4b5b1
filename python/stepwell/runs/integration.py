"""Runs: one trajectory or a hundred thousand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..base import checks
from ..model.controls import AnyControl
from ..model.methods import Method
from ..model.systems import System
from .findings import is_heard, warn_of
from .making import noticing
from .options import Options
from .request import Request
from .result import Run
from .short_runs import short_run

if TYPE_CHECKING:
    from ..base.literals import Backend, StepForm
    from .world import World


#: The default of ``record``.
NOTHING = ()


#: What arguments of SciPy's and of other solvers are here.
HINTS = {
    "t_span": "its start is t0=, its end follows from dt= and steps=, or is the last of at= with tolerance=",
    "t_eval": "with tolerance= the times of saved states are at=, with fixed steps each every=-th is saved",
    "args": "parameters are those of the system, by their names, such as decay(rate=2.0)",
    "y0": "the state at the start is y=, and v= of second-order systems",
    "v0": "the velocity at the start is v=",
    "rtol": "tolerance=1e-6 is relative, tolerance=(rtol, atol) has both parts",
    "atol": "tolerance=(rtol, atol) has both parts",
    "first_step": "with tolerance= the first step to try is dt=",
    "save_every": "each so many steps are saved by every=",
    "saveat": "with tolerance= the times of saved states are at=, with fixed steps each every=-th is saved",
    "n_steps": "the number of steps is steps=",
    "dense_output": "every=1 keeps all steps, and run(t) is the state at any time; at= are times known before",
}


@checks.with_hints(HINTS)
def integrate(
    system: System,
    method: str | Method,
    *,
    v: Any = None,
    y: Any = None,
    dt: float | None = None,
    steps: int | None = None,
    every: int | None = None,
    tolerance: Any = None,
    at: Any = None,
    control: AnyControl | None = None,
    force: Any = None,
    record: str | Sequence[str] | None = (),
    events: Any = None,
    form: StepForm = "direct",
    fused: bool | None = None,
    dtype: Any = None,
    t0: Any = None,
    start: str | None = None,
    max_steps: int | None = None,
    max_step: Any = None,
    jumps: Any = None,
    positive: Any = None,
    progress: bool = False,
    threads: int | None = None,
    backend: Backend = "rust",
    device: str | None = None,
    start_step: int | None = None,
    resume: Run | World | None = None,
) -> Run:
    """Step a system, or a batch of it.

    Every parameter of the system and both blocks broadcast; batch axes come last. A member that diverges does not affect the
    others. The result is the same to the last bit on every CPU, for every number of threads, with either backend, alone or
    in a batch, in one piece or in several.

    Most runs need ``v``, ``y``, ``dt``, ``steps`` and ``every``, or ``tolerance`` and ``at``. A run that continues another needs
    ``resume`` and ``steps``, or ``resume`` and ``at``.

    Args:
        system: the system to step.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block at the start, shape (*block, *batch), or one number for all; a first-order system has none.
        y: coordinate block at the start, likewise.
        dt: the step, in units of time, below zero to go back. With a tolerance, the step
            to try first; if None, a hundredth of the time in which the state changes at the start, or from rest 2⁻²⁰ units of
            time, or that part of a run of less than 2⁻¹⁵ units.
        steps: number of steps, one or more.
        every: save the state at the start, after each ``every`` steps and after the last; None saves the last alone. With a
            tolerance accepted steps of each member count, and ``at`` is one time, the end; rows of ``run.t``, v and y are NaN
            where a member has made fewer steps than another.
        tolerance: in place of ``steps``, for adaptive steps: every member has steps of its own, such that the estimated error of
            each stays below this. One number is relative to the present size: of own equations to that of each component, so that
            units do not matter; of built-in systems, whose directions are equivalent, to the length of each block. For a
            component that decays to nothing and never comes back a tuple (relative, absolute) takes fewer steps: it allows
            relative·size + absolute, as SciPy's rtol and atol, the absolute part in the units of the state. Each is a number, an
            array over the batch, or one with a number for each component, shape (*block, …) of y, which v has too; a list is
            refused. For methods with an ``error_order``: merson, fehlberg, fehlberg_5, bs32, dopri5, tsit5, vern7, dop853, vern9,
            taylor, and for stiff equations rosenbrock23, rodas4, rodas5p.
        at: with a tolerance, the times at which to save the state, from t0 on, ascending, or descending for a run backward in
            time; shape (times,), or (times, *batch) for times of each member. A state within a step is computed by an extra step
            from its start, by ``taylor`` as the sum of its series. Steps do not depend on these times, unless the extra step
            errs by more than is tolerated: the step missed something and is rejected.
        control: an ``EnergyControl`` or a ``Projection``, to keep the energy constant, or another control or projection; with a
            tolerance, too, where a projection acts on accepted steps. Verlet and leapfrog go without.
        force: what is added to v̇ in every stage, constant over the run, in the units of v per unit of time: for bodies a force
            per mass, that is an acceleration. Shape (*block, *batch) of v, or one number for all. With fixed and adaptive steps;
            in a ``World`` it may change.
        record: quantities to record of every saved state, ``run.recorded``: "energy", those that the system names in its
            ``quantities``, and what a sampled controller sets, as it was held up to there; nothing if None. Bodies compute their
            energy together with the force of the next step, at little cost.
        events: quantities of a state whose changes of sign are located to the accuracy of the method, ``run.events``: a function
            g(t, v, y), an ``Event``, which may also stop a member, or a list of them. Goes with fixed and adaptive steps in the
            direct form (docs/howto/events.md).
        form: ``"direct"``, or ``"matrix"`` for the transition matrix of a linear system (Appendix B).
        fused: compute each step with fused multiply-adds, a·b + c rounded once. The bits differ from those without, and are the
            same on every machine and with either backend. For steps of up to some 100 000 operations, and for any number of
            bodies, whose Newtonian force is then made without root and quotient (docs/theory/numerics.md).
        dtype: ``"float64"`` or ``"float32"``, half the width and twice the members in a vector: start, parameters and dt are
            rounded to it once, and so is the result of every operation of a step; v and y are returned in it. The bits are the
            same on every machine and with either backend. With a tolerance, of 2⁻²³ = 1.2e-7 or more, time and controller are
            float64. For steps of up to some 100 000 operations, in the direct and the matrix form; not for ``taylor``.
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
        positive: with a tolerance, the components that must not become negative: True for all of y, or an index of y, a tuple
            such as ("v", 0), or a list of these. A step that makes one negative is rejected; a member stops where no step is
            small enough.
        progress: show a progress bar, in a terminal or in a notebook.
        threads: how many threads share the members, or the pairs of many bodies; None for as many as are worthwhile.
        backend: ``"rust"``, or ``"numpy"`` for the reference.
        device: "cpu", or "opencl" for the first device of OpenCL and "opencl:1" for the second, as ``stepwell.devices()`` lists
            them. None is the CPU, or what the environment variable ``STEPWELL_DEVICE`` names. The bits are those of the CPU.
            Fixed and adaptive steps of up to some 100 000 operations; events of adaptive steps are looked for by the CPU, and the
            run is then made by the device. Needs ``pip install "stepwell[gpu]"`` (docs/howto/gpu.md).
        start_step: number of the first step, 0 if None: it begins at t0 + start_step·dt.
        resume: a run or a ``World`` that this one continues, as if it had never stopped, to the bit. Its state, time and step are
            known, and so are its control, force, ``start``, ``fused``, ``dtype``, and with a tolerance that and ``max_step``,
            ``jumps``, ``positive``; the same may be given again. With another system or control, or ``v`` or ``y`` of your own,
            the run begins anew there from this state; with a tolerance at the last time that was asked for. Another ``dt``, or
            another method where more than the state is carried, is refused. Events are given again; if one changed the state,
            ``events`` is needed, and ``[]`` goes on without. Members that diverged stay as they are, without a second warning.

    Returns:
        A ``Run``.

    Raises:
        ArgumentError: before any work, if an argument is wrong; the message says what was expected.
        UnsupportedError: if the method cannot step the system, or options do not go together.
        KeyboardInterrupt: within a tenth of a second of Ctrl-C.

    Warns:
        DivergenceWarning: how many members left the finite range, which first, and when. Nothing computed is lost.
        ToleranceWarning: how many members stopped before the last time of ``at``, and why; or that an absolute tolerance is so
            large that the motion is lost in it.
        StiffnessWarning: how many members had steps that stability held down, and not the tolerance, with the limit and how much
            longer steps the tolerance allows.
        AccuracyWarning: if the numbers of a run are finite but mean nothing: a pendulum turned so far that its angle has no sine;
            a state grew a million times by fixed steps that are beyond the stability limit at the start; bodies without control,
            or with a tolerance any system whose energy or declared invariant is constant, ended with another energy; a motion
            along a line passed a barrier that is higher than its energy; bodies met within one step, which is then named. This is
            checked if it is little work beside the run, or if something suggests it (docs/howto/nbody.md); not in the pieces of a
            run that carries something. ``Run.encounters`` checks every step.

    Example:
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, every=50)
        >>> run.y.round(6)
        array([ 1.      ,  0.283658, -0.839075])
    """
    options = Options(
        v, y, dt, steps, every, tolerance, at, control, force, None if record is NOTHING else record, events, form, fused, dtype,
        t0, start, max_steps, max_step, jumps, positive, progress, threads, backend, device, start_step, resume,
    )  # fmt: skip
    run = short_run(system, method, options)
    if run is None:
        run = noticing(Request.of(system, method, options), is_heard)
    if run.findings:
        warn_of(run.findings, 3)
    return run
