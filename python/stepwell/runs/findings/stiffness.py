"""Stiffness: whether stability, and not accuracy, holds down the adaptive steps of a run.

It is looked for after the run, where members stood at their last waypoints (``runs/engine/adaptive.py``) and at the end. A step
that is held down by accuracy changes the state by much more than is tolerated as its error, so nearly all runs are seen to be
tame there. Where one is not, a few steps are tried from these states, first as the run makes them, then of half their length:
with these the method is well within its stability limit, and what it had amplified decays. What is left is the solution. If a
polynomial of fourth degree fits it within the tolerance over many steps of the run, a method of fifth order could make them one.
If, besides, the steps are near the limit of the method for the fastest rate there, it is stability that holds them down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ...base import registry
from ...base.arrays import Array, Shape, Whole
from ...errors import StiffnessWarning, UnsupportedError
from ...model.compatibility import fits_together
from ...model.methods import Method, for_stiff
from ...model.methods import method as find_method
from ...model.systems import LinearSystem
from ...reference import adaptive
from ...reference.acceptance import NO_GROUP
from .. import engine
from ..events.attempts import attempted
from ..events.members import Members
from ..finding import Finding, Found
from ..request import Request
from ..result import Run, Status
from . import MANY, Case

Complex = np.ndarray[Any, np.dtype[np.complex128]]

#: Stiffness is looked for in runs of ``MANY`` steps: little work beside a run whose members have FEW_NUMBERS in all. A run of
#: less numbers makes a thousand steps in some tenths of a millisecond, so there it is MANY_OF_FEW.
MANY_OF_FEW, FEW_NUMBERS = 2048, 64
#: Steps are looked at further if they change no group of components by more than MOVED times the tolerated error, or by more than
#: this part of a step for which accuracy asks: its error is about the power ``error_order`` of its relative change.
MOVED, PART_OF_A_STEP = 4.0, 0.25
#: Of so many members the numbers are first looked at side by side.
SEVERAL = 8
#: So many attempts are made as the run makes them, and then so many of SETTLED of their mean length, of which the last ones are
#: looked at.
NATURAL, SETTLING, SETTLED, LOOKED_AT = 32, 128, 0.5, 64
#: The degree of the polynomials that are fitted to so many of these steps. The error of such a fit is that of a step of a method
#: of fifth order, with a constant of 1/120, which is a fourth as long.
DEGREE, FITTED, LONGER = 4, (16, 32, 64), 4.0
#: Rounding bounds the error of a fit from below.
LEAST_ERROR = 1e-15
#: Equations are stiff if the tolerance allows steps this many times as long as those that are made, and these are at least NEAR
#: and at most BEYOND of the limit at which the method is stable for the fastest rate.
STIFF, NEAR, BEYOND = 5.0, 0.4, 4.0
#: Ratios beyond this are not told.
MOST_RATIO = 1000.0
#: A state of more numbers has no matrix of rates; its fastest rate is found by so many rates nearby.
MOST_RATES, ITERATIONS = 256, 40
#: The most numbers in the matrices of members at once.
MOST_NUMBERS = 1_000_000
#: The fraction of a number by which it is changed to approximate a derivative: half of its digits.
PART = 2.0**-26
#: Below it, that fraction of a number would underflow.
LEAST = np.finfo(np.float64).tiny / PART


class Stand(NamedTuple):
    """Where some members stand, one after the other; a member may be there several times."""

    members: Whole  # their places in the flattened batch
    paces: Array  # their step-size controllers, shape (numbers, stands)
    v: Array  # shape (*block, stands)
    y: Array


class Held(NamedTuple):
    """The stability bound on the steps from where members stand; a rate and a limit are zero where no matrix gives them."""

    ratio: Array  # how many times as long steps the tolerance allows; 0 if it is not stability that holds them down
    t: Array  # the time there, in the direction of the system
    rate: Complex  # the eigenvalue of the largest size of the derivative of the rates


class Course(NamedTuple):
    """A run with adaptive steps after its end."""

    plan: engine.Plan
    tolerance: float  # the relative one, the least of all
    jumps: Array | None  # the times that no step crosses, as ``Pacing`` has them
    status: Any  # how members ended, shape (*batch)
    paces: Array  # their step-size controllers at the end, shape (numbers, *batch)
    v: Array  # their state at the end
    y: Array
    way: float  # 1, or −1 where the user's time runs back

    def walls(self, members: Whole) -> Array | None:
        """``jumps`` of some members."""
        if self.jumps is None or self.jumps.ndim == 1:
            return self.jumps
        return np.broadcast_to(self.jumps, (len(self.jumps), *self.plan.batch)).reshape(len(self.jumps), -1)[:, members]


#: Message about stiff members, before the reason.
HELD_DOWN = "stability, and not the tolerance, held down the steps of"


def course_of(run: Run, request: Request) -> Course:
    """The course of a run."""
    end, control = run.controller_state, request.step_control
    assert end is not None
    assert control is not None
    least = float(np.min(control.paces[engine.RELATIVE]))
    way = -1.0 if request.plan.backward else 1.0
    return Course(request.plan, least, control.pacing.jumps, run.status, end.pace, end.v, end.y, way)


def may_be_stiff(steps: Any, numbers: int) -> Any:
    """True if a run of so many accepted steps, whose members have so many numbers in all, is tested for stiffness."""
    return steps >= (MANY if numbers >= FEW_NUMBERS else MANY_OF_FEW)


def of_run(case: Case) -> Finding | None:
    """The members of a run whose steps were held down by stability, and that did not stop."""
    run = case.run
    if not may_be_stiff(case.steps, run.y[-1].size + run.v[-1].size):
        return None
    found = stiff_members(course_of(run, case.request), case.waypoints[0])
    return None if found is None else found._replace(joint=";" if run.status.size > 1 else ":").finding()


def stiff_members(course: Course, waypoints: Array) -> Found | None:
    """The members whose steps were held down by stability, and that did not stop; None if there is none."""
    if course.plan.method.is_always_stable or not (seen := suspects(course.plan, waypoints)):
        return None
    status = course.status.reshape(-1)[seen]
    members = np.array(seen)[(status == Status.OK) | (status == Status.EVENT)]
    if not members.size:
        return None
    verdicts = _verdicts(course, stands_of(course, waypoints, members))
    stiff = np.array([verdict.ratio > 0.0 for verdict in verdicts])
    held = stiff.sum(axis=0) >= 2
    if not held.any():
        return None
    k = int(held.argmax())
    verdict = verdicts[int(stiff[:, k].argmax())]
    limit = _in_words(course.plan, verdict, k, f"at t = {verdict.t[k]:g}")
    why = f"{limit}, where the tolerance allows {_times(verdict.ratio[k])} as long (stiff equations); {_advice(course)}"
    return Found(StiffnessWarning, members[held], course.status.shape, f"{HELD_DOWN} ", "", ":", why)


def held_by_stability(run: Run, request: Request, waypoints: Sequence[Array], index: Shape) -> str:
    """The end of the message for a member that ran out of attempts: whether stability held down its steps."""
    course = course_of(run, request)
    if course.plan.method.is_always_stable:
        return ""
    place = np.array([np.ravel_multi_index(index, course.status.shape) if index else 0])
    rows = waypoints[0] if waypoints else None
    verdicts = _verdicts(course, stands_of(course, rows, place))
    stiff = [bool(verdict.ratio[0] > 0.0) for verdict in verdicts]
    if not (stiff[0] or sum(stiff) >= 2):
        return ", not held down by stability"
    verdict = verdicts[stiff.index(True)]
    there = "there" if stiff[0] else f"at t = {verdict.t[0]:g}"
    limit, ratio = _in_words(course.plan, verdict, 0, there), _times(verdict.ratio[0])
    equations = f"(stiff equations: the tolerance allows {ratio} as long; {_advice(course)})"
    return f", held down by stability and not by accuracy: {limit} {equations}"


def _in_words(plan: engine.Plan, verdict: Held, k: int, where: str) -> str:
    rate = complex(verdict.rate[k])
    limit = limit_of(plan.method, plan.order, rate)
    return f"the fastest rate {where}, 1/{1.0 / abs(rate):.3g}, lets no steps beyond {limit:.3g} be stable"


def _times(ratio: float) -> str:
    return "more than 1000 times" if ratio >= MOST_RATIO else f"about {float(f'{ratio:.1g}'):g} times"


def _advice(course: Course) -> str:
    instead = for_stiff(course.tolerance)
    if instead is not None:
        try:
            fits_together(course.plan.system, instead)
        except UnsupportedError:
            instead = None
    return "SciPy's Radau and LSODA are for them" if instead is None else f'"{instead.name}" is stable there'


def suspects(plan: engine.Plan, waypoints: Array) -> list[int]:
    """The members whose steps to their waypoints moved them as little as those that stability holds down.

    Nearly all members are known to be no such by one number of their state, so they are looked at one by one, in floats; of
    several, those that are left by one number.
    """
    n_v, n_y = prod(plan.system.v_shape), prod(plan.system.y_shape)
    groups, of_v = _places(plan.acceptance.of_numbers(n_v, n_y)), plan.acceptance.counts(n_v, n_y)[0]
    exponent = 1.0 / (plan.order or plan.method.error_order or plan.method.order)
    # What v makes of y within its rounding counts as nothing.
    lost = 0.0 if of_v in (0, len(groups)) else _rounding(plan)
    members: Any = range(plan.members) if plan.members < SEVERAL else _by_the_last_group(plan, waypoints, groups, exponent)
    own = plan.acceptance.own
    return [
        k
        for k in members
        if all(_hardly_moves(row, n_v + n_y, groups, of_v, own, exponent, lost) for row in waypoints[..., k].tolist())
    ]


def _by_the_last_group(plan: engine.Plan, waypoints: Array, groups: list[list[int]], exponent: float) -> Any:
    """The members of which a number of the last group hardly moved, as ``_hardly_moves`` has it."""
    n, count = prod(plan.system.v_shape) + prod(plan.system.y_shape), len(groups)
    place, size = groups[-1][0], waypoints[:, 2 * n + engine.PACE_NUMBERS + count - 1]
    own = 2 * n + engine.PACE_NUMBERS + engine.SCALES * count
    rows = (own + count - 1, own + 2 * count - 1) if plan.acceptance.own else (2 * n + engine.RELATIVE, 2 * n + engine.ABSOLUTE)
    with np.errstate(all="ignore"):
        tolerated = waypoints[:, rows[1]] + waypoints[:, rows[0]] * size
        step = np.fmax(MOVED * tolerated, PART_OF_A_STEP * size * (tolerated / size) ** exponent)
        hardly = np.abs(waypoints[:, n + place] - waypoints[:, place]) <= step
    return np.flatnonzero((hardly & (waypoints[:, 2 * n + engine.COUNTS.start] > 0.0)).all(axis=0))


@cache
def _places(groups: tuple[int, ...]) -> list[list[int]]:
    """The places of the numbers of each group among those of v and y."""
    return [[i for i, own in enumerate(groups) if own == group] for group in sorted(set(groups) - {NO_GROUP})]


def _hardly_moves(
    row: list[float], n: int, groups: list[list[int]], of_v: int, has_own: bool, exponent: float, lost: float
) -> bool:
    """True if the step to a waypoint moved a member as little as one that stability holds down.

    The largest sizes so far stand for the present ones, which allows rather more than is tolerated. A state has ``n`` numbers.
    """
    count = len(groups)
    first = 2 * n + engine.PACE_NUMBERS
    own = first + engine.SCALES * count
    if not row[2 * n + engine.COUNTS.start] > 0.0:
        return False
    relative, absolute = row[2 * n + engine.RELATIVE], row[2 * n + engine.ABSOLUTE]
    for group, places in enumerate(groups):
        size = longest = row[first + group]
        if lost and group < of_v:
            size = max(size, lost / row[2 * n + engine.STEP] * max(row[first + of_v : first + count]))
        if has_own:
            relative, absolute = row[own + group], row[own + count + group]
        tolerated = absolute + relative * size
        step = PART_OF_A_STEP * longest * (tolerated / longest) ** exponent if longest > 0.0 else 0.0
        moved = abs(row[n + places[0]] - row[places[0]])
        if len(places) > 1:
            moved = math.hypot(*(row[n + i] - row[i] for i in places))
        if not moved <= max(MOVED * tolerated, step):
            return False
    return True


def _rounding(plan: engine.Plan) -> float:
    return adaptive.SINGLE_ROUNDING if plan.single else adaptive.ROUNDING


def stands_of(course: Course, waypoints: Array | None, members: Whole) -> list[Stand]:
    """Where members stand at the end, and where they stood at their last waypoints, the later one first."""
    system, size = course.plan.system, course.status.size
    shapes = system.v_shape, system.y_shape
    blocks = [block.reshape(*shape, size)[..., members] for block, shape in zip((course.v, course.y), shapes, strict=True)]
    stands = [Stand(members, course.paces.reshape(-1, size)[:, members], *blocks)]
    if waypoints is None:
        return stands
    n_v, n = prod(shapes[0]), prod(shapes[0]) + prod(shapes[1])
    rows = waypoints[:, n:, members]
    count = rows[:, n + engine.COUNTS.start]
    order = np.argsort(-count, axis=0)
    rows = np.take_along_axis(rows, order[:, np.newaxis], axis=0)
    for each in rows:
        v, y = (each[part].reshape(*shape, len(members)) for part, shape in zip((slice(n_v), slice(n_v, n)), shapes, strict=True))
        if (each[n + engine.COUNTS.start] > 0.0).all():
            stands.append(Stand(members, each[n:], v, y))
    return stands


def _verdicts(course: Course, stands: Sequence[Stand]) -> list[Held]:
    """The stability bounds on the steps from each of some places where members stand, found for all together."""
    held = _held(course, Stand(*(np.concatenate(each, axis=-1) for each in zip(*stands, strict=True))))
    return [Held(*each) for each in zip(*(np.split(numbers, len(stands)) for numbers in held), strict=True)]


def begun(paces: Array) -> Array:
    """A copy of step-size controllers, for further attempts from where they stand."""
    paces = np.array(paces)
    paces[[engine.EXTRA, engine.HELD, *range(engine.COUNTS.start, engine.COUNTS.stop)]] = 0.0
    return paces


def _held(course: Course, stand: Stand) -> Held:
    plan, jumps = Members(course.plan._replace(progress=None)).plan(stand.members), course.walls(stand.members)
    paces = begun(stand.paces)
    t, most = paces[engine.TIME], paces[engine.MOST_STEP].copy()
    natural = attempted(plan, np.inf, NATURAL, NATURAL, False, paces, stand.v, stand.y, jumps)
    step = (natural.t[-1] - t) / NATURAL
    paces = begun(natural.paces)
    paces[engine.MOST_STEP] = np.minimum(most, SETTLED * step)
    paces[engine.STEP] = np.minimum(paces[engine.STEP], paces[engine.MOST_STEP])
    settled = attempted(plan, np.inf, SETTLING, SETTLING, False, paces, natural.v[-1], natural.y[-1], jumps)
    with np.errstate(all="ignore"):
        lengths = np.diff(settled.t[-LOOKED_AT - 1 :], axis=0) / paces[engine.MOST_STEP]
        ratio = np.where((np.abs(lengths - 1.0) < 1e-3).all(axis=0), _smooth_for(plan, settled.v, settled.y, settled.paces), 0.0)
        # Steps that something else bounds are not held down by stability.
        bound = np.where(t < stand.paces[engine.UNTIL], np.minimum(most, stand.paces[engine.INTERVAL]), most)
        ratio = np.where((ratio >= STIFF) & (natural.lengths(plan).max(axis=0) < 0.99 * bound), ratio, 0.0)
    rate = np.zeros(len(t), dtype=np.complex128)
    suspects = np.flatnonzero(ratio)
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    for some in np.array_split(suspects, -(-len(suspects) * n * n // MOST_NUMBERS)) if suspects.size else ():
        rate[some] = _fastest(plan, some, t[some], stand.v[..., some], stand.y[..., some])
    reach = step * np.abs(rate) / limit_of(plan.method, plan.order, -1.0)
    ratio = np.where((reach >= NEAR) & (reach <= BEYOND), ratio, 0.0)
    return Held(ratio, course.way * t, rate)


def _smooth_for(plan: engine.Plan, v: Array, y: Array, paces: Array) -> Array:
    """How many times as long as before they settled the steps may be that follow the last states within the tolerance."""
    pace = engine.pace_of(plan, paces)
    size = adaptive.sizes(v[-1], y[-1], plan.block_axes, plan.acceptance.groups)
    counts = plan.acceptance.counts(*adaptive.numbers_in(v[-1], y[-1], plan.block_axes))
    _, tolerated = adaptive.tolerated(pace, pace.h, counts, size, size, _rounding(plan))
    best = np.zeros(plan.members)
    for steps in FITTED:
        rest_v, rest_y = (_besides_a_polynomial(block[-steps - 1 :]) for block in (v, y))
        error = adaptive.over(adaptive.sizes(rest_v, rest_y, plan.block_axes, plan.acceptance.groups), tolerated[..., np.newaxis])
        error = error.max(axis=-1)
        times = SETTLED * steps / LONGER * np.maximum(error, LEAST_ERROR) ** (-1.0 / (DEGREE + 1))
        best = np.where(error <= 1.0, np.fmax(best, times), best)
    return best


def _besides_a_polynomial(states: Array) -> Array:
    """The residual of states at equal distances after a least-squares fit of polynomials; the first axis becomes the last."""
    places = np.linspace(-1.0, 1.0, len(states))
    q, _ = np.linalg.qr(np.polynomial.chebyshev.chebvander(places, DEGREE))
    rows = states.reshape(len(states), -1)
    return np.moveaxis((rows - q @ (q.T @ rows)).reshape(states.shape), 0, -1)


def limit_of(method: Method, order: int, rate: complex) -> float:
    """The longest stable step of a method for a rate λ; of a series of that order."""
    angle = math.atan2(abs(rate.imag), rate.real) if rate.imag else math.pi if rate.real < 0.0 else 0.0
    return _limit_along(method.name, order, angle) / abs(rate)


@cache
def _limit_along(name: str, order: int, angle: float) -> float:
    """The longest stable step for a rate of size 1 at an angle."""
    method, mode = find_method(name), complex(math.cos(angle), math.sin(angle) if angle < math.pi else 0.0)
    if method.has_series and order:
        return _limit_of_series(order, mode)
    matrix = [[mode.real, -mode.imag], [mode.imag, mode.real]] if mode.imag else [[mode.real]]
    return float(registry.task("stability_limit")(LinearSystem(matrix), method))


def _limit_of_series(order: int, mode: complex) -> float:
    """The longest step with which the first terms of the exponential function are no larger than 1."""
    terms = [1.0 / math.factorial(k) for k in range(order, -1, -1)]

    def grows(step: float) -> bool:
        return bool(abs(np.polyval(terms, step * mode)) > 1.0 + 1e-12)

    below = next(k for k in range(64 * order) if grows((k + 1) / 32.0)) / 32.0
    above = below + 1.0 / 32.0
    for _ in range(50):
        middle = 0.5 * (below + above)
        below, above = (below, middle) if grows(middle) else (middle, above)
    return below


def _fastest(plan: engine.Plan, members: Whole, t: Array, v: Array, y: Array) -> Complex:
    """The eigenvalues of the largest size of the derivatives of the rates; of states of many numbers their sizes, negated.

    Args:
        plan: of all members.
        members: those that are looked at.
        t: their times.
        v: their velocities.
        y: their coordinates.
    """
    state, scale = _scaled(v, y, len(members))
    if len(state) > MOST_RATES:
        return _by_iteration(rates_of(plan, members, t), state, PART * scale)
    values = np.linalg.eigvals(derivatives_of(plan, members, t, v, y))
    largest: Complex = np.take_along_axis(values, np.abs(values).argmax(axis=1)[:, np.newaxis], 1)[:, 0].astype(np.complex128)
    return largest


def _scaled(v: Array, y: Array, count: int) -> tuple[Array, Array]:
    """The states of so many members as rows, and the length of the block of each number, 1 where it underflows."""
    flat = [block.reshape(block.size // count, count) for block in (v, y)]
    lengths = np.concatenate([np.broadcast_to(np.sqrt((block * block).sum(axis=0)), block.shape) for block in flat])
    return np.concatenate(flat), np.where(lengths >= LEAST, lengths, 1.0)


def derivatives_of(plan: engine.Plan, members: Whole, t: Array, v: Array, y: Array) -> Array:
    """The derivatives of the rates, shape (members, rates, numbers), by differences; zero where they are not finite."""
    state, scale = _scaled(v, y, len(members))
    n, count = state.shape
    scale = np.where(np.abs(state) >= LEAST, np.abs(state), scale)
    # The states, and each with one of its numbers changed, are members side by side.
    changed = np.repeat(state[:, np.newaxis], n + 1, axis=1)
    changed[np.arange(n), np.arange(1, n + 1)] += PART * scale
    every = np.tile(np.arange(count), n + 1)
    rates = rates_of(plan, members[every], t[every])(changed.reshape(n, -1)).reshape(n, n + 1, count)
    change = changed[np.arange(n), np.arange(1, n + 1)] - state
    matrix = np.moveaxis((rates[:, 1:] - rates[:, :1]) / change, -1, 0)
    return np.where(np.isfinite(matrix).all(axis=(1, 2), keepdims=True), matrix, 0.0)


def rates_of(plan: engine.Plan, members: Whole, t: Array) -> Callable[[Array], Array]:
    """The rates of some members as a function of their states, rows of numbers."""
    plan = Members(plan).plan(members)
    unit, n_v, shapes = engine.attempted_system(plan).unit, prod(plan.system.v_shape), (plan.system.v_shape, plan.system.y_shape)

    def rates(state: Array) -> Array:
        parts = [part.reshape(*shape, len(members)) for part, shape in zip((state[:n_v], state[n_v:]), shapes, strict=True)]
        with np.errstate(all="ignore"):
            both = unit.dv(t, *parts), unit.dy(t, *parts)
        wide = (np.broadcast_to(rate, part.shape) for rate, part in zip(both, parts, strict=True))
        return np.concatenate([rate.reshape(rate.size // len(members), len(members)) for rate in wide])

    return rates


def _by_iteration(rates: Callable[[Array], Array], state: Array, scale: Array) -> Complex:
    """About minus the sizes of the largest eigenvalues, by powers of the derivative on a vector."""
    change, here, grown = np.cos(np.arange(len(state)) ** 2.0)[:, np.newaxis] * scale, rates(state), []
    length = np.linalg.norm(scale, axis=0)
    for _ in range(ITERATIONS):
        change = change * (length / np.linalg.norm(change, axis=0))
        change, before = rates(state + change) - here, np.linalg.norm(change, axis=0)
        grown.append(np.linalg.norm(change, axis=0) / before)
    with np.errstate(all="ignore"):
        size = np.exp(np.mean(np.log(grown[ITERATIONS // 2 :]), axis=0))
    return np.where(np.isfinite(size), -size, 0.0).astype(np.complex128)
