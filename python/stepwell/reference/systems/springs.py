"""Particles joined by springs, in one to three dimensions."""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from .. import bits
from ..quantities import Quantity, Recorded
from .nbody import numbers_of, square, total


class Ends(NamedTuple):
    """Ends of springs, no two at one particle: the particles, and the springs. Those of first ends pull, the others push."""

    first: tuple[Any, Any]
    second: tuple[Any, Any]


def in_order(pairs: Any, fixed: Any) -> list[Ends]:
    """The ends of springs at free particles: of every particle its first spring, then of every particle its second, and so on."""
    particles, ends = pairs.reshape(-1), np.arange(pairs.size)
    is_fixed = np.zeros(particles.max() + 1, dtype=bool)
    is_fixed[fixed[fixed < len(is_fixed)]] = True
    ends = ends[~is_fixed[particles]]
    ends = ends[np.argsort(particles[ends], kind="stable")]  # particle by particle, each in the order of the springs
    _, begins, counts = np.unique(particles[ends], return_index=True, return_counts=True)
    turn = np.arange(len(ends)) - np.repeat(begins, counts)
    ends = ends[np.argsort(turn, kind="stable")]
    rounds = []
    for these in np.split(ends, np.cumsum(np.bincount(turn))[:-1] if len(turn) else []):
        first, second = these[these % 2 == 0], these[these % 2 == 1]
        rounds.append(Ends((particles[first], first // 2), (particles[second], second // 2)))
    return rounds


class Springs(Recorded):
    """A spring of length ℓ = |d|, d = yⱼ − yᵢ, pulls i with f·d and j with −f·d, f = k − (k·ℓ₀ − c·((vⱼ − vᵢ)·d)/ℓ)/ℓ.

    v̇ = Σ f·d/m + g − (drag/m)·v, ẏ = v. Written so, f stays finite where the square of ℓ is too large for a number. A spring of
    no length has no direction and no force: 1 stands in place of a divisor of zero. The forces on a particle are summed in
    the order of the springs. The rate of a fixed particle is −0, and sums start from it: x + −0 is x, also where x is a zero.

    Blocks are of shape (n, dim, …); masses and drag of shape (n, …), the others of shape (springs, …), or 1 for all.
    """

    def __init__(
        self,
        h: float,
        n: int,
        dim: int,
        pairs: bytes,
        masses: Array,
        stiffness: Array,
        rest: Array,
        fixed: bytes | None = None,
        damping: Array | None = None,
        gravity: Array | None = None,
        drag: Array | None = None,
    ) -> None:
        self.h = h
        self.masses, self.stiffness, self.rest, self.damping = masses, stiffness, rest, damping
        self.force_at_rest = stiffness * rest
        ends = numbers_of(pairs).reshape(-1, 2)
        self.i, self.j = ends.T
        self.fixed = numbers_of(fixed)
        self.free = np.delete(np.arange(n), self.fixed)
        self.ends = ends
        self.by_mass = h / masses
        self.fall = None if gravity is None else h * gravity
        self.slowing = None if drag is None else self.by_mass * drag

    @cached_property
    def rounds(self) -> list[Ends]:
        """The springs in the order in which a particle's forces are summed."""
        return in_order(self.ends, self.fixed)

    def across(self, places: Array) -> Array:
        """From the first end of each spring to the second, shape (springs, dim, …)."""
        d: Array = places[self.j] - places[self.i]
        return d

    def forces(self, v: Array, y: Array) -> Array:
        """The force on the first end of each spring, shape (springs, dim, …)."""
        d = self.across(y)
        length = np.sqrt(square(d))
        divisor = bits.where(bits.less(0.0, length), length, 1.0)
        if self.damping is None:
            push = self.force_at_rest / divisor
        else:
            inverse = 1.0 / divisor
            w = self.across(v)
            along = w[:, 0] * d[:, 0]
            for c in range(1, d.shape[1]):
                along = along + w[:, c] * d[:, c]
            push = (self.force_at_rest - (self.damping * along) * inverse) * inverse
        forces: Array = (self.stiffness - push)[:, np.newaxis] * d
        return forces

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        forces = self.forces(v, y)
        sums = np.full_like(forces, -0.0, shape=(len(y), *forces.shape[1:]))
        for (pulled, by), (pushed, back) in self.rounds:
            sums[pulled] = sums[pulled] + forces[by]
            sums[pushed] = sums[pushed] - forces[back]
        rates = sums * self.by_mass[:, np.newaxis]
        if self.fall is not None:
            rates = rates + self.fall
        if self.slowing is not None:
            rates = rates - self.slowing[:, np.newaxis] * v
        dv = np.full_like(rates, -0.0)
        dv[self.free] = rates[self.free]
        return dv

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h

    def stretches(self, y: Array) -> Array:
        """How much longer than at rest each spring is, shape (springs, …)."""
        longer: Array = np.sqrt(square(self.across(y))) - self.rest
        return longer

    def of_free(self, numbers: Array) -> Array:
        """Numbers of the particles that move; one may serve for all."""
        return numbers if len(numbers) == 1 else numbers[self.free]

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy of what moves, and h times the whole energy."""
        return self.dv(0.0, v, y), *self.kinetic_and_whole(v, y)

    def kinetic_and_whole(self, v: Array, y: Array) -> tuple[Array, Array]:
        """The kinetic energy of what moves and the whole energy, both times h."""
        half = 0.5 * self.h
        kinetic = total((half * self.of_free(self.masses)) * square(v[self.free]))
        stretch = self.stretches(y)
        whole = kinetic + total(((half * self.stiffness) * stretch) * stretch)
        if self.fall is not None:
            along = self.fall[0] * y[self.free, 0]
            for c in range(1, y.shape[1]):
                along = along + self.fall[c] * y[self.free, c]
            whole = whole - total(self.of_free(self.masses) * along)
        return kinetic, whole

    def gradient(self, v: Array, y: Array, dv: Array) -> tuple[Array, Array, Array]:
        """The gradient of the energy, m·v in the velocities and −m·v̇ in the coordinates, and the square of its length."""
        masses = self.of_free(self.masses)[:, np.newaxis]
        along_v, along_y = np.full_like(dv, 0.0), np.full_like(dv, 0.0)
        of_v, of_y = masses * v[self.free], -(masses * (dv[self.free] / self.h))
        along_v[self.free], along_y[self.free] = of_v, of_y
        return along_v, along_y, total(square(of_v) + square(of_y))


def energy(s: Springs, v: Array, y: Array) -> Array:
    """½·Σ m·v² − Σ m·g·y of what moves, and ½·Σ k·(ℓ − ℓ₀)²."""
    return s.kinetic_and_whole(v, y)[1] / s.h


def momentum(s: Springs, v: Array, y: Array) -> Array:
    """Σ m·v of what moves."""
    return total(s.of_free(s.masses)[:, np.newaxis] * v[s.free])


def stretch(s: Springs, v: Array, y: Array) -> Array:
    """The largest ℓ − ℓ₀ of a spring."""
    stretches = s.stretches(y)
    most = np.full_like(stretches[0], -np.inf)
    for each in stretches:
        most = bits.where(bits.less(most, each), each, most)
    return np.asarray(most)


Springs.quantities = {
    "energy": Quantity(energy),
    "momentum": Quantity(momentum, lambda dim: (dim,)),
    "stretch": Quantity(stretch),
}
