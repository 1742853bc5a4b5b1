"""Bodies that meet within one step, which no method can follow: whether a run may contain such a step, and where it does.

In such a step the line from one body to the other turns by more than a right angle, or they move past each other by more than
twice the distance at which they begin or end. The search repeats the run with all of its states. So it is made on request
(``Run.encounters``), or if two bodies may have met so (``findings/encounters.py``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array, Whole
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
    first, second = planets(bodies)
    if not len(first):
        return None
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
        near = np.argwhere(passes & (distance < HILL_RADII * size * hill(bodies.masses, first, second)))
    if not len(near):
        return None
    step, pair = near[0].tolist()
    return step + 1, (int(first[pair]), int(second[pair])), float(distance[step, pair])


def planets(bodies: NBody) -> tuple[Whole, Whole]:
    """The pairs of bodies, neither of which is the first."""
    first, second = bodies.pairs()
    return first[first * second > 0], second[first * second > 0]


def hill(masses: Array, i: Any, j: Any) -> Any:
    """The Hill radius of two bodies that move around the first one, by their distance from it."""
    return np.cbrt((masses[i] + masses[j]) / (3.0 * masses[0]))


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
