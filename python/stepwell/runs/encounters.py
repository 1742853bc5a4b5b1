"""Bodies that meet within one step, which no method can follow: whether a run may contain such a step, and where it does.

In such a step the line from one body to the other turns by more than a right angle, or they move past each other by more than
twice the distance at which they begin or end. The search repeats the run with all of its states. So it is made on request
(``Run.encounters``), and otherwise only if two bodies alone would meet so from a saved state, and the others pull them apart or
together by less than the two pull each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..model.parameters import aligned
from ..model.systems import NBody
from . import engine

#: Encounters that turn a pair by less than this, in radians, do not count.
WEAK = 0.01

#: Planets nearer to each other than so many of their Hill radii move each other about as much as their orbits allow: a method
#: that kicks them once a step off Kepler's orbits does not follow that, and Mercurius and TRACE change their method about there
#: (Rein et al. 2019; Lu, Hernandez, Rein 2024). Steps in which they move by less than this share of their distance, some sixty
#: for a turn around each other, follow it nevertheless.
HILL_RADII, FOLLOWED = 3.0, 0.1

#: A warning names the bodies that collided or passed each other if repeating the member's run takes at most this many steps ×
#: numbers, which is a moment. Otherwise ``Run.collisions`` and ``Run.encounters`` find them.
MAX_RERUN = 10_000_000

#: States that are searched together have this many numbers, some megabytes.
NUMBERS_AT_ONCE = 1 << 18


class Collision(NamedTuple):
    """Two bodies that were nearest to each other when a member left the finite range.

    Attributes:
        member: index of the member in the batch.
        step: number of the first step that was not finite.
        bodies: the two.
        distance: between them, one step before.
    """

    member: tuple[int, ...]
    step: int
    bodies: tuple[int, int]
    distance: float


class Encounter(NamedTuple):
    """Two bodies that met within one step.

    Attributes:
        member: index of the member in the batch.
        step: number of the state after that step.
        bodies: the two.
        distance: the least between them on straight lines from the state before the step to the one after it, in units of length.
    """

    member: tuple[int, ...]
    step: int
    bodies: tuple[int, int]
    distance: float


def met_in(bodies: NBody, y: Array, h: float) -> tuple[int, tuple[int, int], float] | None:
    """The first step in which two bodies of one member met.

    Softened bodies pass each other as if they were ε apart in a further dimension.

    Args:
        bodies: of one member.
        y: coordinates before the first step and after each, shape (states, bodies, dim).
        h: the step.

    Returns:
        The number of the step, from 1 on, the two, and their least distance; or None.
    """
    first, second = bodies.pairs()
    attraction = (bodies.G * (bodies.masses[first] + bodies.masses[second]))[np.newaxis]
    with np.errstate(all="ignore"):
        d = y[:, second] - y[:, first]
        before, after = d[:-1], d[1:]
        moved = after - before
        way2 = (moved * moved).sum(axis=-1)
        soft2 = bodies.softening**2
        turned = (before * after).sum(axis=-1) + soft2 < 0.0
        distances2 = (d * d).sum(axis=-1) + soft2
        turned |= way2 > 4.0 * np.minimum(distances2[:-1], distances2[1:])
        if not turned.any():
            return None
        share = np.clip(-(before * moved).sum(axis=-1) / way2, 0.0, 1.0)
        nearest = before + moved * share[..., np.newaxis]
        q2 = (nearest * nearest).sum(axis=-1)
        # A step too near may fling them apart, so the speed is that of the step before.
        came2 = way2.copy()
        came2[1:] = np.where(way2[:-1] > 0.0, np.minimum(way2[1:], way2[:-1]), way2[1:])
        speed2 = came2 / (h * h)
        # The tangent of half the angle by which the pair should turn there.
        should = attraction / speed2 / (np.sqrt(q2 + soft2) if bodies.force == "newton" else 1.0)
        met = np.argwhere(turned & (should > WEAK / 2.0))
    if not len(met):
        return None
    step, pair = met[0].tolist()
    return step + 1, (int(first[pair]), int(second[pair])), float(math.sqrt(q2[step, pair]))


def near_in(bodies: NBody, y: Array, h: float) -> tuple[int, tuple[int, int], float] | None:
    """The first step in which two bodies of one member, neither of which is the first, came within HILL_RADII of each other.

    Steps that are short beside the encounter do not count.

    Args and result as of ``met_in``.
    """
    planets = [pair for pair in zip(*bodies.pairs(), strict=True) if 0 not in pair]
    if not planets:
        return None
    first, second = np.array(planets).T
    with np.errstate(all="ignore"):
        d = y[:, second] - y[:, first]
        before, moved = d[:-1], d[1:] - d[:-1]
        share = np.clip(-(before * moved).sum(axis=-1) / (moved * moved).sum(axis=-1), 0.0, 1.0)
        nearest = before + np.nan_to_num(share)[..., np.newaxis] * moved
        distance = np.sqrt((nearest * nearest).sum(axis=-1))
        way = np.sqrt((moved * moved).sum(axis=-1))
        place = np.sqrt(((y[1:, 1:] - y[1:, :1]) ** 2).sum(axis=-1))
        size = 0.5 * (place[:, first - 1] + place[:, second - 1])
        passes = way > FOLLOWED * distance
        near = np.argwhere(passes & (distance < HILL_RADII * size * _hill(bodies.masses, first, second)))
    if not len(near):
        return None
    step, pair = near[0].tolist()
    return step + 1, (int(first[pair]), int(second[pair])), float(distance[step, pair])


def _hill(masses: Array, i: Any, j: Any) -> Any:
    """The Hill radius of two bodies that move around the first one, by their distance from it."""
    return np.cbrt((masses[i] + masses[j]) / (3.0 * masses[0]))


def may_come_near(bodies: NBody, v: Array, y: Array) -> Any:
    """True if the orbits of two bodies around the first one reach places within HILL_RADII of each other.

    Truths for every member; blocks have the shape (bodies, dim, *batch). Only the least and the largest distance from the first
    body are compared, so orbits that are apart by their inclination or their resonance count, too.
    """
    planets = [pair for pair in zip(*bodies.pairs(), strict=True) if 0 not in pair]
    batch = y.shape[2:]
    if not planets:
        return np.zeros(batch, dtype=bool)
    i, j = np.array(planets).T
    masses = np.broadcast_to(aligned(bodies.masses, 1, batch), (len(y), *batch))
    with np.errstate(all="ignore"):
        d, w = y - y[0], v - v[0]
        attraction = bodies.G * (masses + masses[0])
        r2, w2, along = ((a * b).sum(axis=1) for a, b in ((d, d), (w, w), (d, w)))
        parameter = (r2 * w2 - along * along) / attraction  # p of the ellipse
        e = np.sqrt(np.maximum(0.0, 1.0 + parameter * (w2 - 2.0 * attraction / np.sqrt(r2)) / attraction))
        least, most = parameter / (1.0 + e), np.where(e < 1.0, parameter / (1.0 - e), np.inf)
        inner, outer = np.minimum(most[i], most[j]), np.maximum(least[i], least[j])
        hill = _hill(masses, i, j) * np.where(np.isfinite(inner), 0.5 * (inner + outer), outer)
        return (outer - inner < HILL_RADII * hill).any(axis=0)


def pieces(plan: engine.Plan, bodies: NBody, v: Array, y: Array, carried: bool, steps: int) -> Iterator[tuple[int, Array, Array]]:
    """All states of a run of one member, made again some at once: the number of earlier steps, velocities and coordinates."""
    length = max(16, NUMBERS_AT_ONCE // (y.size + 2 * bodies.pair_count * y.shape[1]))
    done = 0
    while done < steps:
        number = min(length, steps - done)
        again = plan._replace(
            system=bodies, batch=(), first=plan.first + done, steps=number, every=1, form="direct", progress=None, record=()
        )
        out = engine.advance(again, v, y, carried=carried)
        yield done, out.v, out.y
        # What the method carries is in the slot; where it carries v, that is the last v.
        v, y, carried, done = out.slot, out.y[-1], True, done + number


def of_member(
    plan: engine.Plan, v: Array, y: Array, carried: bool, steps: int, index: tuple[int, ...], bound: float = math.inf
) -> Encounter | None:
    """The first encounter of one member within ``steps``, searched for at most ``bound`` steps × numbers.

    For a method that moves bodies along Kepler's orbits it is the first approach to HILL_RADII.
    """
    assert isinstance(plan.system, NBody)
    search = near_in if plan.method.splits and plan.system.force == "newton" else met_in
    bodies = plan.system.member(index, plan.batch)
    v, y = checks.member(v, index), checks.member(y, index)
    begin = y
    for done, _, states in pieces(plan, bodies, v, y, carried, steps):
        # Each step is searched with the one before it.
        if (met := search(bodies, np.concatenate([begin[np.newaxis], states]), plan.dt)) is not None:
            step, pair, distance = met
            return Encounter(index, plan.first + done + step - 1, pair, distance)
        begin = states[-2]
        if (done + len(states)) * y.size > bound:
            break
    return None


def overshoots(
    plan: engine.Plan, v: Array, y: Array, carried: bool, steps: int, index: tuple[int, ...], bound: float = math.inf
) -> tuple[int, float] | None:
    """The first step before which h·C·K of a member under a control was 1 or more, and that number; None if there is none."""
    assert isinstance(plan.system, NBody)
    bodies = plan.system.member(index, plan.batch)
    assert bodies.control is not None
    gain = float(getattr(bodies.control, "gain", 0.0))
    v, y = checks.member(v, index), checks.member(y, index)
    for done, velocities, _ in pieces(plan, bodies, v, y, carried, steps):
        with np.errstate(all="ignore"):
            strength = plan.dt * gain * bodies.kinetic(np.moveaxis(velocities, 0, -1))
        if (wrong := np.flatnonzero(strength >= 1.0)).size:
            return plan.first + done + int(wrong[0]), float(strength[wrong[0]])
        if (done + len(velocities)) * y.size > bound:
            break
    return None


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


def collision(plan: engine.Plan, v: Array, y: Array, carried: bool, index: tuple[int, ...], step: int) -> Collision:
    """The two nearest bodies in the last finite state; the member is run again alone up to there."""
    system, steps = plan.system, step - 1 - plan.first
    assert isinstance(system, NBody)
    alone, y = system.member(index, plan.batch), checks.member(y, index)
    if steps > 0:
        force = None if plan.force is None else checks.member(plan.force, index)
        again = plan._replace(system=alone, batch=(), steps=steps, every=None, progress=None, record=(), force=force)
        y = engine.advance(again, checks.member(v, index), y, carried=carried).y[-1]
    bodies, distance = alone.closest(y)
    return Collision(index, step, bodies, distance)
