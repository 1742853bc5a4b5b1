"""Bodies that met within a step of a run, where that may be and a search takes a moment.

A run of theirs is searched if two bodies alone would meet so from a saved state, and the others pull them apart or together by
less than the two pull each other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array, Shape
from ...base.reprs import of_member
from ...model.parameters import aligned
from ...model.systems import NBody
from ..encounters import HILL_RADII, MAX_RERUN, hill, planets
from ..finding import only
from ..result import Run
from . import FEW_EVALUATIONS, State, when

#: The energy of one member of at most so many bodies is summed in floats, and their pairs are compared in floats. That takes some
#: microseconds, little beside a run of ``FEW_EVALUATIONS``.
FEW_BODIES = 8
#: NumPy computes other energies and pairs, which is little beside a run of this many rate evaluations and pairs in all. States of
#: more than MOST_NUMBERS would take memory that was not counted.
EVALUATIONS, PAIRS, MOST_NUMBERS = 2000, 200_000, 1_000_000
#: Pairs are checked in at most this many saved states.
STATES = 32


def of_encounters(run: Run, bodies: NBody, start: State | None, doubtful: Shape | None) -> tuple[str, Any] | None:
    """Two bodies that met within a step: a message and the member, if something suggests it and the search takes a moment.

    ``start`` is the first state, None if it is not known, and ``doubtful`` a member whose energy is doubtful, or None.
    """
    suspects = [doubtful] if doubtful is not None else [] if start is None else _suspects(run, bodies, start)
    left = float(MAX_RERUN)
    for index in suspects:
        assert run.encounter is not None
        if left <= 0.0:
            break
        if run.status[index]:
            continue  # it diverged, and that finding names the pair
        if (met := run.encounter(index, left)) is not None:
            pair, there = f"bodies {met.bodies[0]} and {met.bodies[1]}{of_member(index)}", when(run, met.step, index)
            text = f"{pair} met within {there}, {met.distance:.3g} apart, which steps of {run.dt:g} do not follow"
            if run.method.splits and bodies.force == "newton":
                text = (
                    f"{pair} came to {met.distance:.3g} of each other at {there}, nearer than {HILL_RADII:g} Hill radii, and "
                    f'{run.method.name} does not follow close encounters; use "dop853" with tolerance='
                )
            return text, only(run.status.shape, index)
        left -= run.steps * float(np.prod(bodies.y_shape))
    return None


def _suspects(run: Run, bodies: NBody, start: State) -> list[tuple[int, ...]]:
    """Indices of members in which two bodies would pass each other within one step.

    The two are taken to move alone from the start, from a saved state, or backward from the end.
    """
    n, evaluations = bodies.y_shape[0], run.method.evaluations * run.steps
    numbers = numbers_of_pairs(run, bodies)
    drifts, few = run.method.splits and bodies.force == "newton", run.status.ndim == 0 and n <= FEW_BODIES
    # Checked before any array is made, as that takes longer than the rest.
    if evaluations < FEW_EVALUATIONS or (numbers > MOST_NUMBERS and (drifts or not few)):
        return []
    if not (drifts or few) and not is_long(evaluations, numbers):
        return []
    # Where time runs back, velocities are reversed.
    h, time, way = abs(run.dt), run.steps * abs(run.dt), 1.0 if run.dt > 0.0 else -1.0
    # As many states as are little work beside the run. From the last one time runs back.
    looked = min(STATES, len(run.t) - 1, evaluations // EVALUATIONS) if drifts or few else 0
    between = np.linspace(1, len(run.t) - 1, looked, endpoint=False, dtype=int).tolist() if len(run.t) > 2 else []
    states = [(way * v, y) for v, y in (start, *((run.v[i], run.y[i]) for i in between), (-run.v[-1], run.y[-1]))]
    if few and not drifts:
        floats = ([lists(block, bodies.y_shape) for block in state] for state in states)
        return [()] if any(may_meet(bodies, h, time, v, y) for v, y in floats) else []
    both = ((np.broadcast_to(v, y.shape), y) for v, y in states)
    may = [may_come_near(bodies, v, y) if drifts else may_meet_each(bodies, h, time, v, y) for v, y in both]
    return [tuple(index) for index in np.argwhere(np.logical_or.reduce(may)).tolist()]


def is_long(evaluations: int, numbers: int) -> bool:
    """True if NumPy's work on so many numbers of pairs is little beside so many evaluations of them."""
    return evaluations >= EVALUATIONS and evaluations * numbers >= 2 * PAIRS


