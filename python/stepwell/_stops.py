"""Why members of a run with a tolerance stopped before its end, in words with numbers."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from . import _checks, engine
from ._brief import counted, first_of, share
from ._checks import Array, Shape
from ._positive import name_of, places_of
from .errors import ToleranceWarning
from .result import Run, Status
from .systems import System

#: Why a member stopped, in words.
WHY_STOPPED = {
    Status.BUDGET: "out of max_steps",
    Status.UNDERFLOW: "the step that the tolerance asks for is too small to move the time",
    Status.NOT_FINITE: "no step, however small, gives finite numbers",
}
#: Why steps shrink without an end where rates are finite and the time has digits enough.
BLOWS_UP = (
    "the solution blows up there (a collision, a pole), or does so by the errors that the tolerance allows: try a smaller one, "
    "or a pair (relative, absolute)"
)

#: Whether stability holds the step down is looked at after so many attempts, of at most so many rates and numbers in all: that is
#: little work against the run.
ATTEMPTS, MOST_RATES, MOST_NUMBERS = 1000, 32, 100_000
#: A mode is stiff if it decays rather than turns, has had the time to decay by so many of its time constants, and the step is
#: at least this share of the longest at which the method is stable for it.
DECAYED, SHARE_OF_LIMIT = 100.0, 0.2
#: Roundings of the time by which rates are looked at beyond where a member stopped.
BEYOND = 8.0
#: The time has too few digits where a member stops at its start, or if a step of this share of the mean one is within roundings.
USUAL = 2.0**-10
#: The part of a number by which it is changed to find a derivative: half of its digits.
PART = 2.0**-26

State = tuple[Array, Array]


def warn_of_stops(run: Run) -> None:
    """Warn of the members that stopped by themselves: how many, which first, when, and what is known of its cause."""
    assert run.paces is not None
    stopped = run.status != 0
    elapsed = np.where(stopped, np.abs(run.paces.t - run.t0), np.inf)
    first = tuple(np.argwhere(elapsed == elapsed.min())[0].tolist())
    time, end = float(run.paces.t[first]), float(_of_member(run, run.t[-1], first))
    some = int(np.count_nonzero(stopped))
    warnings.warn(
        f"{share(some, stopped.shape, stopped.size)} stopped before t = {end:g}"
        f"{first_of(some, first, stopped.size) or ','} at t = {time:g}; {_why(run, first)}",
        ToleranceWarning,
        stacklevel=4,
    )


def _why(run: Run, index: Shape) -> str:
    """What stopped a member, and the numbers that show it."""
    assert run.paces is not None
    status = Status(int(run.status[index]))
    if status == Status.BUDGET:
        accepted, rejected = int(run.paces.accepted[index]), int(run.paces.rejected[index])
        mean = f", steps of {abs(float(run.paces.t[index]) - _start(run, index)) / accepted:.2g} on average" if accepted else ""
        held = _held_by_stability(run, index, accepted + rejected)
        tried = f"{counted(accepted + rejected, 'attempt')}, {rejected} of them rejected{mean}"
        return f"{WHY_STOPPED[status]}: {tried}{held}; max_steps= allows more"
    if status == Status.UNDERFLOW and (beyond := _of_rates_beyond(run, index)):
        return f"{WHY_STOPPED[Status.NOT_FINITE]}: {beyond} beyond"
    if wrong := _of_rates_there(run, index):
        return f"{WHY_STOPPED[status]}: {wrong}"
    if status == Status.NOT_FINITE:
        assert run.stand is not None
        longest = max(float(np.abs(_checks.member(block, index)).max(initial=0.0)) for block in (run.stand.v, run.stand.y))
        return f"{WHY_STOPPED[status]}: the state reached {longest:.3g}"
    if left := _left_for_below_zero(run, index):
        return f"{left} becomes negative in every step, however short, which positive= does not allow"
    if spacing := _roundings_of_the_time(run, index):
        return (
            f"{WHY_STOPPED[status]}, whose roundings there are {spacing:.2g}: count times from a nearer origin, "
            f"or give a larger tolerance"
        )
    return f"{WHY_STOPPED[status]}: {BLOWS_UP}; {_largest_rate(run, index)}"


def _of_member(run: Run, times: Any, index: Shape) -> Any:
    """A time of a member, which may be that of all."""
    return np.broadcast_to(times, run.status.shape)[index]


def _start(run: Run, index: Shape) -> float:
    """The time at which a member began."""
    return float(_of_member(run, run.t0, index))


def _of_rates_beyond(run: Run, index: Shape) -> str:
    """Which rate is not finite some roundings of the time behind where a member stopped; empty if all are."""
    assert run.paces is not None
    assert run.stand is not None
    t, (v, y) = run.paces.t, (run.stand.v, run.stand.y)
    ahead = BEYOND * np.where(run.paces.h < 0.0, -1.0, 1.0) * np.spacing(np.abs(t))
    dv, dy = _rates(run.system, run.status.shape, t, (v, y))
    return _not_finite(_rates(run.system, run.status.shape, t + ahead, (v + ahead * dv, y + ahead * dy)), index)


def _rates_there(run: Run) -> State:
    """v̇ and ẏ where members stopped."""
    assert run.paces is not None
    assert run.stand is not None
    return _rates(run.system, run.status.shape, run.paces.t, (run.stand.v, run.stand.y))


def _of_rates_there(run: Run, index: Shape) -> str:
    """Which rate is not finite where a member stopped; empty if all are."""
    assert run.paces is not None
    wrong = _not_finite(_rates_there(run), index)
    return wrong and f"{wrong} {'at the start' if float(run.paces.t[index]) == _start(run, index) else 'there'}"


def _largest_rate(run: Run, index: Shape) -> str:
    """Which rate is the largest where a member stopped."""
    each = ((_checks.member(block, index), name) for block, name in zip(_rates_there(run), "vy", strict=True) if block.size)
    block, name = max(each, key=lambda each: float(np.abs(each[0]).max()))
    place = np.unravel_index(int(np.abs(block).argmax()), block.shape)
    return f"the largest rate there is that of {_component(name, tuple(map(int, place)))}, {float(block[place]):.3g}"


def _left_for_below_zero(run: Run, index: Shape) -> str:
    """Which component that ``positive=`` keeps from there every step leads below zero; empty if none does.

    Several may be kept: it is the one that would be at zero first.
    """
    from .reference.adaptive import OUTSIDE

    assert run.stand is not None
    if run.stand.pace[engine.ERROR][index] != OUTSIDE:
        return ""
    blocks, rates = (run.stand.v, run.stand.y), _rates_there(run)
    state, rate = (np.concatenate([_checks.member(block, index).reshape(-1) for block in each]) for each in (blocks, rates))
    kept = np.array(places_of(run.system, run.stand.options["positive"]))
    with np.errstate(all="ignore"):
        left = np.where(rate[kept] < 0.0, state[kept] / -rate[kept], np.inf)
    return name_of(run.system, int(kept[left.argmin()]))


def _roundings_of_the_time(run: Run, index: Shape) -> float:
    """The distance between floats at the time at which a member stopped, if usual steps are no longer than that; else 0."""
    assert run.paces is not None
    t, accepted = float(run.paces.t[index]), int(run.paces.accepted[index])
    spacing, elapsed = float(np.spacing(abs(t))), abs(t - _start(run, index))
    few = t != 0.0 if not accepted else spacing > USUAL * elapsed / accepted
    return spacing if few else 0.0


def of_the_start(system: System, batch: Shape, t: Any, state: State, index: Shape) -> str:
    """Which rate of a member is not finite at the start, as "the rate of y[1] is NaN"; empty if all are finite."""
    return _not_finite(_rates(system, batch, t, state), index)


def _not_finite(rates: State, index: Shape) -> str:
    for name, block in zip("vy", rates, strict=True):
        rate = _checks.member(block, index)
        if not (finite := np.isfinite(rate)).all():
            place = tuple(np.argwhere(~finite)[0].tolist())
            return f"the rate of {_component(name, place)} is {'NaN' if np.isnan(rate[place]) else 'infinite'}"
    return ""


def _component(block: str, index: Shape) -> str:
    return f"{block}[{', '.join(map(str, index))}]" if index else block


def _rates(system: System, batch: Shape, t: Any, state: State) -> State:
    """v̇ and ẏ of states of all members, each at its own time."""
    v, y = state
    with np.errstate(all="ignore"):
        alone = system.alone(1.0, batch)
        dv, dy = alone.dv(t, v, y), alone.dy(t, v, y)
    return np.broadcast_to(dv, v.shape), np.broadcast_to(dy, y.shape)


def _held_by_stability(run: Run, index: Shape, attempts: int) -> str:
    """Whether the fastest rate where a member stopped lets no longer step be stable; empty if that is not so."""
    assert run.paces is not None
    assert run.stand is not None
    numbers = run.stand.v.size + run.stand.y.size
    n = numbers // run.status.size
    if attempts < ATTEMPTS or n > MOST_RATES or n * numbers > MOST_NUMBERS:
        return ""
    matrix = _derivative(run, index, n)
    if not np.isfinite(matrix).all():
        return ""
    values = np.linalg.eigvals(matrix)
    fastest: Any = values[np.abs(values).argmax()]
    rate, elapsed = abs(fastest), abs(float(run.paces.t[index]) - _start(run, index))
    if not (-fastest.real >= 0.5 * rate and rate * elapsed > DECAYED):
        return ""
    from .stability import stability_limit  # only runs of stiff equations need them
    from .systems import LinearSystem

    mode = [[fastest.real, -fastest.imag], [fastest.imag, fastest.real]] if fastest.imag else [[fastest.real]]
    limit = float(stability_limit(LinearSystem(mode), run.method))
    if not float(run.paces.h[index]) >= SHARE_OF_LIMIT * limit:
        return ""
    return (
        f", held down by stability and not by accuracy: the fastest rate there, 1/{1.0 / rate:.2g}, lets no steps beyond "
        f"{limit:.2g} be stable (stiff equations; SciPy's Radau and LSODA are for them)"
    )


def _derivative(run: Run, index: Shape, n: int) -> Array:
    """How the rates of a member change with its state, by differences."""
    assert run.stand is not None
    assert run.paces is not None
    paces, blocks = run.paces, (run.stand.v, run.stand.y)
    flat = [block.reshape(-1, *run.status.shape) for block in blocks]

    def at(state: Array) -> Array:
        parts = state[: len(flat[0])].reshape(blocks[0].shape), state[len(flat[0]) :].reshape(blocks[1].shape)
        rates = _rates(run.system, run.status.shape, paces.t, parts)
        return np.concatenate([_checks.member(rate, index).reshape(-1) for rate in rates])

    state = np.concatenate(flat)
    lengths = np.concatenate([np.full(block.shape, np.sqrt((block * block).sum(axis=0))) for block in flat])
    least = np.finfo(np.float64).tiny / PART  # the part of a smaller number would be lost
    scale = np.where(np.abs(state) >= least, np.abs(state), np.where(lengths >= least, lengths, 1.0))
    matrix, here = np.empty((n, n)), at(state)
    for i in range(n):
        moved = state.copy()
        moved[i] += PART * scale[i]
        matrix[:, i] = (at(moved) - here) / float(_checks.member(moved - state, index)[i])
    return matrix
