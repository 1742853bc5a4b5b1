"""Runs whose energy or invariant shows at their end that they did not follow the motion; for systems other than bodies."""

from __future__ import annotations

from math import pi, prod
from typing import Any

import numpy as np

from ...base import registry
from ...base.arrays import Array, Shape
from ...base.reprs import in_words
from ...errors import AccuracyWarning
from ...model.systems import Pendulum, RigidBody, System
from ...reference.acceptance import Acceptance
from ..engine import ABSOLUTE, PACE_NUMBERS, RELATIVE, own_tolerances
from ..finding import Finding, named
from ..result import Run
from . import FEW_EVALUATIONS, KERNEL_OF_EQUATIONS, Case, State, another, evaluations_of, may_pass_barriers

#: A message, and the members that it is about.
About = tuple[str, np.ndarray[Any, np.dtype[np.bool_]]]

#: A run is checked only if it has at most this many numbers, so that checking is little work beside it.
MOST_NUMBERS = 100_000
#: An invariant has changed if its change is more than this share of the size of its terms, and more than this share either of
#: what its terms exchange in the motion, such as the kinetic energy of a swing, or of its own size; in the last case also more
#: than CHANGED_OF_SLOPE of its slope times the length of the state, since terms may cancel. The first two sizes do not depend on
#: a constant that is added to the invariant. The second alone would report a fast rotation that exchanges little, and the third
#: alone an energy that happens to be zero. For a quadratic energy all of them are the energy, and the last is twice that.
#: Changes below LITTLE of its own size are not checked, which takes a hundred microseconds: they would count only if a constant
#: of a thousand times what is exchanged was added.
CHANGED, CHANGED_OF_SLOPE, LITTLE = 0.5, 0.25, 2.0**-10
#: The share in place of CHANGED of what algebraic equations keep: they have lost the constraint of which they are the derivative.
DRIFTED = 0.1
#: The steps of a way on which such an invariant is looked at.
STEPS = 16
#: A central difference changes a number by this part of it: a third of its digits.
PART = 2.0**-17
#: Changes of an invariant by v and by y cancel up to this share. The error of differences is the square of the part by which an
#: angle changes, 1e-5 with some hundred turns a unit of time; damping and drives leave more than a thousandth.
CONSTANT = 1e-3
#: A gradient is computed by differences for states of at most this many numbers.
MOST_IN_GRADIENT = 64
#: A barrier is searched at PLACES places between the ends of a motion, then at FINER places between two of them, TIMES times.
PLACES, FINER, TIMES = 1024, 33, 3
#: A barrier counts if it is higher than the energy by more than the roundings of both.
ROUNDING = 2.0**-40


def keeps_energy(system: System, force: Array | None) -> bool:
    """True if the true motion keeps its energy: no damping, drag, friction, floors, inputs, torques or force."""
    system = system.uncontrolled
    if force is not None or getattr(system, "torques_act", False):
        return False
    if not all(part.keeps_energy for part in system.around):
        return False
    if system.kernel == KERNEL_OF_EQUATIONS:
        return True  # its energy was declared to be constant
    terms = [getattr(system, name, None) for name in ("damping", "drag", "friction")]
    if any(term is not None and np.any(term) for term in terms):
        return False
    return isinstance(system, RigidBody) or not system.given_inputs()


def judged_by_change(system: System, force: Array | None) -> list[str] | None:
    """The invariants by whose change a run of adaptive steps is judged; None if it is judged by more than that.

    Changes below ``LITTLE`` of their size say that the run followed the motion.
    """
    if system.keeper is not None or not (names := _names(system)) or not keeps_energy(system, force):
        return []
    return None if _has_barriers(system) else names


def of_run(case: Case) -> Finding | None:
    """The members of a run that say themselves that they mean nothing, or did not follow the motion by what it keeps."""
    about = case.run.system.doubt(case.run.y)
    if about is None and case.start is not None:
        about = _doubt_of(case, case.start)
    return None if about is None else Finding(AccuracyWarning, *about)


