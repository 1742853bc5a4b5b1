"""``stepwell.solve_ivp``: the arguments and the result of SciPy's function of that name."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import ArgumentError, DTypeError, ShapeError, StiffnessWarning, ToleranceWarning
from ..model.equations.definition import Definition
from ..model.methods import Method
from ..reference import adaptive
from ..runs.findings import is_heard
from ..runs.options import Options
from ..runs.request import Request
from .ivp_events import Event, note_zeros
from .ivp_function import arguments, known, remember
from .ivp_methods import chosen
from .ivp_steps import BEFORE_A_CHECK, FIRST_ATTEMPTS, MAX_ATTEMPTS, Solution, Trajectory

#: The smallest relative tolerance; smaller ones are raised to it, since rounding errors of a step are not much smaller.
LEAST_RELATIVE = 100.0 * np.finfo(float).eps

#: Why a run ended early, by the status of the core.
FAILURES = {
    adaptive.UNDERFLOW: "Required step size is less than spacing between numbers.",
    adaptive.NOT_FINITE: "No step, however short, gives a finite state.",
}

#: SciPy's messages for a run that reached its end, or an event that ends it.
ENDS = {0: "The solver successfully reached the end of the integration interval.", 1: "A termination event occurred."}


class OdeResult(dict[str, Any]):
    """The result of ``solve_ivp``: a dictionary whose entries are attributes as well, with SciPy's names.

    Attributes:
        t: times, shape (times,).
        y: states, shape (n, times).
        sol: the states at any time, if ``dense_output``; a ``Solution``, or None.
        t_events: for each event function the times at which it was zero, or None.
        y_events: the states at these times, or None.
        nfev: number of function evaluations.
        njev: the number of Jacobians: one for each attempt at a step that solves equations, and else 0.
        nlu: the number of factored matrices, likewise.
        status: 0 if the end was reached, 1 if an event ended the run, −1 if a step failed.
        message: the status in words.
        success: whether ``status`` is 0 or 1.
    """

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None

    __setattr__ = dict.__setitem__
    __delattr__ = dict.__delitem__

    def __dir__(self) -> list[str]:
        return list(self)

    def __repr__(self) -> str:
        order = ["message", "success", "status", *sorted(set(self) - {"message", "success", "status"})]
        with np.printoptions(threshold=10, edgeitems=2, precision=3):
            return "\n".join(f"{name:>9}: {_indented(str(self[name]))}" for name in order)


def _indented(text: str) -> str:
    """Text of several lines, those after the first below it."""
    return text.replace("\n", f"\n{'':11}")


def solve_ivp(
    fun: Callable[..., Any],
    t_span: Any,
    y0: Any,
    method: Any = None,
    t_eval: Any = None,
    dense_output: bool = False,
    events: Any = None,
    vectorized: bool = False,
    args: Any = None,
    *,
    first_step: float | None = None,
    max_step: float = np.inf,
    rtol: Any = 1e-3,
    atol: Any = 1e-6,
    jac: Any = None,
    jac_sparsity: Any = None,
    lband: Any = None,
    uband: Any = None,
    min_step: float = 0.0,
) -> OdeResult:
    """Solve ẏ = fun(t, y) from a state, with the arguments of SciPy's ``solve_ivp``, so that changing an import tries stepwell.

    ``fun`` is run with symbols at the start, not at every step, and not again by later calls if all that it reads is the same. An
    operation that cannot be traced (``if`` on a state, ``np.random``) is an error that names the line. Results have the same bits
    on every machine.

    Differences from SciPy: the default method is ``"dop853"``. A step is judged by the component with the
    largest error relative to its tolerance, not by the root mean square over all. ``sol`` and events use short steps of the
    method in place of interpolation. The state is real. For many trajectories, use ``stepwell.system`` and ``integrate``.

    Args:
        fun: ``fun(t, y, *args)``, which returns ẏ: a function, a method or another callable that is written in Python.
        t_span: the times (t0, tf) of start and end; tf may be earlier than t0.
        y0: the state at t0, shape (n,).
        method: the name of a method with an ``error_order``: "dop853", "dopri5" ("RK45"), "bs32" ("RK23") and others, and for
            stiff equations "rosenbrock23", "rodas4", "rodas5p", by any of their names; None for "dop853". With a warning, "Radau"
            and "BDF" are the one for the tolerance, and "LSODA" is "dop853", or that one if it comes as far in half of the
            attempts.
        t_eval: the times at which to return the state, in the direction of the run; None for the ends of the steps. Steps do not
            depend on them.
        dense_output: whether to return ``sol``, which gives the state at any time.
        events: a function ``event(t, y, *args)`` or a list of them. It is called with numbers, at the end of each step; if its
            sign differs from that at the start, the zero in between is found, to 4 roundings of the time. Attributes as in SciPy:
            ``event.terminal = True`` ends the run at the first zero, a number n at the n-th; ``event.direction`` above zero
            counts zeros where the function grows, below zero where it falls. Two zeros within one step are found where values and
            slopes at its ends indicate them; for a function that is wilder than a cubic within a step, ``max_step`` helps.
        vectorized: whether ``fun`` expects the state as a column, shape (n, 1).
        args: a tuple of further arguments of ``fun`` and of the events.
        first_step: the step to try first; None for a hundredth of the time in which the state changes at the start.
        max_step: the longest step.
        rtol: tolerated error of a component in a step, relative to its size before and after the step; a number, or one for each
            component, shape (n,).
        atol: the absolute error of a component that is tolerated in addition, likewise.
        jac: ignored with a warning: methods for stiff equations take derivatives from the operations of ``fun``.
        jac_sparsity: likewise.
        lband: likewise.
        uband: likewise.
        min_step: likewise.

    Returns:
        An ``OdeResult`` with ``t``, ``y``, ``sol``, ``t_events``, ``y_events``, ``nfev``, ``njev``, ``nlu``, ``status``,
        ``message`` and ``success``.

    Raises:
        TraceError: if an operation of ``fun`` cannot be traced.
        UnknownNameError: if there is no such method; for a method of SciPy that stepwell lacks, it says what to write.

    Warns:
        StiffnessWarning: if stability held down the steps, and not the tolerance: with the limit, how much longer steps the
            tolerance allows, and the method to take.
        ToleranceWarning: if ``rtol`` is smaller than numbers of 53 bits allow.
        UserWarning: if another method stands in for one of SciPy, or an argument is of no use.

    Example:
        >>> def lotka_volterra(t, z, a, b, c, d):
        ...     x, y = z
        ...     return [a * x - b * x * y, -c * y + d * x * y]
        >>> result = sw.solve_ivp(lotka_volterra, (0, 15), [10, 5], args=(1.5, 1, 3, 1), dense_output=True, rtol=1e-9, atol=1e-9)
        >>> result.sol([5.0, 10.0]).round(6)
        array([[0.264187, 0.287213],
               [3.134133, 0.449777]])
        >>> result.success, result.message
        (True, 'The solver successfully reached the end of the integration interval.')
    """
    begin, end = _span(t_span)
    state = _start(y0)
    sign = -1.0 if end < begin else 1.0
    times = None if t_eval is None else _times(t_eval, begin, end, sign)
    dense_output = checks.flag("dense_output", dense_output)
    args = arguments(args)
    functions = [] if events is None else [events] if callable(events) else checks.several("events", events, "functions")
    _warn_of_useless(jac=jac, jac_sparsity=jac_sparsity, lband=lband, uband=uband, min_step=min_step or None)
    if isinstance(fun, Definition):
        if fun.has_v:
            raise DTypeError(f"fun: expected a function fun(t, y), got the system {fun.name} of second order; use integrate")
        fun = fun.function
    of_function = known(fun, args, len(state), checks.flag("vectorized", vectorized))
    relative, absolute = _tolerances(rtol, atol, len(state))
    is_bound = not (isinstance(max_step, float) and max_step == np.inf)
    longest = checks.number("max_step", max_step, positive=True, unit="units of time") if is_bound else None
    first = None if first_step is None else _first(first_step, abs(end - begin), longest)
    solver, stiff = chosen(method, float(relative.min()))
    at = np.array([sign * end])
    if times is not None and not functions:
        at = sign * (times if len(times) and times[-1] == end else np.append(times, end))

    asked: Any = begin, end, first, longest, relative.tobytes(), absolute.tobytes()
    numbers = tuple(of_function.numbers.values())
    start = (*asked, state.tobytes(), numbers)
    if of_function.system.switches_by_time:  # by times that the numbers set
        asked = (*asked, numbers)

    def requested(solver: Method) -> Request:
        """The run by a method, which is known but for its start if another call asked for it."""
        key = id(solver), *asked  # own methods may have the same name
        request = of_function.requests.get(key)
        if request is None:
            options = Options(
                y=state, tolerance=(relative, absolute), at=end, t0=begin, dt=None if first is None else sign * first,
                max_step=longest, threads=1, device="cpu",
            )  # fmt: skip
            request = Request.of(of_function.system, solver, options)
            remember(of_function.requests, key, request)
        return of_function.of_numbers(request)._replace(y=state)

    def made(solver: Method, instead: Method | None) -> tuple[Trajectory, list[Event], float | None]:
        """The trajectory by a method, or by another one if equations are stiff."""
        request, noted = requested(solver), [Event(each, args) for each in functions]
        if instead is not None and not noted:  # an event may end the run before that is noticed
            request = of_function.of_numbers(of_function.requests.get(start, request))
        attempts = FIRST_ATTEMPTS if functions else MAX_ATTEMPTS if instead is None else BEFORE_A_CHECK
        trajectory = Trajectory(request, at, keeps=times is None or dense_output or bool(functions), attempts=attempts)
        values = [len(noted) * [np.nan], [each.value(begin, state) for each in noted]]
        while end != begin and trajectory.advance():
            if instead is not None and trajectory.loses_to(lambda: requested(instead)):
                remember(of_function.requests, start, requested(instead))
                return made(instead, None)
            if noted and (ended := _ended(trajectory, noted, values, sign)) is not None:
                trajectory.end_at(sign * ended)
                return trajectory, noted, ended
        return trajectory, noted, None

    trajectory, noted, ended = made(solver, stiff)
    if stiff is None and is_heard(StiffnessWarning) and (text := trajectory.stiffness()):
        warnings.warn(text, StiffnessWarning, stacklevel=2)
    ts = sign * trajectory.times
    if times is None:
        saved, states = ts, trajectory.states.T.copy()
    elif functions or end == begin:
        saved = times[sign * times <= trajectory.times[-1]]
        states = trajectory.at(sign * saved)
    else:
        saved = times[: len(trajectory.saved)]
        states = np.ascontiguousarray(trajectory.saved[: len(times)].T)
    sol = Solution(trajectory, ts, sign) if dense_output else None
    return _result(trajectory, ended, saved, states, sol, None if events is None else noted)


def _ended(trajectory: Trajectory, events: list[Event], values: list[list[float]], sign: float) -> float | None:
    """Record the zeros of events in the steps that were added; return the time at which one of them ends the run, or None.

    ``values`` are those of the events at the times so far, the first before the start.
    """
    for k in range(len(values) - 1, len(trajectory.times)):
        span = sign * trajectory.times[k - 1], sign * trajectory.times[k]
        values.append([event.value(span[1], trajectory.states[k]) for event in events])
        ended = note_zeros(events, values[-3:], lambda t: trajectory.stepped(sign * t), span)
        if ended is not None:
            return ended
    return None


def _result(
    trajectory: Trajectory, ended: float | None, t: Array, y: Array, sol: Solution | None, events: list[Event] | None
) -> OdeResult:
    status = 1 if ended is not None else -1 if trajectory.status in FAILURES else 0
    n = len(trajectory.states[0])
    solver = trajectory.method
    jacobians = trajectory.evaluations // solver.attempt_evaluations if solver.is_implicit else 0  # one for each attempt
    return OdeResult(
        t=t,
        y=y,
        sol=sol,
        t_events=None if events is None else [np.array(each.times) for each in events],
        y_events=None
        if events is None
        else [np.array(each.states).reshape(-1, n) if each.states else np.empty((0, n)) for each in events],
        nfev=trajectory.evaluations,
        njev=jacobians,
        nlu=jacobians,
        status=status,
        message=ENDS[status] if status >= 0 else FAILURES[trajectory.status],
        success=status >= 0,
    )


def _span(t_span: Any) -> tuple[float, float]:
    times = checks.numbers("t_span", t_span, unit="units of time")
    if times.shape != (2,):
        raise ShapeError(f"t_span: expected the times (t0, tf), got shape {times.shape}")
    return float(times[0]), float(times[1])


def _start(y0: Any) -> Array:
    state = checks.numbers("y0", y0)
    if state.ndim != 1 or not state.size:
        raise ShapeError(f"y0: expected a state of shape (n,), got shape {state.shape}")
    return np.array(state)


def _times(t_eval: Any, begin: float, end: float, sign: float) -> Array:
    times = checks.numbers("t_eval", t_eval, unit="units of time")
    if times.ndim != 1:
        raise ShapeError(f"t_eval: expected times along one axis, got shape {times.shape}")
    if times.size and not (min(begin, end) <= times.min() and times.max() <= max(begin, end)):
        raise ArgumentError(f"t_eval: expected times within t_span, {begin:g} to {end:g}, got {times.min():g} to {times.max():g}")
    if (sign * np.diff(times) <= 0.0).any():
        raise ArgumentError(
            f"t_eval: expected times that go from {begin:g} to {end:g}, each different, got {checks.short(times)}"
        )
    return times


def _first(first_step: Any, whole: float, longest: float | None) -> float:
    first = checks.number("first_step", first_step, positive=True, unit="units of time")
    if first > whole:
        raise ArgumentError(f"first_step: expected at most the whole time, {whole:g}, got {first:g}")
    return first if longest is None else min(first, longest)


def _tolerances(rtol: Any, atol: Any, n: int) -> tuple[Array, Array]:
    """The relative and the absolute tolerance, each one number or one for each component."""
    relative = checks.numbers("rtol", rtol, positive=True)
    absolute = checks.not_negative("atol", atol)
    for name, tolerance in (("rtol", relative), ("atol", absolute)):
        if tolerance.shape not in ((), (n,)):
            raise ShapeError(f"{name}: expected a number, or one for each of the {n} of the state, got shape {tolerance.shape}")
    least = float(relative.min())
    if least < LEAST_RELATIVE:
        warnings.warn(
            f"rtol: {least:g} is too small for numbers of 53 bits, so it is {LEAST_RELATIVE:.3g}", ToleranceWarning, stacklevel=3
        )
    return np.maximum(relative, LEAST_RELATIVE), absolute


def _warn_of_useless(**arguments: Any) -> None:
    if useless := [name for name, value in arguments.items() if value is not None]:
        warnings.warn(
            f"{', '.join(useless)}: of no use, for derivatives come from the operations of fun, and steps have no least length",
            UserWarning,
            stacklevel=3,
        )