def numbers_of_pairs(run: Run, bodies: NBody) -> int:
    """How many numbers a search among all pairs of all members works on."""
    return run.status.size * (bodies.y_shape[0] + 2 * bodies.pair_count)


def lists(block: Array, shape: Shape) -> Any:
    """A block of one member as lists; one number may have been given for all."""
    numbers = block.tolist()
    return numbers if isinstance(numbers, list) else [[numbers] * shape[1]] * shape[0]


def may_come_near(bodies: NBody, v: Array, y: Array) -> Any:
    """True if the orbits of two bodies around the first one reach places within HILL_RADII of each other.

    Truths for every member; blocks have the shape (bodies, dim, *batch). Only the least and the largest distance from the first
    body are compared, so orbits that are apart by their inclination or their resonance count, too.
    """
    (i, j), batch = planets(bodies), y.shape[2:]
    if not len(i):
        return np.zeros(batch, dtype=bool)
    masses = np.broadcast_to(aligned(bodies.masses, 1, batch), (len(y), *batch))
    with np.errstate(all="ignore"):
        d, w = y - y[0], v - v[0]
        attraction = bodies.G * (masses + masses[0])
        r2, w2, along = ((a * b).sum(axis=1) for a, b in ((d, d), (w, w), (d, w)))
        parameter = (r2 * w2 - along * along) / attraction  # p of the ellipse
        e = np.sqrt(np.maximum(0.0, 1.0 + parameter * (w2 - 2.0 * attraction / np.sqrt(r2)) / attraction))
        least, most = parameter / (1.0 + e), np.where(e < 1.0, parameter / (1.0 - e), np.inf)
        inner, outer = np.minimum(most[i], most[j]), np.maximum(least[i], least[j])
        radius = hill(masses, i, j) * np.where(np.isfinite(inner), 0.5 * (inner + outer), outer)
        return (outer - inner < HILL_RADII * radius).any(axis=0)


def may_meet(bodies: NBody, h: float, time: float, v: Any, y: Any) -> bool:
    """True if two bodies of one state, left to each other, would pass each other within a step; all in lists of floats.

    A pair with relative angular momentum L has the speed L/r at its nearest point, and turns there by a right angle in a step if
    h·L/(2r) = √(r² + ε²). It comes nearer than this r if its energy suffices.
    """
    masses, gravity, soft2 = bodies.masses.tolist(), float(bodies.G), float(bodies.softening) ** 2
    newton = bodies.force == "newton"

    def potential(strength: float, r2: float) -> float:
        if r2 == 0.0:
            return -math.inf
        return -strength / math.sqrt(r2) if newton else 0.5 * strength * math.log(r2)

    for i, (place, velocity) in enumerate(zip(y, v, strict=True)):
        for j in range(i):
            strength = gravity * (masses[i] + masses[j])
            if strength == 0.0:
                continue
            d = [a - b for a, b in zip(place, y[j], strict=True)]
            w = [a - b for a, b in zip(velocity, v[j], strict=True)]
            r2, w2 = sum(a * a for a in d), sum(a * a for a in w)
            along = sum(a * b for a, b in zip(d, w, strict=True))
            spin2 = max(0.0, r2 * w2 - along * along)
            near2 = 0.5 * (math.sqrt(soft2 * soft2 + h * h * spin2) - soft2)
            if r2 <= near2:
                return True
            energy = 0.5 * w2 + potential(strength, r2 + soft2)
            if along > 0.0 and newton and energy >= 0.0:
                continue  # they part for ever
            at_near = potential(strength, near2 + soft2)
            if not energy > at_near + 2.0 * (near2 + soft2) / (h * h):
                continue
            # It is at most as fast as half way in, so it takes at least this time to come there.
            middle = potential(strength, 0.25 * r2 + soft2)
            if math.sqrt(r2) > 2.0 * time * math.sqrt(max(0.0, 2.0 * (energy - middle))):
                continue
            others = [k for k in range(len(y)) if k not in (i, j)]
            pulls = ([_pull(gravity, masses, y, k, body, soft2, newton) for body in (i, j)] for k in others)
            apart = [sum(axis) for axis in zip(*([a - b for a, b in zip(*pull, strict=True)] for pull in pulls), strict=True)]
            if math.hypot(*apart) <= math.sqrt(r2) * strength / _spread(r2 + soft2, newton):
                return True
    return False