def _doubt_of(case: Case, start: State) -> About | None:
    """The evidence that members did not follow the motion from this start, and which members; None without any.

    With steps of fixed length the method itself makes the energy grow or decay. There only a passed barrier counts, with a method
    that keeps swings bounded, and what algebraic equations keep.
    """
    run, system = case.run, case.run.system
    if run.paces is None and not may_pass_barriers(system, run.method, run.steps):
        return None
    if system.keeper is not None or not (names := _names(system)) or not run.status.size:
        return None
    evaluations = evaluations_of(run)
    if evaluations < FEW_EVALUATIONS or run.v[-1].size + run.y[-1].size > MOST_NUMBERS:
        return None
    if not keeps_energy(system, run.force) or not case.heard(AccuracyWarning):
        return None
    start = np.broadcast_to(start[0], run.v.shape[1:]), np.broadcast_to(start[1], run.y.shape[1:])
    with np.errstate(all="ignore"):
        for name in names:
            about = _of_one(case, name, start, evaluations)
            # An invariant may be declared only to be recorded, such as the energy of a damped or driven system.
            if about is not None and (system.kernel != KERNEL_OF_EQUATIONS or _is_constant(run, name, start)):
                return about
    return None


def _has_barriers(system: System) -> bool:
    """True if it moves along a line or a circle, where it may not pass what takes more energy than it has."""
    is_line = system.kernel == KERNEL_OF_EQUATIONS and system.v_shape == () and system.y_shape == ()
    return isinstance(system, Pendulum) or is_line


def _is_constant(run: Run, name: str, start: State) -> bool:
    """True if an invariant is one: along the rates at the end its changes by v and by y cancel, or those by each y without v."""
    system, (v, y), members = run.system, _end(run), run.status.shape
    if system.mass_matrix is not None:
        return _is_constant_at_first(run, name, start)
    alone, t = system.reference_at_step(1.0, members), np.broadcast_to(run.t[-1], members)
    rates = np.broadcast_to(alone.dv(t, v, y), v.shape), np.broadcast_to(alone.dy(t, v, y), y.shape)
    if not prod(system.v_shape):
        return _cancels(system, name, y, rates[1])
    axes = [tuple(range(len(shape))) for shape in (system.v_shape, system.y_shape)]
    sizes = [[np.abs(block).sum(axis=own) for block, own in zip(blocks, axes, strict=True)] for blocks in ((v, y), rates)]
    time = PART * sum(sizes[0]) / sum(sizes[1])
    changes = []
    for by_v, by_y in ((time, 0.0), (0.0, time)):
        ends = [(v + sign * by_v * rates[0], y + sign * by_y * rates[1]) for sign in (1.0, -1.0)]
        later, earlier = _of_several(system, name, ends)
        changes.append(later - earlier)
    constant = np.abs(changes[0] + changes[1]) <= CONSTANT * (np.abs(changes[0]) + np.abs(changes[1]))
    return bool((constant | ~np.isfinite(changes[0] + changes[1])).all())


def _cancels(system: System, name: str, y: Array, rates: Array) -> bool:
    """True if the changes of an invariant by each number of y, along these rates, cancel."""
    own = tuple(range(len(system.y_shape)))
    changes = _slopes(system, name, (np.empty((0, *y.shape[len(own) :])), y))[1] * rates
    whole = changes.sum(axis=own)
    return bool(((np.abs(whole) <= CONSTANT * np.abs(changes).sum(axis=own)) | ~np.isfinite(whole)).all())


