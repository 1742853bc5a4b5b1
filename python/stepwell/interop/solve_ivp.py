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
from ..reference import adaptive
from ..runs.findings import is_heard
from .ivp_events import Event, note_zeros
from .ivp_function import RightHandSide, arguments, takes
from .ivp_methods import chosen
from .ivp_steps import FAILURES, Solution, Trajectory

#: The smallest relative tolerance; smaller ones are raised to it, since rounding errors of a step are not much smaller.
LEAST_RELATIVE = 100.0 * np.finfo(float).eps

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

    ``fun`` is run with symbols at the start, not at every step. An operation that cannot be traced (``if`` on a state,
    ``np.random``) is an error that names the line. Results have the same bits on every machine.

    Differences from SciPy: there is no RK45, and the default method is ``"dop853"``. A step is judged by the component with the
    largest error relative to its tolerance, not by the root mean square over all. ``sol`` and events use short steps of the
    method in place of interpolation. The state is real. For many trajectories, use ``stepwell.system`` and ``integrate``.

    Args:
        fun: ``fun(t, y, *args)``, which returns ẏ: a function, a method or another callable that is written in Python.
        t_span: the times (t0, tf) of start and end; tf may be earlier than t0.
        y0: the state at t0, shape (n,).
        method: the name of a method with an ``error_order``: "dop853", "fehlberg", "fehlberg_5", "merson", and for stiff
            equations "rosenbrock23", "rodas4", "rodas5p", by any of their names; None for "dop853". For "Radau" it is "rodas5p",
            and for "BDF" and "LSODA" "rodas4", with a warning.
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
        ArgumentError: if an argument is wrong.
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
    solver = chosen(method)
    begin, end = _span(t_span)
    state = _start(y0)
    sign = -1.0 if end < begin else 1.0
    times = None if t_eval is None else _times(t_eval, begin, end, sign)
    dense_output = checks.flag("dense_output", dense_output)
    args = arguments(args)
    noted = None if events is None else [Event(each, args) for each in (events if _is_several(events) else [events])]
    _warn_of_useless(jac=jac, jac_sparsity=jac_sparsity, lband=lband, uband=uband, min_step=min_step or None)
    if not callable(fun):
        raise DTypeError(f"fun: expected a function fun(t, y), got {checks.short(fun)} ({type(fun).__name__})")
    if isinstance(fun, Definition):
        if fun.has_v:
            raise DTypeError(f"fun: expected a function fun(t, y), got the system {fun.name} of second order; use integrate")
        fun = fun.function
    if not isinstance(fun, type):
        takes("fun", fun, args)
    right = RightHandSide(fun, args, len(state), vectorized=checks.flag("vectorized", vectorized), backward=sign < 0.0)
    trajectory = Trajectory(right.system(), solver, (sign * begin, sign * end), state, _tolerances(rtol, atol, len(state)))
    trajectory.limited(
        None if first_step is None else _first(first_step, abs(end - begin)),
        _longest(max_step),
    )
    if times is not None and noted is None and not dense_output and end != begin:
        wanted = sign * times
        output = wanted if len(wanted) and wanted[-1] == trajectory.end else np.append(wanted, trajectory.end)
        states = trajectory.advance_to_the_end(output)[: len(times)].T
        _warn_of_stiffness(trajectory, sign)
        return _result(trajectory, None, times[: states.shape[1]], np.ascontiguousarray(states), None, None)

    ended = _advanced(trajectory, noted, sign) if end != begin else None
    _warn_of_stiffness(trajectory, sign)
    ts = sign * np.array(trajectory.times)
    if end == begin:
        ts, trajectory.status = np.array([begin]), adaptive.OK
    if times is None:
        saved, states = ts, np.array(trajectory.states).T.copy()
    else:
        saved = times[sign * times <= trajectory.times[-1]]
        states = trajectory.at(sign * saved)
    sol = Solution(trajectory, ts, sign) if dense_output else None
    return _result(trajectory, ended, saved, states, sol, noted)


def _advanced(trajectory: Trajectory, events: list[Event] | None, sign: float) -> float | None:
    """Make all steps and record the zeros of events; returns the time at which an event ended the run, or None."""
    events = events or []
    before = [float("nan") for _ in events]
    values = [event.value(sign * trajectory.times[0], trajectory.states[0]) for event in events]
    while trajectory.advance():
        if not events:
            continue
        span = sign * trajectory.times[-2], sign * trajectory.times[-1]
        after = [event.value(span[1], trajectory.states[-1]) for event in events]
        ended = note_zeros(events, [before, values, after], lambda t: trajectory.state(sign * t), span)
        before, values = values, after
        if ended is not None:
            last = trajectory.state(sign * ended)
            trajectory.times[-1], trajectory.states[-1] = sign * ended, last
            return ended
    return None


def _result(
    trajectory: Trajectory, ended: float | None, t: Array, y: Array, sol: Solution | None, events: list[Event] | None
) -> OdeResult:
    """The result, with SciPy's names."""
    status = 1 if ended is not None else 0 if trajectory.status == adaptive.OK else -1
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
    if checks.as_array("y0", y0).dtype.kind == "c":
        raise DTypeError(
            "y0: expected real numbers, got complex ones; write the equations of real and imaginary parts: y = [Re, Im]"
        )
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


def _first(first_step: Any, whole: float) -> float:
    first = checks.number("first_step", first_step, positive=True, unit="units of time")
    if first > whole:
        raise ArgumentError(f"first_step: expected at most the whole time, {whole:g}, got {first:g}")
    return first


def _longest(max_step: Any) -> float:
    if isinstance(max_step, float) and max_step == np.inf:
        return np.inf
    return checks.number("max_step", max_step, positive=True, unit="units of time")


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


def _is_several(events: Any) -> bool:
    return not callable(events) and bool(checks.several("events", events, "functions") or True)


def _warn_of_stiffness(trajectory: Trajectory, sign: float) -> None:
    """Warn if stability held down the steps, and not the tolerance."""
    if is_heard(StiffnessWarning) and (text := trajectory.stiffness(sign)):
        warnings.warn(text, StiffnessWarning, stacklevel=3)


def _warn_of_useless(**arguments: Any) -> None:
    """Warn of arguments that only methods for stiff equations read."""
    if useless := [name for name, value in arguments.items() if value is not None]:
        warnings.warn(
            f"{', '.join(useless)}: of no use, for derivatives come from the operations of fun, and steps have no least length",
            UserWarning,
            stacklevel=3,
        )