def _spread(square: Any, newton: bool) -> Any:
    """The divisor of the distance vector in the attraction by a unit of mass: r³ by Newton's law, or r²."""
    return square * np.sqrt(square) if newton else square


def _pull(gravity: float, masses: Any, y: Any, k: int, i: int, soft2: float, newton: bool) -> list[float]:
    """The acceleration of body i by body k, in floats."""
    d = [a - b for a, b in zip(y[k], y[i], strict=True)]
    square = sum(a * a for a in d) + soft2
    return [gravity * masses[k] * a / float(_spread(square, newton)) if square > 0.0 else math.inf for a in d]


def may_meet_each(bodies: NBody, h: float, time: float, v: Array, y: Array) -> Any:
    """``may_meet`` for every member of a batch, as an array of truths; blocks have the shape (bodies, dim, *batch)."""
    newton = bodies.force == "newton"
    i, j = bodies.pairs()

    def potential(r2: Array) -> Array:
        return np.asarray(-strength / np.sqrt(r2) if newton else 0.5 * strength * np.log(r2))

    batch = y.shape[2:]
    masses = aligned(bodies.masses, 1, batch)
    with np.errstate(all="ignore"):
        strength = bodies.G * (masses[i] + masses[j])
        soft2 = bodies.softening * bodies.softening
        d, w = y[i] - y[j], v[i] - v[j]
        r2, w2, along = ((a * b).sum(axis=1) for a, b in ((d, d), (w, w), (d, w)))
        spin2 = np.maximum(0.0, r2 * w2 - along * along)
        near2 = 0.5 * (np.sqrt(soft2 * soft2 + h * h * spin2) - soft2)
        energy = 0.5 * w2 + potential(r2 + soft2)
        parts = (along > 0.0) & (energy >= 0.0) & newton
        reaches = energy > potential(near2 + soft2) + 2.0 * (near2 + soft2) / (h * h)
        middle = energy - potential(0.25 * r2 + soft2)
        in_time = np.sqrt(r2) <= 2.0 * time * np.sqrt(np.maximum(0.0, 2.0 * middle))
        attract = strength > 0.0
        near, may = attract & (r2 <= near2), attract & ~parts & reaches & in_time
        # The pull of the others takes longest to compute, and few pairs need it.
        far = np.flatnonzero(may.reshape(len(i), -1).any(axis=1))
        i, j, by_others = i[far], j[far], np.zeros_like(d[far])
        for k in bodies.massive if far.size else ():
            to_j, to_i = y[k] - y[j], y[k] - y[i]  # pairs, coordinates, batch
            for toward, sign in ((to_i, 1.0), (to_j, -1.0)):
                square = (toward * toward).sum(axis=1, keepdims=True) + soft2
                pull = (bodies.G * masses[k]) * toward / _spread(square, newton)
                by_others += sign * np.where((k != i) & (k != j), pull.T, 0.0).T
        attraction = np.broadcast_to(np.sqrt(r2) * strength / _spread(r2 + soft2, newton), r2.shape)[far]
        may[far] &= np.sqrt((by_others * by_others).sum(axis=1)) <= attraction
    return (near | may).any(axis=0)
