"""Points joined by rods. The pulls of the rods solve a system of linear equations, one for each rod."""

from typing import Any

import numpy as np

from ...base.arrays import Array, Blocks
from .. import bits, rod_contact
from ..elimination import factored, solved
from ..quantities import Quantity, Recorded, of_spin

#: Newton's corrections of the points in a projection. Each squares the relative error of the lengths, over 2: 2 % becomes
#: 2·10⁻⁴, 2·10⁻⁸ and 2·10⁻¹⁶, which is rounding.
CORRECTIONS = 3


def dot(a: Array, b: Array) -> Array:
    """The dot product along the first axis."""
    whole: Array = a[0] * b[0]
    for c in range(1, len(a)):
        whole = whole + a[c] * b[c]
    return whole


def largest(values: list[Array]) -> Array:
    """The largest absolute value."""
    most = None
    for value in values:
        size = bits.where(bits.less(value, 0.0), -value, value)
        most = size if most is None else bits.where(bits.less(most, size), size, most)
    return np.asarray(most)


def spin(y: Array, v: Array, axes: list[tuple[int, int]]) -> list[Array]:
    """The components of y × v."""
    return [y[a] * v[b] - y[b] * v[a] for a, b in axes]


class Rods(Recorded):
    """v̇ᵢ = −(Σ ±pullₖ·dₖ)/mᵢ − g, where d points from the first end of a rod to its second.

    The pulls are those for which C̈ = 0, with C = ½(d·d − l²); under control C̈ + 2αĊ + α²C = 0, α = c/h. Ends of rods are
    numbers of points; anchors count on from the last point and are first ends only. Blocks are of shape (points, dim, …).
    """

    def __init__(
        self,
        h: float,
        dim: int,
        rods: list[list[int]],
        masses: Array,
        lengths: Array,
        anchors: Array | None,
        gravity: Array,
        keeps: str | None,
        strength: Array | None,
    ) -> None:
        self.h = h
        self.dim = dim
        self.rods = rods
        self.masses = masses
        self.inverse, self.minus = 1.0 / masses, -1.0 / masses
        self.lengths = lengths
        self.squares = lengths * lengths
        self.anchors: Any = anchors
        self.gravity = gravity
        self.fall = h * gravity
        self.projects = keeps == "projection"
        self.damping: Any = None
        self.stiffness: Any = None
        if strength is not None:
            self.damping, self.stiffness = 2.0 * strength, 0.5 * ((strength * strength) / h)

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        d, u = self.spans(y), self.closing(v)
        right = []
        for k, (first, _) in enumerate(self.rods):
            pull = self.h * dot(u[k], u[k])
            if first >= len(self.masses):
                pull = pull - self.fall * d[k][-1]
            if self.damping is not None:
                pull = (pull + self.damping * dot(d[k], u[k])) + self.stiffness * (dot(d[k], d[k]) - self.squares[k])
            right.append(pull)
        pushed = self.pushed(d, solved(factored(self.matrix(d)), right))
        return np.stack([np.concatenate([push[:-1], push[-1:] - self.fall]) for push in pushed])

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The velocity v for which dy is d."""
        return d / self.h

    def spans(self, y: Array) -> list[Array]:
        """The vector of each rod."""
        n = len(self.masses)
        return [y[b] - (y[a] if a < n else self.anchors[a - n]) for a, b in self.rods]

    def closing(self, v: Array) -> list[Array]:
        """The rate of each rod's vector."""
        return [v[b] - v[a] if a < len(self.masses) else v[b] for a, b in self.rods]

    def matrix(self, d: list[Array]) -> list[list[Any]]:
        """The matrix of the equations: how the pull of a rod changes C̈ of another, zero unless they share a point."""
        rows = []
        for k, (a, b) in enumerate(self.rods):
            row: list[Any] = [None if (w := self.shared(k, other)) is None else w * dot(d[k], d[other]) for other in range(k)]
            own = self.inverse[b] + self.inverse[a] if a < len(self.masses) else self.inverse[b]
            rows.append([*row, own * dot(d[k], d[k])])
        return rows

    def shared(self, k: int, other: int) -> Any:
        """1/m of the point that two rods share, negative if only one of them begins there; None without such a point."""
        (a, b), (first, second) = self.rods[k], self.rods[other]
        if b == second:
            return self.inverse[b]
        if a == first and a < len(self.masses):
            return self.inverse[a]
        if a == second:
            return self.minus[a]
        return self.minus[b] if b == first else None

    def pushed(self, d: list[Array], pulls: list[Array]) -> list[Array]:
        """The increments of v by the pulls of the rods."""
        sums: list[Any] = [None] * len(self.masses)
        for (a, b), span, pull in zip(self.rods, d, pulls, strict=True):
            along = pull * span
            sums[b] = along if sums[b] is None else sums[b] + along
            if a < len(sums):
                sums[a] = -along if sums[a] is None else sums[a] - along
        return [minus * each for minus, each in zip(self.minus, sums, strict=True)]

    def project(self, v: Array, y: Array) -> Blocks:
        """The state after a step; if the system projects, with the rods' lengths restored and no velocity along the rods.

        Each correction moves the points by the least sum of m·(distance)², and so do the velocities: momentum stays.
        """
        if not self.projects:
            return v, y
        for _ in range(CORRECTIONS):
            d = self.spans(y)
            off = [0.5 * (dot(span, span) - square) for span, square in zip(d, self.squares, strict=True)]
            y = self.moved(y, d, off)
        d = self.spans(y)
        return self.moved(v, d, [dot(span, u) for span, u in zip(d, self.closing(v), strict=True)]), y

    def moved(self, block: Array, d: list[Array], off: list[Array]) -> Array:
        """A block, changed along the rods so that these errors vanish."""
        pushed = self.pushed(d, solved(factored(self.matrix(d)), off))
        return np.stack([each + push for each, push in zip(block, pushed, strict=True)])

    def contacts(self, h: Any, surfaces: list[Any]) -> Any:
        """How its points meet surfaces in a step h."""
        return rod_contact.RodContacts(h, self, 2, surfaces)


def energy(s: Rods, v: Array, y: Array) -> Array:
    """Σ m·(½v² + g·height), which is zero at rest at height 0."""
    whole: Any = None
    for mass, velocity, place in zip(s.masses, v, y, strict=True):
        each = mass * (0.5 * dot(velocity, velocity) + s.gravity * place[-1])
        whole = each if whole is None else whole + each
    return np.asarray(whole)


def length_error(s: Rods, v: Array, y: Array) -> Array:
    """The largest |length/l − 1| of the rods."""
    return largest([np.sqrt(dot(span, span)) / length - 1.0 for span, length in zip(s.spans(y), s.lengths, strict=True)])


def angular_momentum(s: Rods, v: Array, y: Array) -> Array:
    """Σ m·y × v about the origin: one number in the plane, three in space."""
    whole: Any = None
    for mass, place, velocity in zip(s.masses, y, v, strict=True):
        each = [mass * part for part in spin(place, velocity, [(0, 1)] if s.dim == 2 else [(1, 2), (2, 0), (0, 1)])]
        whole = each if whole is None else [a + b for a, b in zip(whole, each, strict=True)]
    return whole[0] if len(whole) == 1 else np.stack(whole)


Rods.quantities = {
    "energy": Quantity(energy),
    "length_error": Quantity(length_error),
    "angular_momentum": Quantity(angular_momentum, of_spin),
}
