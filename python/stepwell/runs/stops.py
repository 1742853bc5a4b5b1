"""Why members of a run with a tolerance stopped before its end, in words with numbers."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from ..base import checks, registry
from ..base.arrays import Array, Shape
from ..base.reprs import counted, first_of, share
from ..errors import ToleranceWarning, UnsupportedError
from ..model.methods import Method
from ..model.systems import System
from ..reference.around import wrapped
from . import engine
from .findings import Finding
from .options.positive import name_of, places_of
from .result import Run, Status

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

State = tuple[Array, Array]


def of_stops(run: Run, why_short: Callable[[Shape], str]) -> list[Finding]:
    """The members that stopped by themselves: how many, which was first, when and why; ``why_short`` says why steps are short."""
    assert run.paces is not None
    if not np.count_nonzero(run.status) or not (stopped := (run.status != 0) & (run.status < Status.EVENT)).any():
        return []
    elapsed = np.where(stopped, np.abs(run.paces.t - run.t0), np.inf)
    first = tuple(np.argwhere(elapsed == elapsed.min())[0].tolist())
    time, end = float(run.paces.t[first]), float(_of_member(run, run.t[-1], first))
    number = int(np.count_nonzero(stopped))
    text = (
        f"{share(number, stopped.shape, stopped.size)} stopped before t = {end:g}"
        f"{first_of(number, first, stopped.size) or ','} at t = {time:g}; {why_stopped(run, first, why_short)}"
    )
    return [Finding(ToleranceWarning, text, stopped)]


def why_stopped(run: Run, index: Shape, why_short: Callable[[Shape], str]) -> str:
    """Why a member stopped, with numbers."""
    assert run.paces is not None
    status = Status(int(run.status[index]))
    if status == Status.BUDGET:
        accepted, rejected = int(run.paces.accepted[index]), int(run.paces.rejected[index])
        mean = f", steps of {abs(float(run.paces.t[index]) - start_of(run, index)) / accepted:.2g} on average" if accepted else ""
        tried = f"{counted(accepted + rejected, 'attempt')}, {rejected} of them rejected{mean}"
        return f"{WHY_STOPPED[status]}: {tried}{why_short(index)}; max_steps= allows more"
    if status == Status.UNDERFLOW and (beyond := _of_rates_beyond(run, index)):
        return f"{WHY_STOPPED[Status.NOT_FINITE]}: {beyond} beyond"
    if wrong := _of_rates_there(run, index):
        return f"{WHY_STOPPED[status]}: {wrong}"
    if status == Status.NOT_FINITE:
        assert run.controller_state is not None
        state = run.controller_state.v, run.controller_state.y
        if wrong := of_derivatives(run.system, run.method, run.status.shape, run.paces.t, state, index):
            return f"{WHY_STOPPED[status]}: {wrong} {_where(run, index)}"
        longest = max(
            float(np.abs(checks.member(block, index)).max(initial=0.0))
            for block in (run.controller_state.v, run.controller_state.y)
        )
        return f"{WHY_STOPPED[status]}: the state reached {longest:.3g}"
    if left := _left_for_below_zero(run, index):
        return f"{left} becomes negative in every step, however short, which positive= does not allow"
    if spacing := _roundings_of_the_time(run, index):
        return (
            f"{WHY_STOPPED[status]}, whose roundings there are {spacing:.2g}: count times from a nearer origin, "
            f"or give a larger tolerance"
        )
    if jump := why_short(index):
        return f"{WHY_STOPPED[status]}{jump}"
    return f"{WHY_STOPPED[status]}: {BLOWS_UP}; {_largest_rate(run, index)}"


def _of_member(run: Run, times: Any, index: Shape) -> Any:
    """The time of a member, from times of each or one of all."""
    return np.broadcast_to(times, run.status.shape)[index]


def start_of(run: Run, index: Shape) -> float:
    """The time at which a member began."""
    return float(_of_member(run, run.t0, index))


def _of_rates_beyond(run: Run, index: Shape) -> str:
    """Which rate is not finite some roundings of the time after a member stopped; empty if all are finite."""
    assert run.paces is not None
    assert run.controller_state is not None
    t, (v, y) = run.paces.t, (run.controller_state.v, run.controller_state.y)
    ahead = BEYOND * np.where(run.paces.h < 0.0, -1.0, 1.0) * np.spacing(np.abs(t))
    dv, dy = rates_of(run.system, run.status.shape, t, (v, y), run.force)
    return _not_finite(rates_of(run.system, run.status.shape, t + ahead, (v + ahead * dv, y + ahead * dy)), index)


def _rates_there(run: Run) -> State:
    """v̇ and ẏ where members stopped."""
    assert run.paces is not None
    assert run.controller_state is not None
    state = run.controller_state.v, run.controller_state.y
    return rates_of(run.system, run.status.shape, run.paces.t, state, run.force)


def _of_rates_there(run: Run, index: Shape) -> str:
    """Which rate is not finite where a member stopped; empty if all are finite."""
    assert run.paces is not None
    wrong = _not_finite(_rates_there(run), index)
    return wrong and f"{wrong} {_where(run, index)}"


def _where(run: Run, index: Shape) -> str:
    """True if a member stopped at its start, in words."""
    assert run.paces is not None
    return "at the start" if float(run.paces.t[index]) == start_of(run, index) else "there"


def _largest_rate(run: Run, index: Shape) -> str:
    """Which rate is the largest where a member stopped."""
    each = ((checks.member(block, index), name) for block, name in zip(_rates_there(run), "vy", strict=True) if block.size)
    block, name = max(each, key=lambda each: float(np.abs(each[0]).max()))
    place = np.unravel_index(int(np.abs(block).argmax()), block.shape)
    return f"the largest rate there is that of {_component(name, tuple(map(int, place)))}, {float(block[place]):.3g}"


def _left_for_below_zero(run: Run, index: Shape) -> str:
    """Which component of ``positive=`` every step makes negative; empty if none does.

    If there are several, it is the one that would reach zero first.
    """
    from ..reference.adaptive import OUTSIDE

    assert run.controller_state is not None
    if run.controller_state.pace[engine.ERROR][index] != OUTSIDE:
        return ""
    blocks, rates = (run.controller_state.v, run.controller_state.y), _rates_there(run)
    state, rate = (np.concatenate([checks.member(block, index).reshape(-1) for block in each]) for each in (blocks, rates))
    places = np.array(places_of(run.system, run.options["positive"]))
    with np.errstate(all="ignore"):
        left = np.where(rate[places] < 0.0, state[places] / -rate[places], np.inf)
    return name_of(run.system, int(places[left.argmin()]))


def _roundings_of_the_time(run: Run, index: Shape) -> float:
    """The distance between floats at the time of the stop, if usual steps are no longer than that; else 0."""
    assert run.paces is not None
    t, accepted = float(run.paces.t[index]), int(run.paces.accepted[index])
    spacing, elapsed = float(np.spacing(abs(t))), abs(t - start_of(run, index))
    few = t != 0.0 if not accepted else spacing > USUAL * elapsed / accepted
    return spacing if few else 0.0


def of_the_start(system: System, batch: Shape, t: Any, state: State, index: Shape) -> str:
    """Which rate of a member is not finite at the start, as "the rate of y[1] is NaN"; empty if all are finite."""
    return _not_finite(rates_of(system, batch, t, state), index)


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
    names = [_component(block, place) for block, shape in zip("vy", shapes, strict=True) for place in np.ndindex(shape)]
    return f"{method.name} needs the derivative of the rate of {names[rate]} by {names[number]}, which is {value}"


def _not_finite(rates: State, index: Shape) -> str:
    for name, block in zip("vy", rates, strict=True):
        rate = checks.member(block, index)
        if not (finite := np.isfinite(rate)).all():
            place = tuple(np.argwhere(~finite)[0].tolist())
            return f"the rate of {_component(name, place)} is {'NaN' if np.isnan(rate[place]) else 'infinite'}"
    return ""


def _component(block: str, index: Shape) -> str:
    return f"{block}[{', '.join(map(str, index))}]" if index else block


def rates_of(system: System, batch: Shape, t: Any, state: State, force: Array | None = None) -> State:
    """v̇ and ẏ of states of all members, each at its own time; without control."""
    v, y = state
    with np.errstate(all="ignore"):
        acting = [part for part in system.parts(batch, force) if part[0].acts_on_rates and part[0].kind != "control"]
        s = wrapped(system.reference_at_step(1.0, batch), 1.0, acting)
        dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    return np.broadcast_to(dv, v.shape), np.broadcast_to(dy, y.shape)