def _is_constant_at_first(run: Run, name: str, start: State) -> bool:
    """``_is_constant`` for algebraic equations, on a short way from the start, since it may hold only where a constraint does.

    That the length of a rod has no acceleration keeps it only if it has no velocity either, as at the start. At rest nothing
    changes, so the way is as long as the state takes to change by its size, in ``STEPS`` steps by RK4.
    """
    system, y, t, rates = run.system, start[1], run.t0, registry.task("algebraic_rates")
    own = tuple(range(len(system.y_shape)))
    begin = rates(system, y, t, 1.0)
    h = np.abs(y).sum(axis=own) / np.abs(begin).sum(axis=own) / STEPS
    for _ in range(STEPS):
        k = [rates(system, y, t, h)]
        for part in (0.5, 0.5, 1.0):
            k.append(rates(system, y + part * h * k[-1], t + part * h, h))
        y, t = y + h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3]), t + h
    return _cancels(system, name, y, rates(system, y, t, h))


def _of_one(case: Case, name: str, start: State, evaluations: int) -> About | None:
    """The evidence of one invariant. States are evaluated together, since a call takes longer than a thousand numbers."""
    run, system = case.run, case.run.system
    # Of few members it takes some tenths of a millisecond; else a place takes as long as some hundred evaluations of the core.
    few = run.status.size * PLACES <= MOST_NUMBERS // 10
    places = PLACES if few else min(PLACES, MOST_NUMBERS // run.status.size, evaluations // 100)
    has_barriers = _has_barriers(system) and (isinstance(system, Pendulum) or places >= FINER)
    has_equations = system.mass_matrix is not None
    if not has_barriers and run.paces is None and not has_equations:
        return None
    region = _region(run, start) if has_barriers else None
    first, last, above = _looked_over(run, name, start, region, places)
    if region is not None and (above < np.inf).any():
        between = region if run.paces is None else _stepped(case, name, start, above)
        if between is not None:
            barrier = (
                _upright(run, between) if isinstance(system, Pendulum) else _searched(run, name, start, first, between, places)
            )
            if (about := _of_a_barrier(run, name, first, barrier)) is not None:
                return about
    return None if run.paces is None and not has_equations else _of_a_change(run, name, start, (first, last))


def _looked_over(run: Run, name: str, start: State, region: State | None, places: int) -> tuple[Array, Array, Array]:
    """An invariant at the start and at the end, and how far the lowest barrier of a region above the first is above it."""
    system, end = run.system, _end(run)
    if region is None or isinstance(system, Pendulum):
        first, last = _of_several(system, name, [start, end])
        if region is None:
            return first, last, np.full(run.status.shape, np.inf)
        heights = _upright(run, region)[1][np.newaxis]
    else:
        y = _between(*region, places)
        v, y = (np.concatenate([np.stack(pair), more]) for *pair, more in zip(start, end, (0.0 * y, y), strict=True))
        first, last, *_ = values = _values(system, name, (v, y))
        heights = np.where(np.isfinite(values[2:]), values[2:], -np.inf)
        top, *beside = heights[1:-1], heights[:-2], heights[2:]
        # Between places it is higher by no more than it falls beside.
        heights = np.where((top >= beside[0]) & (top >= beside[1]), 2.0 * top - np.minimum(*beside), -np.inf)
    return first, last, np.where(heights > first, heights - first, np.inf).min(axis=0)


def _names(system: System) -> list[str]:
    if system.kernel == KERNEL_OF_EQUATIONS:
        return list(system.quantities)
    return ["energy"] if "energy" in system.quantities else []


def _values(system: System, name: str, states: State) -> Array:
    """An invariant of several states of all members, shape (states, *batch)."""
    return np.broadcast_to(system.recordable(name, *states, 1.0), states[1].shape[len(system.y_shape) :])


def _of_a_change(run: Run, name: str, start: State, values: tuple[Array, Array]) -> About | None:
    """Members whose invariant has another size at the end."""
    first, last = values
    change = np.abs(last - first)
    size = np.maximum(np.abs(first), np.abs(last))
    wrong = (change > LITTLE * size) & np.isfinite(last) & (run.status == 0)  # others were named before
    n = prod(run.system.v_shape) + prod(run.system.y_shape)
    if not wrong.any() or n > MOST_IN_GRADIENT:
        return None
    to_the_end, at_most = (0.0, 0.0) if run.paces is None else _exchanged(run, name, start, first)
    most = CHANGED if run.system.mass_matrix is None else DRIFTED
    by_exchange = ~(change <= most * at_most)
    by_size = ~(change <= most * np.maximum(size, to_the_end))
    for state in (start, _end(run)):
        if not (wrong & (by_exchange | by_size)).any():
            return None
        slopes = _slopes(run.system, name, state)
        terms, steepness = _of_terms(run.system, name, state, slopes)
        wrong &= ~(change <= most * terms) & ~(change <= _of_a_step(run, slopes))
        by_size &= ~(change <= CHANGED_OF_SLOPE / CHANGED * most * steepness)
    wrong &= by_exchange | by_size
    if not wrong.any():
        return None
    return another(wrong, name, first, last, f"{run.method.name} did not follow the motion"), wrong


def _end(run: Run) -> State:
    return run.v[-1], run.y[-1]


def _sizes(run: Run, numbers: Array) -> State:
    """Spread one number for each group of components over the numbers of v and y."""
    shapes = run.system.v_shape, run.system.y_shape
    n_v, n_y = (prod(shape) for shape in shapes)
    groups = Acceptance(run.system.groups).of_numbers(n_v, n_y)
    rows = np.concatenate([numbers, np.zeros_like(numbers[:1])])[list(groups)]  # the last is that of no group
    v, y = (part.reshape((*shape, *part.shape[1:])) for part, shape in zip((rows[:n_v], rows[n_v:]), shapes, strict=True))
    return v, y


def _longest(run: Run) -> Array:
    """The largest that each group has been at the end of a step."""
    assert run.controller_state is not None
    groups = Acceptance(run.system.groups).counts(prod(run.system.v_shape), prod(run.system.y_shape))
    return run.controller_state.pace[PACE_NUMBERS : PACE_NUMBERS + sum(groups)]


def _exchanged(run: Run, name: str, start: State, first: Array) -> tuple[Array, Array]:
    """The most by which an invariant would change from the start if one number alone did what it did in the motion.

    If it became what it is at the end; and if it went as far as it has been, to either side, too. A run that went astray went
    farther than the motion, so of the two the second is not what the motion exchanges, but no less.
    """
    longest, end = _sizes(run, _longest(run)), _end(run)
    others = [(end[which], longest[which], -longest[which]) for which in range(2)]
    states = [_with(start, which, index, each[index]) for which, index in _places(run.system) for each in others[which]]
    changes = np.abs(_of_several(run.system, name, states) - first)
    changes = np.where(np.isfinite(changes), changes, 0.0)
    return changes[::3].max(axis=0), changes.max(axis=0)


def _places(system: System) -> list[tuple[int, tuple[int, ...]]]:
    """The numbers of a state: 0 for v or 1 for y, and the place within it."""
    return [(which, index) for which, shape in enumerate((system.v_shape, system.y_shape)) for index in np.ndindex(shape)]


def _with(state: State, which: int, index: tuple[int, ...], number: Any) -> State:
    v, y = (np.array(each) if k == which else each for k, each in enumerate(state))
    (v, y)[which][index] = number
    return v, y


def _of_several(system: System, name: str, states: list[State]) -> Array:
    shapes = system.v_shape, system.y_shape
    v, y = (np.stack([each[i] for each in states], axis=len(shapes[i])) for i in range(2))
    return _values(system, name, (v, y))


def _length(block: Array, shape: Shape) -> Array:
    return np.asarray(np.sqrt((block * block).sum(axis=tuple(range(len(shape))))))


def _slopes(system: System, name: str, state: State) -> State:
    """The gradient of an invariant, by v and by y."""
    shapes, states, steps = (system.v_shape, system.y_shape), [], []
    lengths = [_length(block, shape) for block, shape in zip(state, shapes, strict=True)]
    for which, index in _places(system):
        number, length = state[which][index], lengths[which]
        steps.append(PART * np.where(number != 0.0, np.abs(number), np.where(length > 0.0, length, 1.0)))
        states += [_with(state, which, index, number + sign * steps[-1]) for sign in (1.0, -1.0)]
    values, n_v = _of_several(system, name, states), prod(system.v_shape)
    slopes = (values[::2] - values[1::2]) / (2.0 * np.stack(steps))
    return slopes[:n_v].reshape(state[0].shape), slopes[n_v:].reshape(state[1].shape)


def _of_terms(system: System, name: str, state: State, slopes: State) -> tuple[Array, Array]:
    """The factors of the terms of an invariant, and the length of its slope times that of the state; both block by block.

    The first is what the length of a block, straight down or up, makes of it, or the second where that is less.

    That of ½v² is the energy that would be gone at rest. A steep potential is far below its slope times the length. An angular
    momentum of 0 changes across the motion, and its rounding is nothing beside that. Numbers of one block of a first-order system
    may have any units, so that there both are the sum of each number times its own slope.
    """
    if not prod(system.v_shape):
        each = np.abs(slopes[1] * state[1]).sum(axis=tuple(range(len(system.y_shape))))
        return each, each
    here, terms, along = _of_several(system, name, [state])[0], np.zeros(()), np.zeros(())
    for which, (block, slope, shape) in enumerate(zip(state, slopes, (system.v_shape, system.y_shape), strict=True)):
        if not prod(shape):
            continue
        length, steepness = _length(block, shape), _length(slope, shape)
        way = np.where(steepness > 0.0, slope / steepness, 0.0) * length
        both = [tuple(each + sign * way if k == which else each for k, each in enumerate(state)) for sign in (1.0, -1.0)]
        changes = np.abs(_of_several(system, name, both) - here)  # type: ignore[arg-type]  # v and y
        changes = np.where(np.isfinite(changes), changes, np.inf)
        terms, along = terms + np.minimum(steepness * length, changes.min(axis=0)), along + steepness * length
    return np.asarray(terms), np.asarray(along)


def _of_a_step(run: Run, slopes: State) -> Array:
    """By how much an invariant may change in a step whose error is just tolerated, or by rounding."""
    if run.controller_state is None:
        return np.zeros(())
    pace, longest, system = run.controller_state.pace, _longest(run), run.system
    groups = len(longest)
    relative, absolute = pace[RELATIVE], pace[ABSOLUTE]
    if len(own := own_tolerances(pace, groups, run.method.has_series * len(_places(system)))):
        relative, absolute = own[:groups], own[groups:]
    errors = _sizes(run, absolute + np.maximum(relative, ROUNDING) * longest)
    parts = zip(slopes, errors, (system.v_shape, system.y_shape), strict=True)
    return np.asarray(sum((np.abs(slope) * error).sum(axis=tuple(range(len(shape)))) for slope, error, shape in parts))


def _of_a_barrier(run: Run, name: str, first: Array, barrier: State) -> About | None:
    """Members that passed a place along a line where even at rest they would have more energy than they have.

    A barrier is the place within each member's motion at which it takes the most energy to be, and how much; −∞ if there is none.
    """
    _, most = barrier
    passed = (most > first + ROUNDING * np.abs(first)) & (most < np.inf) & (run.status == 0)
    if not passed.any():
        return None
    who = named(passed)
    passes = f"{in_words(who.place)} passed" if passed.size > 1 else "it passed"
    place, height, had = (float(np.broadcast_to(each, passed.shape)[who.place]) for each in (*barrier, first))
    text = (
        f"{who.share} did not follow the motion, by {run.method.name}: {passes} y = {place:.4g}, where "
        f"even at rest the {name} is {height:.10g}, with {had:.10g} at the start; take "
        f"{'shorter steps' if run.paces is None else 'a smaller tolerance'}"
    )
    return text, passed


def _region(run: Run, start: State) -> State:
    """Between which y each member may have been: by its saved states, or by its largest distance from 0 in adaptive steps."""
    if run.paces is None:
        ys = np.concatenate([start[1][np.newaxis], run.y])
        return np.asarray(np.fmin.reduce(ys, axis=0)), np.asarray(np.fmax.reduce(ys, axis=0))
    _, farthest = _sizes(run, _longest(run))
    farthest = np.fmax(farthest, np.abs(run.y[-1]))  # within the last step
    return -farthest, farthest


def _stepped(case: Case, name: str, start: State, above: Array) -> State | None:
    """Between which y each member has been at the ends of its adaptive steps, which do not depend on the saved times.

    The steps are made again only for members with a barrier that the tolerated errors of all their steps together would lift
    them over. None if no member has such a barrier.
    """
    run, request, control = case.run, case.request, case.request.step_control
    assert run.paces is not None
    fastest, _ = _sizes(run, _longest(run))
    states = (start, _end(run), (np.broadcast_to(fastest, run.status.shape), start[1]))
    of_a_step = np.maximum.reduce([_of_a_step(run, _slopes(run.system, name, state)) for state in states])
    may = (above < np.inf) & ~(above > run.paces.accepted * of_a_step) & (run.status == 0)
    if control is None or not may.any():
        return None
    from ..events.attempts import extremes  # only runs beside a barrier need it

    some = np.flatnonzero(may)
    least, most, rejected = extremes(request.plan, control.pacing, control.paces, request.v, request.y, some)
    # Where a saved state caused a rejection, the steps were others, of which only the saved states are known.
    known = np.where(rejected == run.paces.rejected[may], run.y[-1:][:, may], run.y[:, may])
    between = [np.array(np.broadcast_to(start[1], run.status.shape)) for _ in range(2)]
    between[0][may] = np.fmin(least, np.fmin.reduce(known, axis=0))
    between[1][may] = np.fmax(most, np.fmax.reduce(known, axis=0))
    return between[0], between[1]


def _upright(run: Run, between: State) -> State:
    assert isinstance(run.system, Pendulum)
    least, most = between
    place = pi * (2.0 * np.ceil(0.5 * (least / pi - 1.0)) + 1.0)
    return place, np.where((least < place) & (place < most), 2.0 * run.system.omega * run.system.omega, -np.inf)


def _searched(run: Run, name: str, start: State, first: Array, between: State, places: int) -> State:
    """The barrier of an invariant: the highest of many places, and of more and more around it.

    It is higher than what is beside it, since a motion may err beyond where it turns; and rest takes the least energy there.
    """
    system = run.system
    y = _between(*between, places)
    height = _values(system, name, (0.0 * y, y))
    height = np.where(np.isfinite(height), height, -np.inf)
    is_peak = (height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])
    best = 1 + np.where(is_peak, height[1:-1], -np.inf).argmax(axis=0)[np.newaxis]
    has_peak = is_peak.any(axis=0)
    for _ in range(TIMES):
        place, low, high = (np.take_along_axis(y, best + side, axis=0)[0] for side in (0, -1, 1))
        top, *lower = (np.take_along_axis(height, best + side, axis=0)[0] for side in (0, -1, 1))
        # Between them it is higher by no more than it falls beside, but for a peak that is narrower than they are apart.
        if not (has_peak & (2.0 * top - np.minimum(*lower) > first)).any():
            return place, np.full(place.shape, -np.inf)
        y = _between(low, high, FINER)
        height = _values(system, name, (0.0 * y, y))
        best = np.clip(height.argmax(axis=0), 1, FINER - 2)[np.newaxis]
    fastest = np.maximum(np.abs(start[0]), np.fmax.reduce(np.abs(run.v), axis=0))
    speeds = _between(-fastest, fastest, 5)
    least_at_rest = (_values(system, name, (speeds, place + 0.0 * speeds)) >= top).all(axis=0)
    return place, np.where(has_peak & least_at_rest, top, -np.inf)


def _between(low: Array, high: Array, places: int) -> Array:
    """Equidistant points from one to the other, shape (places, *batch)."""
    return np.asarray(low + np.linspace(0.0, 1.0, places).reshape(-1, *(1,) * np.ndim(low)) * (high - low))
