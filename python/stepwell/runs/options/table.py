"""The options of runs, each in one place: its type, its documentation, its check, and with which runs it goes.

``integrate``, ``World``, ``sweep`` and ``prepare`` have signature, documentation and refusals of their options from here.
"""

# Without ``from __future__ import annotations``: the annotations are read.
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

import numpy as np

from ...base import checks
from ...errors import ShapeError
from ...model.compatibility import forced
from ...model.controls import a_control
from . import single
from .option import No, Option

if TYPE_CHECKING:
    from ...base.literals import Backend, StepForm
    from ...model.controls import AnyControl
    from ..continuation import Standing
    from ..result import Run
    from .checked import Checked

#: Default of ``max_steps``: the most steps of a member of a run with a tolerance.
MOST_STEPS = 1_000_000

_FIXED_ONLY = No("works with fixed steps only, {adaptive}")
_ADAPTIVE_ONLY = No("works with tolerance= and at= only; all steps of fixed length are dt long")
_NO_ADAPTIVE_WORLD = No("a world has fixed steps, which keep time with a clock; integrate has adaptive ones")
_OF_A_RUN = No("a world does not keep states; integrate does")


def _dt(value: Any, asked: "Checked") -> Any:
    """The step; with a tolerance the one to try first, of all members or of each."""
    if asked.is_adaptive:
        return checks.numbers("dt", value, unit="units of time")
    dt = checks.number("dt", value, positive=True, unit="units of time") if asked.way == "step" else checks.step(value)
    if asked["dtype"]:
        from .. import float32  # only such runs need it

        dt = float32.step(asked.system, asked.method, dt)
    return dt


def _at(value: Any, asked: "Checked") -> Any:
    times = np.atleast_1d(checks.numbers("at", value, unit="units of time"))
    if times.size == 0:
        raise ShapeError(f"at: expected times along the first axis, got shape {times.shape}")
    return times


def _t0(value: Any, asked: "Checked") -> Any:
    if asked.way is not None:
        return checks.number("t0", value, unit="units of time")
    return checks.numbers("t0", value, unit="units of time") if asked.is_adaptive else checks.beginning(value)


def _block(name: str, value: Any, asked: "Checked") -> Any:
    """A block of the start, or the force; a world, which steps them in place, checks its arrays itself."""
    if asked.way == "World":
        return value
    if name == "force":
        forced(asked.system)
    shape = asked.system.y_shape if name == "y" else asked.system.v_shape
    return checks.block(name, value, shape, asked.system.axes, finite=asked.is_finite or name == "force")


