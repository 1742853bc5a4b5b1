"""Contact of points that are joined by rods: impulses of surfaces and pulls of rods are found together.

An impulse at one end of a rod acts on the other end at the same instant. With J the gradients of the rods' lengths, an impulse p
changes the velocities by P·M⁻¹·p, where P·M⁻¹ = M⁻¹ − M⁻¹Jᵀ(J·M⁻¹·Jᵀ)⁻¹J·M⁻¹: no velocity along a rod results. What a unit
impulse along the normal of a contact does is the ``column`` of that contact, and normal·column is 1/m of the point as the surface
feels it, its effective mass m being at least that of the point alone.

After a step of the method each point is treated as if it were free (contact.py): how fast it hit, how long ago, whether it
rests. Then for the points of each connected group of rods:

1. Impulses λ ≥ 0 along the normals, so that each point leaves with at least the velocity of its bounce: one contact after the
   other in a fixed order, ``SWEEPS`` times (projected Gauss-Seidel). Friction in the tangent plane, |p| ≤ μ·λ, is found with
   them.
2. The points move as if each impulse had acted since the impact; where a point rests, during all of the step. Then, in
   ``ROUNDS``, they are put where their bounces end, and the rods are given the lengths that they had after the step.
3. Velocities along the rods in their new directions are removed, and those into the surfaces.
4. Energy: if it is above that before the step, and above that after the step without contact, velocities are reduced.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from . import bits
from .contact import ROUNDING, Change, Place, Step, Surface, Vector, dot, magnitudes
from .elimination import Factors, factored, solved
from .joined import Column, Joined, added, groups

#: Points that surfaces have changed together are visited so many times. Two contacts with effective masses m and a coupling ρ/m
#: leave ρ^(2·SWEEPS) of an error: 10⁻¹⁷ for an equilateral triangle that stands on two of its points, where ρ is 1/7.
SWEEPS = 10

#: Rounds in which points are put on surfaces, and rods are given their lengths, and the visits of a round. Of an error a round
#: leaves a share of about what a point was moved, over the length of a rod.
ROUNDS, VISITS = 3, 3

#: Below this share of 1/m of the point alone, 1/m at a contact is rounding: rods hold the point in that direction.
HELD = 2.0**-40

#: Up to so many times the exactness of its distance, a point that begins behind a surface is lifted onto it: rounding, added up.
SHALLOW = 2.0**20

#: Of rods that had so much of the square of their speeds left by contact, only rounding is left: they rest.
REST = 2.0**-90


class Contact(NamedTuple):
    """A point and a surface, where it met it, and what an impulse there does.

    Attributes:
        point: its number.
        surface: which it met.
        place: where it is to the surface after the step.
        change: what the surface would make of a free point.
        touches: whether it hit or rests.
        aim: the velocity along the normal that it leaves with at least.
        low: the distance below which it is not left.
        column: velocities of the points by a unit impulse along the normal; None for points that do not feel it.
        give: the velocity of the point itself along the normal by that impulse, infinite where there is no contact.
        yields: the same, infinite only where rods hold the point.
        tangents: directions along the surface, with friction.
        slides: the columns of these.
        grip: the factors of what these do to each other.
    """

    point: int
    surface: Surface
    place: Place
    change: Change
    touches: Any
    aim: Any
    low: Any
    column: Column
    give: Any
    yields: Any
    tangents: list[Vector]
    slides: list[Column]
    grip: Factors | None


def tangents(n: Vector) -> list[Vector]:
    """Unit vectors at right angles to a unit vector and to each other (Duff et al. 2017)."""
    if len(n) == 2:
        return [[-n[1], n[0]]]
    sign = bits.where(bits.less(n[2], 0.0), -1.0, 1.0)
    a = -1.0 / (sign + n[2])
    b = (n[0] * n[1]) * a
    return [[1.0 + (sign * (n[0] * n[0])) * a, sign * b, -(sign * n[0])], [b, sign + (n[1] * n[1]) * a, -n[1]]]


def total(masses: Any, points: list[int], of: list[Any]) -> Any:
    """The sum of m·x over points."""
    whole = None
    for i in points:
        each = masses[i] * of[i]
        whole = each if whole is None else whole + each
    return whole


class RodContacts:
    """The surfaces that the points of rods meet, of blocks with so many axes."""

    def __init__(self, h: Any, rods: Any, axes: int, met: list[Surface]) -> None:
        self.h = h
        self.axes = axes
        self.rods = rods
        self.met = met
        self.groups = groups(rods.rods, len(rods.masses))

    def resolve(self, before: Any, after: Any) -> tuple[Any, Any]:
        """The state after contact, from the states before and after a step of the method."""
        n, dim = len(self.rods.masses), self.rods.dim
        flat = [block.reshape(n * dim, *block.shape[self.axes :]) for block in (*before, *after)]
        v0, y0, v1, y1 = ([[block[i * dim + c] for c in range(dim)] for i in range(n)] for block in flat)
        with np.errstate(all="ignore"):  # what is divided by zero is not chosen
            joined = Joined(self.rods, y1)
            contacts = self.contacts(joined, joined.factors(), (v0, y0), (v1, y1))
            v, impulses, shears, sticks = self.struck(contacts, v1)
            y = self.moved(contacts, impulses, shears, sticks, (v0, y0), (v1, y1))
            y, turned = self.placed(contacts, impulses, joined.squares(), y)
            v = self.consistent(contacts, impulses, turned, v)
            for points in self.groups:
                self.limit(points, contacts, (v0, y0), (v1, y1), (v, y))
        pairs = ((np.stack([x for each in block for x in each]), old) for block, old in zip((v, y), after, strict=True))
        new_v, new_y = (new.reshape(*old.shape[: self.axes], *new.shape[1:]) for new, old in pairs)
        return new_v, new_y

    def contacts(self, joined: Joined, factors: Factors, before: Any, after: Any) -> list[Contact]:
        """Each point with each surface."""
        (v0, y0), (v1, y1) = before, after
        contacts, n, inverse = [], len(y0), self.rods.inverse
        for i in range(n):
            kick = [b - a for a, b in zip(v0[i], v1[i], strict=True)]
            lag = [(y1[i][c] - y0[i][c]) / self.h - 0.5 * (v0[i][c] + v1[i][c]) for c in range(len(kick))]
            step = Step(v0[i], y0[i], v1[i], y1[i], kick, lag)
            for surface in self.met:
                place = self.place(surface, i, y0[i], y1[i])
                speed = dot(v1[i], place.normal)
                touches, change = surface.bounce(step, place, speed)
                aim = bits.where(touches, change.speed, bits.where(bits.less(speed, 0.0), speed, 0.0))
                low = bits.where(bits.less(place.before + SHALLOW * place.slack, 0.0), place.before, 0.0)
                column = joined.column(factors, n, i, place.normal)
                weight = dot(place.normal, column[i])
                yields = bits.where(bits.less(HELD * inverse[i], weight), weight, np.inf)
                give = bits.where(place.near, yields, np.inf)
                along, slides, grip = [], [], None
                if surface.friction is not None:
                    along = tangents(place.normal)
                    slides = [joined.column(factors, n, i, each) for each in along]
                    rows = [[dot(along[r], slides[c][i]) for c in range(r + 1)] for r in range(len(along))]
                    for row in rows:
                        row[-1] = row[-1] + HELD * inverse[i]
                    grip = factored(rows)
                contacts.append(Contact(i, surface, place, change, touches, aim, low, column, give, yields, along, slides, grip))
        return contacts

    def place(self, surface: Surface, i: int, y0: Vector, y1: Vector) -> Place:
        """Where a point is to a surface, with distances as exact as those of points that rods have moved."""
        place, size = surface.place(y0, y1), magnitudes(y1, [1.0] * len(y1))
        for ends, length in zip(self.rods.rods, self.rods.lengths, strict=True):
            if i in ends:
                size = size + length
        slack = place.slack + ROUNDING.of(y1[0]) * size
        return place._replace(slack=slack, near=place.near | bits.at_most(place.distance, slack))

    def struck(self, contacts: list[Contact], v: list[Vector]) -> tuple[list[Vector], list[Any], list[Any], list[Any]]:
        """The velocities after all impulses; these along the normals and the tangents; and which of the latter stick."""
        impulses: list[Any] = [0.0] * len(contacts)
        shears: list[Any] = [[0.0] * len(each.tangents) for each in contacts]
        sticks: list[Any] = [None] * len(contacts)
        for _ in range(SWEEPS):
            for k, each in enumerate(contacts):
                v, impulses[k] = self.visit(each, impulses[k], v)
                if each.grip is None:
                    continue
                slip = [-dot(along, v[each.point]) for along in each.tangents]
                wanted = [p + x for p, x in zip(shears[k], solved(each.grip, slip), strict=True)]
                size, most = np.sqrt(dot(wanted, wanted)), each.surface.friction * impulses[k]
                sticks[k] = bits.at_most(size, most)
                share = bits.where(sticks[k], 1.0, most / size)
                for r, slide in enumerate(each.slides):
                    p = share * wanted[r]
                    v = added(v, slide, p - shears[k][r])
                    shears[k][r] = p
        return v, impulses, shears, sticks

    def visit(self, each: Contact, impulse: Any, v: list[Vector]) -> tuple[list[Vector], Any]:
        """An impulse along the normal is corrected, but not to one that pulls."""
        more = (each.aim - dot(each.place.normal, v[each.point])) / each.give
        more = bits.where(bits.less(impulse + more, 0.0), -impulse, more)
        return added(v, each.column, more), impulse + more

    def moved(
        self, contacts: list[Contact], impulses: list[Any], shears: list[Any], sticks: list[Any], before: Any, after: Any
    ) -> list[Vector]:
        """Where the points are if each impulse acted since the impact, or where they rest during all of the step.

        Points that stick do not move by the lag of a method.
        """
        (v0, y0), (v1, y1) = before, after
        y: list[Vector] = list(y1)
        half = 0.5 * self.h
        for points in self.groups:
            at_rest = None
            for each, stuck in zip(contacts, sticks, strict=True):
                if stuck is not None and each.point in points:
                    stays = each.touches & each.change.rests & stuck
                    at_rest = stays if at_rest is None else at_rest | stays
            if at_rest is not None:
                for i in points:
                    y[i] = [
                        bits.where(at_rest, at + half * (a + b), to)
                        for at, a, b, to in zip(y0[i], v0[i], v1[i], y[i], strict=True)
                    ]
        for k, each in enumerate(contacts):
            since = bits.where(each.touches, bits.where(each.change.rests, half, each.change.since), 0.0)
            y = added(y, each.column, since * impulses[k])
            for slide, shear in zip(each.slides, shears[k], strict=True):
                y = added(y, slide, since * shear)
        return y

    def placed(
        self, contacts: list[Contact], impulses: list[Any], squares: list[Any], y: list[Vector]
    ) -> tuple[list[Vector], Joined]:
        """Points put where their bounces end, and not behind any surface, with rods of these lengths."""
        goals, pushes, least = [], [], []
        for each, impulse in zip(contacts, impulses, strict=True):
            rests = each.touches & each.change.rests
            goals.append(bits.where(each.touches & bits.less(each.low, each.change.distance), each.change.distance, each.low))
            least.append(bits.where(rests & bits.less(0.0, impulse), -np.inf, 0.0))
            pushes.append(0.0)
        for _ in range(ROUNDS):
            for _ in range(VISITS):
                for k, each in enumerate(contacts):
                    more = (goals[k] - each.surface.depth_of(y[each.point])) / each.yields
                    more = bits.where(bits.less(pushes[k] + more, least[k]), -pushes[k], more)
                    y, pushes[k] = added(y, each.column, more), pushes[k] + more
            joined = Joined(self.rods, y)
            off = [0.5 * (now - square) for now, square in zip(joined.squares(), squares, strict=True)]
            y = joined.corrected(joined.factors(), y, off)
        return y, Joined(self.rods, y)

    def consistent(self, contacts: list[Contact], impulses: list[Any], joined: Joined, v: list[Vector]) -> list[Vector]:
        """Velocities with none along the rods, and with none into the surfaces on which points rest.

        A point that bounced turns with its rods since the impact, by which its velocity along the normal changes.
        """
        factors = joined.factors()
        bounced = [bits.where(each.touches, bits.where(each.change.rests, each.give, np.inf), each.give) for each in contacts]
        contacts = [each._replace(give=give) for each, give in zip(contacts, bounced, strict=True)]
        for _ in range(ROUNDS - 1):
            v = joined.corrected(factors, v, joined.closing(v))
            for _ in range(VISITS):
                for k, each in enumerate(contacts):
                    v, impulses[k] = self.visit(each, impulses[k], v)
        return joined.corrected(factors, v, joined.closing(v))

    def limit(self, points: list[int], contacts: list[Contact], before: Any, after: Any, state: Any) -> None:
        """No more energy of joined points than before the step, or after it without contact.

        What they have beyond is taken from their velocities. Where even at rest they would have more, they stay where they were.
        """
        masses, (v, y) = self.rods.masses, state
        fall = self.rods.gravity + self.rods.gravity
        touched = None
        for each in contacts:
            if each.point in points:
                touched = each.touches if touched is None else touched | each.touches

        def kinetic(v_from: list[Vector]) -> Any:
            return total(masses, points, [dot(each, each) for each in v_from])

        def potential(y_from: list[Vector]) -> Any:
            return fall * total(masses, points, [each[-1] for each in y_from])

        begun, high, square = kinetic(before[0]), potential(y), kinetic(v)
        raw = kinetic(after[0])
        most, free = begun + (potential(before[1]) - high), raw + (potential(after[1]) - high)
        most = bits.where(bits.less(most, free), free, most)
        rests = bits.at_most(square, REST * raw)
        stays = (bits.at_most(most, 0.0) | (rests & bits.at_most(begun, 0.0))) & bits.less(square, np.inf)
        factor = bits.where(bits.less(most, square), np.sqrt(most / square), 1.0)
        for i in points:
            slowed = [bits.where(stays | rests, 0.0, factor * each) for each in v[i]]
            placed = [bits.where(stays, at, each) for at, each in zip(before[1][i], y[i], strict=True)]
            v[i] = [bits.where(touched, new, old) for new, old in zip(slowed, after[0][i], strict=True)]
            y[i] = [bits.where(touched, new, old) for new, old in zip(placed, after[1][i], strict=True)]
