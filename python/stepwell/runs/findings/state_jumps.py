"""Jumps of the rates that the state decides, as a diode by ``np.where(i > 0, …)``: whether they hold down the steps of a run.

A step that crosses such a jump errs by the jump times its length, so it is met by ever shorter steps. Where the state slides
along it, or is thrown back by the stages of an implicit step, all steps are as short as that. It is looked for along lines
through the state, whose rates are compared where they differ most, down to roundings: what is only steep is no jump.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from ...base.arrays import Array, Shape
from ...errors import ToleranceWarning
from .. import engine
from ..events.attempts import attempted
from ..events.members import Members
from ..finding import Finding, Found
from ..options.positive import name_of
from ..request import Request
from ..result import Run, Status
from . import Case
from .stiffness import MANY_OF_FEW, Course, Stand, begun, course_of, rates_of, stands_of

#: The rates are compared at so many places of a line, which reaches so many steps forth and back, and so often where they differ
#: most: 2⁸ parts of 2⁸ parts, down to roundings.
PLACES, REACH, TIMES = 257, 8.0, 6
#: A difference is a jump if this part of it is left there, and matters if, in a step, it makes this part of what is tolerated.
LEFT, MATTERS = 0.25, 0.01
#: A run that came to its end is looked at after ``MANY_OF_FEW`` accepted steps. It crept if so many attempts from both of its
#: waypoints end at a jump again, with steps that are alike within that factor: those that only cross a jump grow by far more.
ATTEMPTS, ALIKE = 64, 100.0


class Jump(NamedTuple):
    """A jump of a rate: when, of which number of v and then of y, and both values."""

    t: float
    place: int
    values: tuple[float, float]


def why_short(run: Run, request: Request, waypoints: Sequence[Array], index: Shape) -> str:
    """The end of the message for a member that stopped: the jump at which its steps are short; "" if there is none."""
    if not run.system.chooses:
        return ""
    course = course_of(run, request)
    place = np.array([np.ravel_multi_index(index, course.status.shape) if index else 0])
    stands = stands_of(course, waypoints[0] if waypoints else None, place)
    jump = next((jump for stand in stands if (jump := _jump(course, stand))), None)
    return "" if jump is None else f": {_in_words(run, jump)}"


def of_run(case: Case) -> Finding | None:
    """The first member that came to its end, but crept at a jump for most of its steps."""
    run = case.run
    assert run.paces is not None
    accepted, status = run.paces.accepted.reshape(-1), run.status.reshape(-1)
    counts = np.where((status == Status.OK) & (accepted >= MANY_OF_FEW), accepted, 0)
    if not counts.any() or not run.system.chooses:
        return None
    course, first = course_of(run, case.request), np.array([counts.argmax()])
    jumps = [_crept(course, stand) for stand in stands_of(course, case.waypoints[0], first)[1:]]
    if len(jumps) < 2 or (jump := jumps[-1]) is None or jumps[0] is None:
        return None
    before = f"{int(counts[first[0]] + run.paces.rejected.reshape(-1)[first[0]])} attempts of "
    why = f"many of them short at a jump of the rates; {_in_words(run, jump)}"
    return Found(ToleranceWarning, first, run.status.shape, before, "", ",", why).finding()


def _in_words(run: Run, jump: Jump) -> str:
    one, other = jump.values
    return (
        f"the rate of {name_of(run.system, jump.place)} jumps from {one:.3g} to {other:.3g} at t = {jump.t:g}, where the state "
        f"crosses a condition (np.where, sign, floor, …), which steps do not see: make it an event, whose then= changes the "
        f"state or a number that the rates read"
    )


def _crept(course: Course, stand: Stand) -> Jump | None:
    """The jump at which the only member of a stand creeps; None if it does not."""
    if (jump := _jump(course, stand)) is None:
        return None
    plan, walls = Members(course.plan._replace(progress=None)).plan(stand.members), course.walls(stand.members)
    later = attempted(plan, np.inf, ATTEMPTS, ATTEMPTS, False, begun(stand.paces), stand.v, stand.y, walls)
    steps = np.diff(later.t[:, 0])
    steps = steps[steps > 0.0]
    alike = steps.size > 0 and float(steps.max()) <= ALIKE * float(steps.min())
    return jump if alike and _jump(course, Stand(stand.members, later.paces, later.v[-1], later.y[-1])) else None


def _jump(course: Course, stand: Stand) -> Jump | None:
    """The jump near which the only member of a stand is; None if there is none."""
    n_v, n_y = prod(course.plan.system.v_shape), prod(course.plan.system.y_shape)
    t, pace = float(stand.paces[engine.TIME, 0]), stand.paces[:, 0]
    state = np.concatenate([stand.v.reshape(n_v), stand.y.reshape(n_y)])
    step = REACH * max(float(pace[engine.STEP]), float(np.spacing(abs(t))))
    rates = rates_of(course.plan, np.repeat(stand.members, PLACES), np.full(PLACES, t))
    way = step * rates(np.repeat(state[:, np.newaxis], PLACES, axis=1))[:, 0]
    with np.errstate(all="ignore"):
        tolerated = float(pace[engine.ABSOLUTE]) + float(pace[engine.RELATIVE]) * (np.abs(state) + np.abs(way))
        # Where the state slides, its rate may vanish on the one side, so a line leads through each number alone, too.
        for line in (way, *np.diag(np.maximum(np.abs(way), tolerated))[: 1 + n_v + n_y]):
            if (jump := _along(rates, state, line, step / tolerated)) is not None:
                return Jump(course.way * t, *jump)
    return None


def _along(rates: Callable[[Array], Array], state: Array, line: Array, weight: Array) -> tuple[int, tuple[float, float]] | None:
    """The number whose rate jumps along a line through the state, and both values; None if none does."""
    low, high, most, row = -1.0, 1.0, 0.0, -1
    for _ in range(TIMES):
        places = np.linspace(low, high, PLACES)
        values = rates(state[:, np.newaxis] + line[:, np.newaxis] * places)
        differences = np.nan_to_num(np.abs(np.diff(values)))
        if row < 0:
            row = int((differences.max(axis=1) * weight).argmax())
            most = float(differences[row].max())
            if not most * weight[row] > MATTERS * REACH:
                return None
        k = int(differences[row].argmax())
        if not differences[row, k] >= LEFT * most:
            return None
        low, high = float(places[k]), float(places[k + 1])
    return row, (float(values[row, k]), float(values[row, k + 1]))
