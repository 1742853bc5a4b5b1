"""Contact of points with planes and spheres: a one-sided spring, or what happens to a point after the step that met one.

Vectors are lists of their components, each an array over the points (and the batch). Only the way "safe" needs more than the
state after the step. It sees what the step did to v and y, whatever the method: the mean acceleration, (v₁ − v₀)/h, and the lag
(y₁ − y₀)/h − ½(v₀ + v₁). In a uniform field the lag is 0, or half an increment of v for the methods of the Euler family.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np

from . import bits
from .around import Around, whole_step
from .signal import of_step, over

#: A distance is known to within so many times the numbers that it is computed from: eight roundings.
ROUNDING = bits.PerPrecision(double=2.0**-50, single=2.0**-21)

#: The bits of a number but for its sign.
MAGNITUDE = 0x7FFF_FFFF_FFFF_FFFF

Vector = list[Any]


def dot(a: Any, b: Any) -> Any:
    """a·b, from the first component on."""
    whole = a[0] * b[0]
    for i in range(1, len(a)):
        whole = whole + a[i] * b[i]
    return whole


def magnitudes(a: Any, b: Any) -> Any:
    """The sum of |aᵢ·bᵢ|."""
    whole = bits.and_bits(a[0] * b[0], MAGNITUDE)
    for i in range(1, len(a)):
        whole = whole + bits.and_bits(a[i] * b[i], MAGNITUDE)
    return whole


class Step(NamedTuple):
    """The effect of a step of the method on points: the states before and after, the increment of v, and the lag."""

    v0: Vector
    y0: Vector
    v1: Vector
    y1: Vector
    kick: Vector
    lag: Vector


class Place(NamedTuple):
    """Where a point is to a surface after the step.

    Attributes:
        near: whether it reached the surface.
        normal: out of the surface, at the point.
        distance: from the plane that touches the surface there; negative behind it.
        before: the distance at the start of the step.
        slack: how exact these distances are.
    """

    near: Any
    normal: Vector
    distance: Any
    before: Any
    slack: Any


class Change(NamedTuple):
    """The state of a point after contact.

    Attributes:
        speed: the velocity along the normal.
        distance: from the surface.
        rests: whether it rests; None if the way knows no rest.
        low: at which distance it rests.
        since: the time from the impact to the end of the step.
    """

    speed: Any
    distance: Any
    rests: Any | None
    low: Any
    since: Any


class Surface(ABC):
    """The base of planes and spheres; ``friction`` None means that there is none."""

    is_curved = False

    def __init__(self, h: Any, way: str, restitution: Any, friction: Any, omega: Any) -> None:
        self.h = h
        self.way = way
        self.restitution = restitution
        self.friction = friction
        self.stiffness = None if omega is None else h * (omega * omega)

    @abstractmethod
    def place(self, y0: Vector, y: Vector) -> Place:
        """Where points are that began the step at ``y0``."""

    @abstractmethod
    def push(self, y: Vector) -> Vector:
        """The part of an increment of v that a one-sided spring takes away."""

    @abstractmethod
    def depth_of(self, y: Vector) -> Any:
        """The distance of a point from the surface itself."""

    def back(self, y: Vector, distance: Any) -> Vector:
        """A point on the touching plane, put at that distance from the surface itself."""
        return y

    def meet(self, step: Step, v: Vector, y: Vector) -> tuple[Any, Vector, Vector]:
        """Which points meet the surface, and all of them after that."""
        place = self.place(step.y0, y)
        normal, speed = place.normal, dot(v, place.normal)
        if self.way == "safe":
            touches, change = self.bounce(step, place, speed)
        else:
            leaving = -speed if self.restitution is None else -(self.restitution * speed)
            touches = bits.less(place.distance, 0.0) & bits.less(speed, 0.0)
            change = Change(leaving, place.distance, None, None, None)
        turn, lift = change.speed - speed, change.distance - place.distance
        if self.friction is None:
            new_v = [v + turn * n for v, n in zip(v, normal, strict=True)]
            new_y = [y + lift * n for y, n in zip(y, normal, strict=True)]
        else:
            new_v, new_y = self.rub(step, v, y, (speed, turn, lift), normal, change)
        if change.rests is not None:
            resting = self.back(new_y, change.low)
            new_y = [bits.where(change.rests, rest, y) for rest, y in zip(resting, new_y, strict=True)]
        v = [bits.where(touches, new, old) for new, old in zip(new_v, v, strict=True)]
        y = [bits.where(touches, new, old) for new, old in zip(new_y, y, strict=True)]
        return touches, v, y

    def bounce(self, step: Step, place: Place, speed: Any) -> tuple[Any, Change]:
        """A point leaves with e² of the energy of impact, or rests if the flight would be shorter than two steps.

        ``w`` is the velocity that belongs to the same time as y. In a uniform field w² + 2G·d is constant for every method, and
        so is (e·u − G·τ)² + 2G·τ(e·u − ½G·τ) for every time τ since the bounce.
        """
        push, late = -dot(step.kick, place.normal), dot(step.lag, place.normal)
        size = bits.and_bits(push, MAGNITUDE)
        quarter = 0.25 * size
        ahead = bits.where(bits.less(quarter, late), 0.5 * size, 0.0)
        gains = bits.less(push, 0.0) & bits.less(quarter, -late)
        w = speed + ahead
        touches = place.near & bits.less(w, 0.0)
        pull = push / self.h
        square = (w * w + (pull + pull) * place.distance) - bits.where(gains, push * push, 0.0)
        impact = np.sqrt(bits.where(bits.less(0.0, square), square, 0.0))
        leaving = self.restitution * impact
        rests = bits.at_most(leaving, push) | bits.at_most(square, 0.0)
        since = (-(place.distance + place.distance)) / (impact - w)
        since = bits.where(bits.less(since, 0.0), 0.0, since)
        since = bits.where(bits.less(self.h, since), self.h, since)
        low = bits.where(bits.less(place.before + place.slack, 0.0) | bits.less(push, 0.0), place.before, 0.0)
        height = since * (leaving - (0.5 * pull) * since)
        rising = (leaving - pull * since) - ahead
        return touches, Change(bits.where(rests, 0.0, rising), bits.where(rests, low, height), rests, low, since)

    def rub(self, step: Step, v: Vector, y: Vector, along: Any, normal: Vector, change: Change) -> tuple[Vector, Vector]:
        """Coulomb's friction: the tangential velocity loses μ times what the normal one gains.

        A point that rests is slowed during the whole step, so it slides by the mean velocity, and one that sticks stays.
        """
        speed, turn, lift = along
        slide = [v - speed * n for v, n in zip(v, normal, strict=True)]
        fast, grip = np.sqrt(dot(slide, slide)), self.friction * turn
        sticks = bits.at_most(fast, grip)
        remaining = bits.where(sticks, 0.0, 1.0 - grip / fast)
        new_v = [remaining * s + change.speed * n for s, n in zip(slide, normal, strict=True)]
        new_y = [y + lift * n for y, n in zip(y, normal, strict=True)]
        if change.rests is None:
            return new_v, new_y
        half = 0.5 * self.h
        share = half * bits.where(bits.less(0.0, fast), fast / grip, 0.0)
        way = [(y0 - y) + share * v0 for y0, y, v0 in zip(step.y0, y, step.v0, strict=True)]
        through, less = dot(way, normal), half * (1.0 - remaining)
        for i, n in enumerate(normal):
            shift = bits.where(sticks, way[i] - through * n, -(less * slide[i]))
            new_y[i] = bits.where(change.rests, new_y[i] + shift, new_y[i])
        return new_v, new_y


class Plane(Surface):
    """Points y with normal·y = offset; what is below is behind it."""

    def __init__(self, h: Any, way: str, restitution: Any, friction: Any, omega: Any, normal: Any, offset: Any) -> None:
        super().__init__(h, way, restitution, friction, omega)
        self.normal = list(normal)
        self.offset = offset

    def place(self, y0: Vector, y: Vector) -> Place:
        """By the plane itself."""
        distance = dot(y, self.normal) - self.offset
        slack = ROUNDING.of(y[0]) * (magnitudes(y, self.normal) + bits.and_bits(self.offset, MAGNITUDE))
        before = dot(y0, self.normal) - self.offset
        return Place(bits.at_most(distance, slack), self.normal, distance, before, slack)

    def depth_of(self, y: Vector) -> Any:
        """Along the normal."""
        return dot(y, self.normal) - self.offset

    def push(self, y: Vector) -> Vector:
        """As deep as the point is behind the plane."""
        distance = dot(y, self.normal) - self.offset
        strength = self.stiffness * bits.where(bits.less(distance, 0.0), distance, 0.0)
        return [strength * n for n in self.normal]


class Sphere(Surface):
    """Points at a distance from a centre; what is behind it is within it, or without if points are inside."""

    is_curved = True

    def __init__(
        self, h: Any, way: str, restitution: Any, friction: Any, omega: Any, side: str, centre: Any, radius: Any
    ) -> None:
        super().__init__(h, way, restitution, friction, omega)
        self.is_inside = side == "inside"
        self.centre = list(centre)
        self.radius = radius

    def outward(self, vector: Vector) -> Vector:
        """A vector from the centre, towards the points."""
        return [-each for each in vector] if self.is_inside else vector

    def depth(self, length: Any) -> Any:
        """The distance of a point from the surface, from that from the centre."""
        return self.radius - length if self.is_inside else length - self.radius

    def place(self, y0: Vector, y: Vector) -> Place:
        """By the plane that touches the sphere where the straight way from ``y0`` to ``y`` meets it, or else nearest to ``y``."""
        from0, move, from1 = (
            [a - b for a, b in zip(*pair, strict=True)] for pair in ((y0, self.centre), (y, y0), (y, self.centre))
        )
        a, b, square = dot(move, move), dot(from0, move), dot(from0, from0)
        c = square - self.radius * self.radius
        disc = b * b - a * c
        slack = ROUNDING.of(y[0]) * (self.radius + magnitudes(self.centre, [1.0] * len(self.centre)))
        root = np.sqrt(bits.where(bits.less(0.0, disc), disc, 0.0))
        if self.is_inside:
            part = bits.where(bits.less(b, 0.0), (root - b) / a, -(c / (b + root)))
            hits = bits.at_most(c, 0.0) & bits.at_most(part, 1.0)
        else:
            part = c / (root - b)
            outside = bits.at_most(-(self.radius * (slack + slack)), c)  # or on the sphere, but for rounding
            hits = bits.less(0.0, disc) & bits.less(b, 0.0) & outside & bits.at_most(part, 1.0)
        where = [bits.where(hits, f0 + part * m, f1) for f0, m, f1 in zip(from0, move, from1, strict=True)]
        length = np.sqrt(dot(where, where))
        normal = self.outward([w / length for w in where])
        along = dot(from1, normal)
        distance = along + self.radius if self.is_inside else along - self.radius
        near = hits | bits.at_most(self.depth(np.sqrt(dot(from1, from1))), slack)
        return Place(near, normal, distance, self.depth(np.sqrt(square)), slack)

    def depth_of(self, y: Vector) -> Any:
        """Along the radius."""
        way = [y - c for y, c in zip(y, self.centre, strict=True)]
        return self.depth(np.sqrt(dot(way, way)))

    def push(self, y: Vector) -> Vector:
        """As deep as the point is behind the sphere, along the radius."""
        way = [y - c for y, c in zip(y, self.centre, strict=True)]
        length = np.sqrt(dot(way, way))
        distance = self.depth(length)
        strength = self.stiffness * bits.where(bits.less(distance, 0.0), distance / length, 0.0)
        return [strength * w for w in self.outward(way)]

    def back(self, y: Vector, distance: Any) -> Vector:
        """Along the radius."""
        way = [y - c for y, c in zip(y, self.centre, strict=True)]
        length = self.radius - distance if self.is_inside else self.radius + distance
        scale = length / np.sqrt(dot(way, way))
        return [c + scale * w for c, w in zip(self.centre, way, strict=True)]


def surfaces(h: Any, parameters: dict[str, Any]) -> list[Surface]:
    """Surfaces by their parameters."""
    all_of_them: list[Surface] = []
    for i in range(parameters["contacts"]):
        first = f"contact_{i}_"
        of = {name.removeprefix(first): value for name, value in parameters.items() if name.startswith(first)}
        common = h, of["way"], of.get("restitution"), of.get("friction"), of.get("omega")
        if parameters[f"contact_{i}"] == "plane":
            all_of_them.append(Plane(*common, of["normal"], of["offset"]))
        else:
            all_of_them.append(Sphere(*common, of["side"], of["centre"], of["radius"]))
    return all_of_them


class Touching(Around):
    """A system whose points meet surfaces."""

    def __init__(self, s: Any, h: Any, met: list[Surface]) -> None:
        super().__init__(s)
        self.h = h
        #: Points that surfaces act on: all but those that are led along.
        self.free = getattr(s, "free", slice(None))
        self.springs = [each for each in met if each.way == "spring"]
        self.met = [each for each in met if each.way != "spring"]
        safe = [each for each in self.met if each.way == "safe"]
        #: Along one plane the energy is right by itself.
        self.is_limited = len(safe) > 1 or any(each.is_curved or each.friction is not None for each in safe)
        self.on_rods: Any = None
        if hasattr(s, "contacts"):
            self.on_rods = s.contacts(h, self.met)

    def dv(self, t: Any, v: Any, y: Any) -> Any:
        """h·v̇ and the push of the springs."""
        dv, place = self.s.dv(t, v, y), y[self.free]
        for spring in self.springs:
            push = spring.push([place[:, c] for c in range(y.shape[1])])
            dv = self.among(dv, np.stack([dv[self.free, c] - push[c] for c in range(y.shape[1])], axis=1))
        return dv

    def among(self, block: Any, of_free: Any) -> Any:
        """A block with these numbers for the points that surfaces act on."""
        whole = np.array(np.broadcast_to(block, (*block.shape[:2], *of_free.shape[2:])))
        whole[self.free] = of_free
        return whole

    def resolve(self, before: Any, after: Any) -> tuple[Any, Any, Any]:
        """Which of the points that surfaces act on met one in a step, and the state of all after that.

        From the states before and after the step. Of points on rods the first is None: only methods without a carry step them.
        """
        if self.on_rods is not None:
            return None, *self.on_rods.resolve(before, after)
        dim, h = before[1].shape[1], self.h
        v0, y0, v1, y1 = ([block[self.free, c] for c in range(dim)] for block in (*before, *after))
        kick = [b - a for a, b in zip(v0, v1, strict=True)]
        lag = [(y1[c] - y0[c]) / h - 0.5 * (v0[c] + v1[c]) for c in range(dim)]
        step, v, y, touched = Step(v0, y0, v1, y1, kick, lag), v1, y1, None
        with np.errstate(all="ignore"):  # what is divided by zero is not chosen
            for surface in self.met:
                touches, v, y = surface.meet(step, v, y)
                touched = touches if touched is None else touched | touches
            if self.is_limited:
                v, y = self.limit(step, touched, v, y)
        return touched, *(self.among(old, np.stack(new, axis=1)) for old, new in zip(after, (v, y), strict=True))

    def limit(self, step: Step, touched: Any, v: Vector, y: Vector) -> tuple[Vector, Vector]:
        """No more energy than before the step, or after it without contact; the work is that of the mean acceleration."""

        def allowed(v_from: Vector, y_from: Vector) -> Any:
            work = dot(step.kick, [to - at for to, at in zip(y, y_from, strict=True)])
            return dot(v_from, v_from) + (work + work) / self.h

        most, raw, square = allowed(step.v0, step.y0), allowed(step.v1, step.y1), dot(v, v)
        most = bits.where(bits.less(most, raw), raw, most)
        stays = touched & bits.at_most(most, 0.0) & bits.less(square, np.inf)
        factor = bits.where(touched & bits.less(most, square), np.sqrt(most / square), 1.0)
        return (
            [bits.where(stays, 0.0, factor * each) for each in v],
            [bits.where(stays, at, each) for at, each in zip(step.y0, y, strict=True)],
        )


def step(steps: Any, s: Any, choice: int, t: Any, h: Any, v: Any, y: Any, *kept: Any) -> Any:
    """One step by a method, with projection and contact, and what the method keeps behind v and y.

    What a method carries or keeps begins anew where a point met a surface.
    """
    before = v, y
    window = of_step(t, h, hasattr(steps, "finish"))
    *after, kept_now = _with_kept(over(window, whole_step, steps.step, s, t, h, v, y, *kept))
    if not getattr(s, "met", None):
        return *after, *kept_now
    end, (slot, y1) = t + h, after

    def renewed(old: Any, new: Any) -> Any:
        new, as_stepped = new[s.free], old[s.free]
        return s.among(old, bits.where(np.broadcast_to(np.asarray(touched)[:, np.newaxis], as_stepped.shape), new, as_stepped))

    if not hasattr(steps, "finish"):
        touched, v, y = s.resolve(before, after)
        if not kept:
            return v, y
        started = steps.start(s, choice, end, h, v, y)
        return v, y, *(renewed(old, new) for old, new in zip(kept_now, started, strict=True))
    v0, v1 = steps.finish(s, choice, t, *before), steps.finish(s, choice, end, slot, y1)
    touched, v, y = s.resolve((v0, before[1]), (v1, y1))
    return renewed(slot, steps.start(s, choice, end, v, y)), y


def _with_kept(stepped: Any) -> tuple[Any, Any, Any]:
    """v, y, and what is kept behind them."""
    v, y, *kept = stepped
    return v, y, kept
