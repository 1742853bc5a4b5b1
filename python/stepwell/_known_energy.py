"""Runs whose known energy or invariant tells, at their end, that they did not follow the motion; of other systems than bodies."""

from __future__ import annotations

from math import pi, prod
from typing import Any, NamedTuple

import numpy as np

from ._brief import in_words, share
from ._checks import Array
from .result import Run
from .systems import Pendulum, RigidBody, System

State = tuple[Array, Array]
#: What steps own equations, by the name that the core knows.
KERNEL_OF_EQUATIONS = "equations"
Members = np.ndarray[Any, np.dtype[np.bool_]]

#: It is looked at where a run made so many function evaluations, and has at most so many numbers: that is little work against it.
FEW_EVALUATIONS, MOST_NUMBERS = 100, 100_000
#: An invariant is another at the end if it changed by more than this share of its own size, and by more than a share of what its
#: terms are made of, which is larger where they cancel: the length of its gradient times that of the state. Of a quadratic energy
#: that is twice the energy, so the one follows from the other; an angular momentum of 0 is only rounding beside it. A run to a
#: tolerance τ may change it by some τ of that in a step: ¼/τ steps that all err to one side are named here, and fewer are not.
CHANGED, CHANGED_OF_TERMS = 0.5, 0.25
#: The part of a number by which it is changed to find a derivative: a third of its digits, for a central difference.
PART = 2.0**-17
#: Changes of an invariant by v and by y cancel but for this share. Differences are right to the square of the part by which an
#: angle changes, 1e-5 where a state has some hundred turns a unit of time; damping and drives leave more than a thousandth.
CONSTANT = 1e-3
#: Numbers of a state for whom a gradient is found by differences.
MOST_IN_GRADIENT = 64
#: So many places between the ends of a motion are looked at for a barrier, and so many between two of them, again and again.
PLACES, FINER, TIMES = 1024, 33, 3
#: A barrier counts if it is higher than the energy by more than the roundings of both.
ROUNDING = 2.0**-40


def keeps_energy(run: Run) -> bool:
    """Whether nothing takes or gives energy in the true motion: no damping, drag, friction, floors, inputs or torques."""
    system: System = run.system.uncontrolled
    if run.force is not None or getattr(system, "torques_act", False) or system.contacts:
        return False
    if system.kernel == KERNEL_OF_EQUATIONS:
        return True  # its energy is what was declared to be constant
    terms = [getattr(system, name, None) for name in ("damping", "drag", "friction")]
    if any(term is not None and np.any(term) for term in terms):
        return False
    return isinstance(system, RigidBody) or not system.given_inputs()


def told(run: Run, start: State | None) -> str | None:
    """What is to be said, or None.

    With steps of fixed length a change of the energy is a property of the method, which grows or decays by nature; there it is
    said only where a method that keeps swings bounded passed a barrier.
    """
    system, paces = run.system, run.paces
    names = _names(system)
    if start is None or not names or system.keeper is not None or not keeps_energy(run):
        return None
    made = run.method.evaluations * run.steps if paces is None else int(paces.evaluations.min(initial=2**62))
    if made < FEW_EVALUATIONS or run.v[-1].size + run.y[-1].size > MOST_NUMBERS or not run.status.size:
        return None
    if paces is None and (run.method.limit == 0.0 or not (isinstance(system, Pendulum) or system.kernel == KERNEL_OF_EQUATIONS)):
        return None  # other systems have no barrier
    start = np.broadcast_to(start[0], run.v.shape[1:]), np.broadcast_to(start[1], run.y.shape[1:])
    with np.errstate(all="ignore"):
        for name in names:
            text = _of_one(run, name, start, made)
            # An invariant may have been declared to be recorded, as the energy of what is damped or driven.
            if text is not None and (system.kernel != KERNEL_OF_EQUATIONS or _is_constant(run, name)):
                return text
    return None


