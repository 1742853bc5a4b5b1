"""How the motion of each kind of system is drawn: a row for each class of systems."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ...model.systems import Aircraft, Chain, NBody, Particles, Pendulum3D, RestrictedThreeBody, RigidBody, Rods, Springs, System


class FixedPoint(NamedTuple):
    """A body, or an end of rods, that does not move."""

    name: str
    place: tuple[float, ...]
    joined: tuple[int, ...] = ()  # the points at the other ends of its rods


class Kind(NamedTuple):
    """How systems of a class are drawn."""

    picture: str  # "orbits" of points, an aircraft's "attitude", a rigid "body", or "curves" over time
    fixed_points: Callable[[Any], list[FixedPoint]] = lambda _: []
    links: Callable[[Any], Any] = lambda _: ()  # pairs of points that springs or rods join
    owner: str = "coordinate"  # what has the coordinates of curves


def _two_bodies(system: Any) -> list[FixedPoint]:
    mu = float(system.mu)
    names = ("earth", "moon") if mu == float(RestrictedThreeBody().mu) else ("heavy body", "light body")
    return [FixedPoint(names[0], (-mu, 0.0)), FixedPoint(names[1], (1.0 - mu, 0.0))]


def _anchors(system: Any) -> list[FixedPoint]:
    joined: dict[Any, tuple[int, ...]] = dict.fromkeys(system.anchors, ())
    for rod in system.rods:
        for anchor in joined.keys() & rod:
            joined[anchor] += tuple(end for end in rod if isinstance(end, int))
    return [FixedPoint("", tuple(anchor), ends) for anchor, ends in joined.items()]


def _rods(system: Any) -> list[Any]:
    return [rod for rod in system.rods if all(isinstance(end, int) for end in rod)]


#: A class that is not here is drawn like the one from which it is derived.
KINDS: dict[type[Any], Kind] = {
    NBody: Kind("orbits"),
    Particles: Kind("orbits"),
    Springs: Kind("orbits", links=lambda system: system.pairs),
    Rods: Kind("orbits", _anchors, _rods),
    Pendulum3D: Kind("orbits", lambda _: [FixedPoint("", (0.0, 0.0, 0.0), (0,))]),
    RestrictedThreeBody: Kind("orbits", _two_bodies),
    Aircraft: Kind("attitude"),
    RigidBody: Kind("body"),
    Chain: Kind("curves", owner="mass"),
    System: Kind("curves"),
}


def kind_of(system: System) -> Kind:
    """The row of a system's class."""
    return next(KINDS[each] for each in type(system).__mro__ if each in KINDS)