class RunOptions(TypedDict, total=False):
    """The keyword arguments of ``integrate``."""

    v: Annotated[
        Any,
        Option(
            """velocity block at the start, shape (*block, *batch), or one number for all; a first-order system has none.""",
            check=lambda v, asked: _block("v", v, asked),
            batch=lambda v, system: v.shape[len(system.v_shape) :],
            ways={
                "World": """velocity block, a writeable C-contiguous array of ``dtype`` and of shape (*block, *batch).""",
            },
        ),
    ]
    y: Annotated[
        Any,
        Option(
            """coordinate block at the start, likewise.""",
            check=lambda y, asked: _block("y", y, asked),
            batch=lambda y, system: y.shape[len(system.y_shape) :],
            ways={"World": """coordinate block, likewise; it may share no memory with ``v``."""},
        ),
    ]
    dt: Annotated[
        float | None,
        Option(
            """the step, in units of time, below zero to go back. With a tolerance, the step
            to try first; if None, a hundredth of the time in which the state changes at the start, or from rest 2⁻²⁰ units of
            time, or that part of a run of less than 2⁻¹⁵ units.""",
            check=_dt,
            batch=lambda dt, system: np.shape(dt),
        ),
    ]
    steps: Annotated[
        int | None,
        Option(
            """number of steps, one or more.""",
            check=lambda steps, asked: checks.count("steps", steps, 1),
            ways={
                "adaptive": _FIXED_ONLY,
                "World": No("a world is stepped by world.step(n)"),
            },
        ),
    ]
    every: Annotated[
        int | None,
        Option(
            """save the state at the start, after each ``every`` steps and after the last; None saves the last alone. With a
            tolerance accepted steps of each member count, and ``at`` is one time, the end; rows of ``run.t``, v and y are NaN
            where a member has made fewer steps than another.""",
            check=lambda every, asked: checks.count("every", every, 1),
            ways={"World": _OF_A_RUN, "sweep": """steps between the states of a history, or of the runs that functions get."""},
        ),
    ]
    tolerance: Annotated[
        Any,
        Option(
            """in place of ``steps``, for adaptive steps: every member has steps of its own, such that the estimated error of
            each stays below this. One number is relative to the present size: of own equations to that of each component, so that
            units do not matter; of built-in systems, whose directions are equivalent, to the length of each block. For a
            component that decays to nothing and never comes back a tuple (relative, absolute) takes fewer steps: it allows
            relative·size + absolute, as SciPy's rtol and atol, the absolute part in the units of the state. Each is a number, an
            array over the batch, or one with a number for each component, shape (*block, …) of y, which v has too; a list is
            refused. For methods with an ``error_order``: merson, fehlberg, fehlberg_5, bs32, dopri5, tsit5, vern7, dop853, vern9,
            taylor, and for stiff equations rosenbrock23, rodas4, rodas5p.""",
            ways={
                "World": _NO_ADAPTIVE_WORLD,
                "sweep": """in place of ``steps``, for adaptive steps of each member: a number, or a pair (relative, absolute), as
                for ``integrate``. An axis of this name has the relative ones.""",
            },
        ),
    ]
    at: Annotated[
        Any,
        Option(
            """with a tolerance, the times at which to save the state, from t0 on, ascending, or descending for a run backward in
            time; shape (times,), or (times, *batch) for times of each member. A state within a step is computed by an extra step
            from its start, by ``taylor`` as the sum of its series. Steps do not depend on these times, unless the extra step
            errs by more than is tolerated: the step missed something and is rejected.""",
            check=_at,
            batch=lambda times, system: times.shape[1:],
            ways={
                "World": _NO_ADAPTIVE_WORLD,
                "sweep": """with a tolerance, the times whose states are observed: the last is that of "last", a history has all
                of them, and reductions see the states at these times and no others. Not with ``transient``, ``every`` or
                ``observe``.""",
            },
        ),
    ]
    control: Annotated[
        "AnyControl | None",
        Option(
            """an ``EnergyControl`` or a ``Projection``, to keep the energy constant, or another control or projection; with a
            tolerance, too, where a projection acts on accepted steps. Verlet and leapfrog go without.""",
            check=lambda control, asked: a_control(control),
            batch=lambda control, system: control.batch,
        ),
    ]
    force: Annotated[
        Any,
        Option(
            """what is added to v̇ in every stage, constant over the run, in the units of v per unit of time: for bodies a force
            per mass, that is an acceleration. Shape (*block, *batch) of v, or one number for all. With fixed and adaptive steps;
            in a ``World`` it may change.""",
            check=lambda force, asked: _block("force", force, asked),
            batch=lambda force, system: force.shape[len(system.v_shape) :],
            ways={
                "World": """what is added to v̇ in every stage: wind, or the push of a player. A C-contiguous array of the
                dtype and shape of v, yours to write to: each call of ``step`` reads it once and takes it as constant over its
                steps. In the units of v per unit of time: for bodies a force per mass, that is an acceleration.""",
            },
        ),
    ]
    record: Annotated[
        str | Sequence[str] | None,
        Option(
            """quantities to record of every saved state, ``run.recorded``: "energy", those that the system names in its
            ``quantities``, and what a sampled controller sets, as it was held up to there; nothing if None. Bodies compute their
            energy together with the force of the next step, at little cost.""",
            check=lambda record, asked: single.quantities(asked.system, record),
            default=(),
            ways={"World": _OF_A_RUN, "sweep": No("the results of a sweep are its outcomes=, such as a function of the run")},
        ),
    ]
    events: Annotated[
        Any,
        Option(
            """quantities of a state whose changes of sign are located to the accuracy of the method, ``run.events``: a function
            g(t, v, y), an ``Event``, which may also stop a member, or a list of them. Goes with fixed and adaptive steps in the
            direct form (docs/howto/events.md).""",
            check=lambda events, asked: single.event_list(events, asked["form"]),
            ways={
                "World": """quantities whose changes of sign are located, as of ``integrate``; those of the last call of ``step``
                are in ``world.events``. No event stops a member of a world; one with ``then=`` changes its state within the
                step.""",
                "sweep": """events to locate in each member, as for ``integrate``; an event may stop a member, or change its
                state. The results of an event ``ground`` are ``ground_count``, the number of its occurrences, and ``ground_t``,
                the time of the first, NaN without one; ``stopped_at`` is the time at which an event stopped a member. All states
                that reductions see are then in memory at once. Not with ``transient`` or "lyapunov".""",
            },
        ),
    ]
    form: Annotated[
        "StepForm | None",
        Option(
            """``"direct"``, or ``"matrix"`` for the transition matrix of a linear system (Appendix B).""",
            check=lambda form, asked: single.known_form(form),
            default="direct",
            ways={
                "adaptive": _FIXED_ONLY,
                "World": No("a world makes steps in the direct form"),
                "sweep": No("a sweep makes steps in the direct form"),
            },
        ),
    ]
    fused: Annotated[
        bool | None,
        Option(
            """compute each step with fused multiply-adds, a·b + c rounded once. The bits differ from those without, and are the
            same on every machine and with either backend. For steps of up to some 100 000 operations, and for any number of
            bodies, whose Newtonian force is then made without root and quotient (docs/theory/numerics.md).""",
            check=lambda fused, asked: checks.flag("fused", fused),
            default=False,
            plan="fused",
        ),
    ]
    dtype: Annotated[
        Any,
        Option(
            """``"float64"`` or ``"float32"``, half the width and twice the members in a vector: start, parameters and dt are
            rounded to it once, and so is the result of every operation of a step; v and y are returned in it. The bits are the
            same on every machine and with either backend. With a tolerance, of 2⁻²³ = 1.2e-7 or more, time and controller are
            float64. For steps of up to some 100 000 operations, in the direct and the matrix form; not for ``taylor``.""",
            check=lambda dtype, asked: checks.is_single(dtype),
            default=False,
            plan="single",
        ),
    ]
    t0: Annotated[
        Any,
        Option(
            """time of step 0, a number, or an array over the batch for a time of each member; ``run.t`` then has shape
            (saved, *batch). Step k is at t0 + k·dt, computed by this formula and never accumulated. With a tolerance, the time of
            the start, likewise.""",
            check=_t0,
            default=0.0,
            batch=lambda t0, system: np.shape(t0),
        ),
    ]
    start: Annotated[
        str | None,
        Option(
            """how to start a method that has several ways; see ``method(…).starts``.""",
            check=lambda start, asked: asked.method.start_choice(start),
            default=0,
            plan="choice",
            ways={"adaptive": _FIXED_ONLY},
        ),
    ]
    max_steps: Annotated[
        int | None,
        Option(
            """with a tolerance, the most steps of a member, including rejected ones; a million if None.""",
            check=lambda most, asked: checks.count("max_steps", most, 1),
            default=MOST_STEPS,
            given_again=True,
            ways={
                "fixed": No("works with tolerance= and at= only; steps= is the number of steps of fixed length"),
                "World": _NO_ADAPTIVE_WORLD,
            },
        ),
    ]
    max_step: Annotated[
        Any,
        Option(
            """with a tolerance, the longest step, in units of time, a number or an array over the batch. What lasts for less
            than a step may be stepped over without a sign: give this, or ``jumps``, where rates change suddenly in time.""",
            check=lambda longest, asked: checks.numbers("max_step", longest, positive=True, unit="units of time"),
            batch=lambda longest, system: longest.shape,
            goes_on=True,
            ways={"fixed": _ADAPTIVE_ONLY, "World": _NO_ADAPTIVE_WORLD},
        ),
    ]
    jumps: Annotated[
        Any,
        Option(
            """with a tolerance, times at which rates jump, shape (jumps,), or (jumps, *batch) for jumps of each member. No step
            crosses one; behind it the step is chosen anew. Jumps of sampled inputs, and of comparisons of your own equations
            with the time, are found without.""",
            check=lambda jumps, asked: np.atleast_1d(checks.numbers("jumps", jumps, unit="units of time")),
            batch=lambda jumps, system: jumps.shape[1:],
            goes_on=True,
            ways={"fixed": _ADAPTIVE_ONLY, "World": _NO_ADAPTIVE_WORLD},
        ),
    ]
    positive: Annotated[
        Any,
        Option(
            """with a tolerance, the components that must not become negative: True for all of y, or an index of y, a tuple
            such as ("v", 0), or a list of these. A step that makes one negative is rejected; a member stops where no step is
            small enough.""",
            goes_on=True,
            ways={"fixed": _ADAPTIVE_ONLY, "World": _NO_ADAPTIVE_WORLD},
        ),
    ]
    sensitivity: Annotated[
        str | Sequence[str] | None,
        Option(
            """what to differentiate the states by: names of parameters, and "v" and "y" for those at the start, one or a list;
            ``run.sensitivity["beta"]`` is then ∂y/∂β, shape (saved, *block, *own, *batch) with the axes of the parameter itself,
            and ``run.sensitivity_of_v["beta"]`` is ∂v/∂β. They are exact derivatives of the computed steps; accepted steps are
            held, which are those without. Each number costs about as much as the run (docs/howto/derivatives.md).""",
            check=lambda sensitivity, asked: single.names_of_sensitivities(asked.system, sensitivity),
            ways={
                "World": _OF_A_RUN,
                "sweep": No("the outcomes of a sweep are those of states; integrate differentiates them"),
            },
        ),
    ]
    progress: Annotated[
        bool,
        Option(
            """show a progress bar, in a terminal or in a notebook.""",
            check=lambda progress, asked: checks.flag("progress", progress),
            default=False,
            ways={"World": _OF_A_RUN},
        ),
    ]
    threads: Annotated[
        int | None,
        Option(
            """how many threads share the members, or the pairs of many bodies; None for as many as are worthwhile.""",
            check=lambda threads, asked: checks.count("threads", threads, 1, 4096),
            default=0,
            plan="threads",
            given_again=True,
            ways={
                "World": No("a world is stepped by the thread that calls it"),
                "sweep": """the number of threads without an engine; None for as many as there are cores, one with a device.""",
            },
        ),
    ]
    backend: Annotated[
        "Backend | None",
        Option(
            """``"rust"``, or ``"numpy"`` for the reference.""",
            check=lambda backend, asked: checks.known("backend", backend, single.BACKENDS),
            default="rust",
            plan="backend",
            given_again=True,
            ways={
                "World": No("the reference steps runs, not worlds"),
                "sweep": No("the reference steps runs, not sweeps"),
            },
        ),
    ]
    device: Annotated[
        str | None,
        Option(
            """"cpu", or "opencl" for the first device of OpenCL and "opencl:1" for the second, as ``stepwell.devices()`` lists
            them. None is the CPU, or what the environment variable ``STEPWELL_DEVICE`` names. The bits are those of the CPU.
            Fixed and adaptive steps of up to some 100 000 operations; events of adaptive steps are looked for by the CPU, and the
            run is then made by the device. Needs ``pip install "stepwell[gpu]"`` (docs/howto/gpu.md).""",
            check=lambda device, asked: single.machine_of(device, asked["backend"]),
            plan="device",
            given_again=True,
            is_always_checked=True,
            ways={
                "World": """what makes the steps, as for ``integrate``: "cpu", "opencl", "opencl:1"; None is the CPU, or what
                ``STEPWELL_DEVICE`` names. The bits are the same. Your arrays stay in the memory of the host: each call of
                ``step`` takes the state to the device and back, about a millisecond and more for many members. So this pays for a
                hundred thousand members, or for many steps a call. Parameters go there again where they have changed.""",
                "sweep": """what steps the members, as for ``integrate``: "cpu", "opencl", "opencl:1"; None is the CPU, or what
                ``STEPWELL_DEVICE`` names. The bits are the same. A GPU needs a hundred thousand members or more to be busy.
                Exponents of "lyapunov" are computed by the CPU.""",
            },
        ),
    ]
    start_step: Annotated[
        int | None,
        Option(
            """number of the first step, 0 if None: it begins at t0 + start_step·dt.""",
            check=lambda first, asked: checks.count("start_step", first, 0, checks.LAST_STEP - (asked["steps"] or 0)),
            default=0,
            plan="first",
            ways={
                "adaptive": _FIXED_ONLY,
                "sweep": No("a sweep begins at t0="),
            },
        ),
    ]
    resume: Annotated[
        "Run | Standing | None",
        Option(
            """a run or a ``World`` that this one continues, as if it had never stopped, to the bit. Its state, time and step are
            known, and so are its control, force, ``start``, ``fused``, ``dtype``, and with a tolerance that and ``max_step``,
            ``jumps``, ``positive``; the same may be given again. With another system or control, or ``v`` or ``y`` of your own,
            the run begins anew there from this state; with a tolerance at the last time that was asked for. Another ``dt``, or
            another method where more than the state is carried, is refused. Events are given again; if one changed the state,
            ``events`` is needed, and ``[]`` goes on without. Members that diverged stay as they are, without another warning.""",
            ways={
                "World": """a world or a run with fixed steps that this one continues, to the bit: all of the above but
                ``events`` is then known, and may be given again, as for ``integrate``. Its arrays are copies; with ``v`` and
                ``y`` of your own it begins from these, in place.""",
                "sweep": No("a sweep begins at the start of its members"),
            },
        ),
    ]
