"""Points joined by rods at some places: what an impulse at one of them does to all, and corrections of lengths."""

from __future__ import annotations

from typing import Any

from .contact import Vector, dot
from .elimination import Factors, factored, solved

#: A change of each point; None for those that do not change.
Column = list[Vector | None]


def groups(rods: list[list[int]], points: int) -> list[list[int]]:
    """Points that are joined, directly or by others, each group in ascending order; anchors join nothing."""
    of = list(range(points))
    for a, b in rods:
        if a < points:
            low, high = sorted((of[a], of[b]))
            of = [low if each == high else each for each in of]
    return [[i for i in range(points) if of[i] == group] for group in sorted(set(of))]


class Joined:
    """Points and rods at some places: the vectors of the rods, and how their pulls act on each other."""

    def __init__(self, rods: Any, y: list[Vector]) -> None:
        self.rods = rods
        n = len(y)
        self.d = [[to - at for to, at in zip(y[b], y[a] if a < n else rods.anchors[a - n], strict=True)] for a, b in rods.rods]

    def factors(self) -> Factors:
        """The factors of the rods' equations."""
        return factored(self.rods.matrix(self.d))

    def squares(self) -> list[Any]:
        """The squares of the lengths."""
        return [dot(d, d) for d in self.d]

    def closing(self, v: list[Vector]) -> list[Any]:
        """Half the rates of these squares."""
        n, rates = len(v), []
        for (a, b), d in zip(self.rods.rods, self.d, strict=True):
            u = [to - at for to, at in zip(v[b], v[a], strict=True)] if a < n else v[b]
            rates.append(dot(d, u))
        return rates

    def pushed(self, pulls: list[Any], points: int) -> Column:
        """The sum of the rods' pulls on each point; None for those that do not feel any."""
        sums: Column = [None] * points
        for (a, b), d, pull in zip(self.rods.rods, self.d, pulls, strict=True):
            if pull is None:
                continue
            along = [pull * each for each in d]
            if a < points:
                at = sums[a]
                sums[a] = [-x for x in along] if at is None else [s - x for s, x in zip(at, along, strict=True)]
            to = sums[b]
            sums[b] = along if to is None else [s + x for s, x in zip(to, along, strict=True)]
        return [None if each is None else [minus * x for x in each] for minus, each in zip(self.rods.minus, sums, strict=True)]

    def column(self, factors: Factors, points: int, i: int, along: Vector) -> Column:
        """Velocities of the points by a unit impulse at point i."""
        right: list[Any] = [None] * len(self.d)
        for k, (a, b) in enumerate(self.rods.rods):
            if i in (a, b):
                right[k] = (self.rods.inverse[i] if b == i else self.rods.minus[i]) * dot(self.d[k], along)
        column = self.pushed(solved(factors, right), points)
        felt = column[i]
        own = [self.rods.inverse[i] * each for each in along]
        column[i] = own if felt is None else [x + y for x, y in zip(own, felt, strict=True)]
        return column

    def corrected(self, factors: Factors, block: list[Vector], off: list[Any]) -> list[Vector]:
        """A block, changed along the rods by what takes these errors away."""
        return added(block, self.pushed(solved(factors, off), len(block)))


def added(block: list[Vector], changes: Column, factor: Any = None) -> list[Vector]:
    """A block and a change of it, times a factor."""
    new = []
    for each, change in zip(block, changes, strict=True):
        if change is None:
            new.append(each)
        elif factor is None:
            new.append([x + c for x, c in zip(each, change, strict=True)])
        else:
            new.append([x + factor * c for x, c in zip(each, change, strict=True)])
    return new
