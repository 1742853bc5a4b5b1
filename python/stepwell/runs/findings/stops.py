"""Why members of a run with a tolerance stopped before its end, in words with numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import Any

import numpy as np

from ...base import checks, registry
from ...base.arrays import Array, Shape
from ...base.reprs import counted
from ...errors import ToleranceWarning, UnsupportedError
from ...model.methods import Method
from ...model.systems import System
from ...reference.adaptive import OUTSIDE
from ...reference.around import wrapped
from .. import engine
from ..finding import Finding, named
from ..options.positive import name_of, places_of
from ..request import Request
from ..result import Run, Status
from . import Case, State, time_of

#: Why a member stopped, in words.
WHY_STOPPED = {
    Status.BUDGET: "out of max_steps",
    Status.UNDERFLOW: "the step that the tolerance asks for is too small to move the time",
    Status.NOT_FINITE: "no step, however small, gives finite numbers",
}
#: Why steps shrink without end although rates are finite and the time has enough digits.
BLOWS_UP = (
    "the solution blows up there (a collision, a pole), or does so by the errors that the tolerance allows: try a smaller one, "
    "or a pair (relative, absolute)"
)
#: Rates are also evaluated this many roundings of the time beyond where a member stopped.
BEYOND = 8.0
#: The time has too few digits if a member stops at its start, or if this share of its mean step is within roundings.
USUAL = 2.0**-10
#: The most derivatives of rates that are looked at.
MOST_DERIVATIVES = 1_000_000
#: Stability is tested in a run that used up so many attempts.
STOPPED = 256


def of_run(case: Case) -> Finding | None:
    """The members that stopped by themselves: how many, which was first, when and why."""
    run = case.run
    assert run.paces is not None
    if not (stopped := (run.status != 0) & (run.status < Status.EVENT)).any():
        return None
    elapsed = np.where(stopped, np.abs(run.paces.t - run.t0), np.inf)
    who = named(stopped, tuple(np.argwhere(elapsed == elapsed.min())[0].tolist()))
    time, end = float(run.paces.t[who.place]), float(np.broadcast_to(run.t[-1], stopped.shape)[who.place])
    why = why_stopped(run, who.place, partial(why_steps_are_short, run, case.request, case.waypoints))
    return Finding(ToleranceWarning, f"{who.share} stopped before t = {end:g}{who.first or ','} at t = {time:g}; {why}", stopped)


def why_steps_are_short(run: Run, request: Request, waypoints: Sequence[Array], index: Shape) -> str:
    """Why the steps of a member that stopped are short, in words: a jump of the rates, or stability if it is out of attempts."""
    from . import state_jumps, stiffness  # only such members need them

    assert run.paces is not None
    if jump := state_jumps.why_short(run, request, waypoints, index):
        return jump
    if run.status[index] != Status.BUDGET or run.paces.accepted[index] + run.paces.rejected[index] < STOPPED:
        return ""
    return stiffness.held_by_stability(run, request, waypoints, index)


def why_stopped(run: Run, index: Shape, why_short: Callable[[Shape], str]) -> str:
    """Why a member stopped, with numbers."""
    paces, end = run.paces, run.controller_state
    assert paces is not None
    assert end is not None
    status, t, accepted = Status(int(run.status[index])), float(paces.t[index]), int(paces.accepted[index])
    elapsed, spacing, why = abs(t - time_of(run, 0, index)), float(np.spacing(abs(t))), WHY_STOPPED[status]
    if status == Status.BUDGET:
        rejected = int(paces.rejected[index])
        mean = f", steps of {elapsed / accepted:.2g} on average" if accepted else ""
        tried = f"{counted(accepted + rejected, 'attempt')}, {rejected} of them rejected{mean}"
        return f"{why}: {tried}{why_short(index)}; max_steps= allows more"
    state, batch, where = (end.v, end.y), run.status.shape, "there" if elapsed else "at the start"
    rates = rates_of(run.system, batch, paces.t, state, run.force)
    if status == Status.UNDERFLOW:
        ahead = BEYOND * np.where(paces.h < 0.0, -1.0, 1.0) * np.spacing(np.abs(paces.t))
        further = state[0] + ahead * rates[0], state[1] + ahead * rates[1]
        if wrong := not_finite(run.system, rates_of(run.system, batch, paces.t + ahead, further), index):
            return f"{WHY_STOPPED[Status.NOT_FINITE]}: {wrong} beyond"
    if wrong := not_finite(run.system, rates, index):
        return f"{why}: {wrong} {where}"
    if status == Status.NOT_FINITE:
        if wrong := of_derivatives(run.system, run.method, batch, paces.t, state, index):
            return f"{why}: {wrong} {where}"
        return f"{why}: the state reached {float(np.abs(_numbers(state, index)).max(initial=0.0)):.3g}"
    if end.pace[engine.ERROR][index] == OUTSIDE:
        left = _left_for_below_zero(run.system, places_of(run.system, run.options["positive"]), state, rates, index)
        return f"{left} becomes negative in every step, however short, which positive= does not allow"
    if spacing > USUAL * elapsed / accepted if accepted else t != 0.0:
        return f"{why}, whose roundings there are {spacing:.2g}: count times from a nearer origin, or give a larger tolerance"
    if jump := why_short(index):
        return f"{why}{jump}"
    rate = _numbers(rates, index)
    place = int(np.abs(rate).argmax())
    return f"{why}: {BLOWS_UP}; the largest rate there is that of {name_of(run.system, place)}, {float(rate[place]):.3g}"


def _left_for_below_zero(system: System, positive: list[int], state: State, rates: State, index: Shape) -> str:
    """Of the components of ``positive=``, which every step makes negative, the one that would reach zero first."""
    numbers, rate = _numbers(state, index), _numbers(rates, index)
    with np.errstate(all="ignore"):
        left = np.where(rate[positive] < 0.0, numbers[positive] / -rate[positive], np.inf)
    return name_of(system, positive[int(left.argmin())])


def of_derivatives(system: System, method: Method, batch: Shape, t: Any, state: State, index: Shape) -> str:
    """Which derivative of a rate of a member is not finite, if the method needs derivatives; "" if all are finite."""
    shapes = system.v_shape, system.y_shape
    n = sum(map(prod, shapes))
    if not method.has_derivatives or n * n * prod(batch) > MOST_DERIVATIVES:
        return ""
    try:
        with np.errstate(all="ignore"):
            derivatives = registry.task("derivatives_of_rates")(system, batch, t, *state)
    except UnsupportedError:  # there are no rates without a step, or no derivatives
        return ""
    of_member = checks.member(derivatives, index)
    if np.isfinite(of_member).all():
        return ""
    rate, number = np.argwhere(~np.isfinite(of_member))[0].tolist()
    value = "NaN" if np.isnan(of_member[rate, number]) else "infinite"
    of, by = name_of(system, rate), name_of(system, number)
    return f"{method.name} needs the derivative of the rate of {of} by {by}, which is {value}"


def _numbers(state: State, index: Shape) -> Array:
    return np.concatenate([checks.member(block, index).reshape(-1) for block in state])


def not_finite(system: System, rates: State, index: Shape) -> str:
    """Which rate of a member is not finite, as "the rate of y[1] is NaN"; empty if all are finite."""
    rate = _numbers(rates, index)
    if (finite := np.isfinite(rate)).all():
        return ""
    place = int(finite.argmin())
    return f"the rate of {name_of(system, place)} is {'NaN' if np.isnan(rate[place]) else 'infinite'}"


def rates_of(system: System, batch: Shape, t: Any, state: State, force: Array | None = None) -> State:
    """v̇ and ẏ of states of all members, each at its own time; without control."""
    v, y = state
    with np.errstate(all="ignore"):
        acting = [part for part in system.parts(batch, force) if part[0].acts_on_rates and part[0].kind != "control"]
        s = wrapped(system.reference_at_step(1.0, batch), 1.0, acting)
        dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    return np.broadcast_to(dv, v.shape), np.broadcast_to(dy, y.shape)