def _is_constant(run: Run, name: str) -> bool:
    """Whether an invariant is one: along the rates at the end, what its change by v and that by y add up to is nothing."""
    system, v, y = run.system, run.v[-1], run.y[-1]
    alone = system.alone(1.0, run.status.shape)
    t = np.broadcast_to(run.t[-1], run.status.shape)
    rates = np.broadcast_to(alone.dv(t, v, y), v.shape), np.broadcast_to(alone.dy(t, v, y), y.shape)
    axes = [tuple(range(len(shape))) for shape in (system.v_shape, system.y_shape)]
    sizes = [[np.abs(block).sum(axis=own) for block, own in zip(blocks, axes, strict=True)] for blocks in ((v, y), rates)]
    time = PART * sum(sizes[0]) / sum(sizes[1])
    changes = []
    for by_v, by_y in ((time, 0.0), (0.0, time)):
        ends = [(v + sign * by_v * rates[0], y + sign * by_y * rates[1]) for sign in (1.0, -1.0)]
        pairs = (np.stack([end[i] for end in ends], axis=len(axes[i])) for i in range(2))
        later, earlier = _values(system, name, tuple(pairs))  # type: ignore[arg-type]  # v and y
        changes.append(later - earlier)
    constant = np.abs(changes[0] + changes[1]) <= CONSTANT * (np.abs(changes[0]) + np.abs(changes[1]))
    return bool((constant | ~np.isfinite(changes[0] + changes[1])).all())


def _of_one(run: Run, name: str, start: State, made: int) -> str | None:
    """What is to be said of one invariant. States are evaluated together, since a call takes longer than a thousand numbers."""
    system = run.system
    # Of few members it takes some tenths of a millisecond; else a place takes as long as some hundred evaluations of the core.
    few = run.status.size * PLACES <= MOST_NUMBERS // 10
    places = PLACES if few else min(PLACES, MOST_NUMBERS // run.status.size, made // 100)
    is_line = system.kernel == KERNEL_OF_EQUATIONS and system.v_shape == () and system.y_shape == ()
    if not is_line or places < FINER:
        if not isinstance(system, Pendulum) and run.paces is None:
            return None
        first, last = _values(system, name, _ends(run, start))
        if isinstance(system, Pendulum) and (text := _of_a_barrier(run, name, first, _upright(run, start))) is not None:
            return text
    else:
        first, last, barrier = _searched(run, name, start, places)
        if (text := _of_a_barrier(run, name, first, barrier)) is not None:
            return text
    return None if run.paces is None else _of_a_change(run, name, start, (first, last))


def _names(system: System) -> list[str]:
    """The invariants that it is known to have."""
    if system.kernel == KERNEL_OF_EQUATIONS:
        return list(system.quantities)
    return ["energy"] if type(system).energy is not System.energy else []


def _ends(run: Run, start: State) -> State:
    """The states at the start and at the end, along an axis before those of the batch."""
    pairs = zip(start, (run.v[-1], run.y[-1]), (run.system.v_shape, run.system.y_shape), strict=True)
    v, y = (np.stack(pair, axis=len(shape)) for *pair, shape in pairs)
    return v, y


def _values(system: System, name: str, states: State) -> Array:
    """An invariant of several states of all members, shape (states, *batch)."""
    return np.broadcast_to(system.recordable(name, *states, 1.0), states[1].shape[len(system.y_shape) :])


def _of_a_change(run: Run, name: str, start: State, ends: tuple[Array, Array]) -> str | None:
    """An invariant that has another size at the end."""
    first, last = ends
    change = np.abs(last - first)
    wrong = (change > CHANGED * np.maximum(np.abs(first), np.abs(last))) & np.isfinite(last)
    wrong &= run.status == 0  # others were named before
    n = prod(run.system.v_shape) + prod(run.system.y_shape)
    if not wrong.any() or n > MOST_IN_GRADIENT:
        return None
    for state in (start, (run.v[-1], run.y[-1])):
        wrong &= ~(change <= CHANGED_OF_TERMS * _of_terms(run.system, name, state))
    if not wrong.any():
        return None
    index, some = tuple(np.argwhere(wrong)[0].tolist()), int(np.count_nonzero(wrong))
    return (
        f"{share(some, wrong.shape, wrong.size)} {'has' if some == 1 else 'have'} another {name} at the end: "
        f"{f'{in_words(index)} has ' if wrong.size > 1 else ''}{last[index]:.3g} instead of {first[index]:.3g}, "
        f"so {run.method.name} did not follow the motion"
    )


def _of_terms(system: System, name: str, state: State) -> Array:
    """The length of the gradient of an invariant times that of the state, block by block."""
    total: Any = 0.0
    for which, shape in enumerate((system.v_shape, system.y_shape)):
        block = state[which]
        length = np.sqrt((block * block).sum(axis=tuple(range(len(shape)))))
        states, steps = [], []
        for index in np.ndindex(shape):
            steps.append(PART * np.where(block[index] != 0.0, np.abs(block[index]), np.where(length > 0.0, length, 1.0)))
            for sign in (1.0, -1.0):
                moved = [np.array(each) for each in state]
                moved[which][index] += sign * steps[-1]
                states.append(moved)
        if states:
            v, y = (np.stack([each[i] for each in states], axis=len((system.v_shape, system.y_shape)[i])) for i in range(2))
            there = _values(system, name, (v, y))
            slopes = (there[::2] - there[1::2]) / (2.0 * np.stack(steps))
            total = total + np.sqrt((slopes * slopes).sum(axis=0)) * length
    return np.asarray(total)


class Barrier(NamedTuple):
    """The place within each member's motion at which it takes the most energy to be, and how much; −∞ where there is none."""

    place: Array
    height: Array


def _of_a_barrier(run: Run, name: str, first: Array, barrier: Barrier) -> str | None:
    """A motion along a line that passed a place where even at rest it would have more energy than it has."""
    passed = (barrier.height > first + ROUNDING * np.abs(first)) & (barrier.height < np.inf) & (run.status == 0)
    if not passed.any():
        return None
    index, some = tuple(np.argwhere(passed)[0].tolist()), int(np.count_nonzero(passed))
    who = f"{in_words(index)} passed" if passed.size > 1 else "it passed"
    place, height, had = (float(np.broadcast_to(each, passed.shape)[index]) for each in (*barrier, first))
    return (
        f"{share(some, passed.shape, passed.size)} did not follow the motion, by {run.method.name}: {who} y = {place:.4g}, where "
        f"even at rest the {name} is {height:.10g}, with {had:.10g} at the start; take "
        f"{'shorter steps' if run.paces is None else 'a smaller tolerance'}"
    )


def _range(run: Run, start: State) -> State:
    """Between which y each member is known to have been."""
    ys = np.concatenate([start[1][np.newaxis], run.y])
    return np.asarray(np.fmin.reduce(ys, axis=0)), np.asarray(np.fmax.reduce(ys, axis=0))


def _upright(run: Run, start: State) -> Barrier:
    """A pendulum that stands on its head."""
    assert isinstance(run.system, Pendulum)
    least, most = _range(run, start)
    place = pi * (2.0 * np.ceil(0.5 * (least / pi - 1.0)) + 1.0)
    return Barrier(place, np.where((least < place) & (place < most), 2.0 * run.system.omega * run.system.omega, -np.inf))


def _searched(run: Run, name: str, start: State, places: int) -> tuple[Array, Array, Barrier]:
    """An invariant at the start and at the end, and its barrier: the highest of many places, and of more and more around it.

    It is higher than what is beside it, since a motion may err beyond where it turns; and rest takes the least energy there.
    """
    system, (least, most), ends = run.system, _range(run, start), _ends(run, start)
    y = _between(least, most, places)
    first, last, *_ = values = _values(system, name, (np.concatenate([ends[0], 0.0 * y]), np.concatenate([ends[1], y])))
    height = np.where(np.isfinite(values[2:]), values[2:], -np.inf)
    is_peak = (height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])
    best = 1 + np.where(is_peak, height[1:-1], -np.inf).argmax(axis=0)[np.newaxis]
    has_peak = is_peak.any(axis=0)
    for _ in range(TIMES):
        place, low, high = (np.take_along_axis(y, best + side, axis=0)[0] for side in (0, -1, 1))
        top, *lower = (np.take_along_axis(height, best + side, axis=0)[0] for side in (0, -1, 1))
        # Between them it is higher by no more than it falls beside, but for a peak that is narrower than they are apart.
        if not (has_peak & (2.0 * top - np.minimum(*lower) > first)).any():
            return first, last, Barrier(place, np.full(place.shape, -np.inf))
        y = _between(low, high, FINER)
        height = _values(system, name, (0.0 * y, y))
        best = np.clip(height.argmax(axis=0), 1, FINER - 2)[np.newaxis]
    fastest = np.maximum(np.abs(start[0]), np.fmax.reduce(np.abs(run.v), axis=0))
    speeds = _between(-fastest, fastest, 5)
    least_at_rest = (_values(system, name, (speeds, place + 0.0 * speeds)) >= top).all(axis=0)
    return first, last, Barrier(place, np.where(has_peak & least_at_rest, top, -np.inf))


def _between(low: Array, high: Array, places: int) -> Array:
    """So many places from one to the other, shape (places, *batch)."""
    return np.asarray(low + np.linspace(0.0, 1.0, places).reshape(-1, *(1,) * np.ndim(low)) * (high - low))
