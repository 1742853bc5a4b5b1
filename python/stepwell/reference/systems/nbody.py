"""Bodies that attract each other (Appendix C, D), each pair computed once."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np

from ...base.arrays import Array
from .. import bits
from ..bits import PerPrecision
from ..log import log
from ..quantities import Quantity, Recorded, of_spin

#: Sums over bodies are kept in this many parts, body i in part i mod LANES; distances that are taken together are so far apart.
LANES = 8


def partners(n: int) -> list[list[range]]:
    """The distances k at which body i meets body i + k, every pair once for k ≤ n/2, in the order in which they are summed.

    Distances that are LANES apart form a group, groups form slabs, and a slab has sums of its own.
    """
    if n < 64:
        pairs = n // 2 // (2 * LANES) * (2 * LANES)
        groups = [range(k, k + 2 * LANES, LANES) for first in range(1, pairs + 1, 2 * LANES) for k in range(first, first + LANES)]
        return [groups + [range(k, k + 1) for k in range(pairs + 1, n // 2 + 1)]]
    last = (n - 1) // 2
    count = min(max(1, n // 256), 16)
    length = -(-last // (count * LANES)) * LANES  # a whole number of LANES
    slabs = [
        [range(k, min(first + length, last + 1), LANES) for k in range(first, min(first + LANES, last + 1))]
        for first in range(1, last + 1, length)
    ]
    if n % 2 == 0:
        slabs[-1].append(range(n // 2, n // 2 + 1))  # opposite bodies
    return slabs


def numbers_of(indices: bytes | None) -> Any:
    """A list of whole numbers."""
    return np.frombuffer(indices or b"", "<u4").astype(np.intp)


def total(values: Array) -> Array:
    """The sum over the first axis: body i in part i mod LANES, then part after part; zero without bodies."""
    if not len(values):
        return np.zeros(values.shape[1:], values.dtype)
    whole_rows = len(values) // LANES * LANES
    parts, rest = values, values[whole_rows:]
    if whole_rows:
        # Not a sum, which NumPy may take in any order.
        parts = np.add.accumulate(values[:whole_rows].reshape(-1, LANES, *values.shape[1:]))[-1]
        parts = np.concatenate([parts[: len(rest)] + rest, parts[len(rest) :]]) if len(rest) else parts
    whole: Array = parts[0]
    for part in parts[1:]:
        whole = whole + part
    return whole


def square(d: Array) -> Array:
    """d·d of vectors along the second axis."""
    length = d[:, 0] * d[:, 0]
    for c in range(1, d.shape[1]):
        length = length + d[:, c] * d[:, c]
    return length


#: From what halved bits are subtracted, of float64 and of float32, and the factors of e, e² and e³ in both corrections.
START = PerPrecision(0x5FE6_E96B_D011_219C, 0x5F37_4B5F)
FIRST, SECOND = (0.5010993791148002, 0.3758909929326057), (1.5, 1.875, 2.1875)


def inverse_cube(x: Array) -> Array:
    """x^(−3/2) by fused multiply-adds, without a root or a quotient, for x ≥ 0; at most 2.2 units of the last digit beside it.

    Half the bits of x, subtracted from a whole number, are the bits of a y whose square is 1/x within a tenth. With e = 1 − x·y²
    the first correction takes two terms of (1 − e)^(−½), with the factors that make the largest error least, and the second of
    (1 − e)^(−3/2) the terms to e³. The core says how large the error may be (``inverse_cube`` of ``bodies.rs``).
    """
    y = bits.sub_bits_from(bits.shift_down(x, 1), START.of(x))
    e = bits.mul_sub_from(x, y * y, 1.0)
    y = bits.mul_add(y * e, bits.mul_add(e, FIRST[1], FIRST[0]), y)
    square = y * y
    e, cube = bits.mul_sub_from(x, square, 1.0), square * y
    terms = bits.mul_add(bits.mul_add(e, SECOND[2], SECOND[1]), e, SECOND[0])
    return np.asarray(bits.mul_add(cube * e, terms, cube))


def apart(shares: Array, block: Array) -> tuple[Array, Array]:
    """Each body but the first from the centre of mass of those before it, and the centre of mass of all."""
    centre, rows = block[0], []
    for k in range(1, len(block)):
        rows.append(block[k] - centre)
        centre = centre + shares[k - 1] * rows[-1]
    return np.stack(rows), centre


def gathered(shares: Array, rows: Array, centre: Array | None) -> Array:
    """The inverse: all bodies. The centre of mass is the origin if None."""
    bodies: list[Array] = []
    for k in range(len(rows) - 1, -1, -1):
        lever = shares[k] * rows[k]
        before: Array = -lever if centre is None else centre - lever
        bodies.append(before + rows[k])
        centre = before
    return np.stack([before, *reversed(bodies)])


class NBody(Recorded):
    """v̇ᵢ = Σⱼ G·mⱼ·(yⱼ − yᵢ)·f(r² + ε²), ẏ = v, with f = 1/r² (``logarithmic``, ``printed``) or 1/r³ (``newton``).

    Blocks are of shape (bodies, dim, …), masses of shape (bodies, …). Bodies that are ``massless`` attract no other: the rest
    move as if these were not there, and each of these as if it were alone with the rest, which pull it one after the other. No
    sum over bodies has a term of theirs.

    Fused, every product of the forces that is added is rounded with its sum only: r² is a sum from ε² on, and a pull an addend of
    what a body gets. Newton's f is then ``inverse_cube``. What is recorded is rounded as without.
    """

    def __init__(
        self,
        h: float,
        force: str,
        dim: int,
        masses: Array,
        strength: Array,
        softening: Array,
        massless: bytes | None = None,
        fused: int = 0,
    ) -> None:
        self.h = h
        self.force = force
        self.fused = bool(fused)
        self.masses = masses
        self.alone = strength
        self.strength = h * strength  # h·G·m
        self.soft = softening * softening
        self.half = (0.5 * h) * masses
        self.massless = numbers_of(massless)
        everyone: Any = slice(None)  # as a view, which takes no time
        self.massive = np.delete(np.arange(len(masses)), self.massless) if len(self.massless) else everyone

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.meet(y, None)

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * v

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        return d / self.h

    def central(self, y: Array) -> Array | None:
        """The acceleration, times h, of Kepler's motions about the centres of the bodies before (Jacobi); None without these."""
        if self.force != "newton" or len(y) < 2:
            return None
        shares, mu = self.hierarchy()
        rows, _ = apart(shares, y)
        inverse = 1.0 / np.sqrt(square(rows))
        pull = (-self.h * mu) * (inverse * (inverse * inverse))
        return gathered(shares, rows * pull[:, np.newaxis], None)

    def drift(self, share: float, v: Array, y: Array) -> tuple[Array, Array]:
        """The state after a share of the step of Kepler's motions; the centre of mass flies freely."""
        from .. import kepler  # other methods need no such motion

        h = self.h if share == 1.0 else share * self.h
        shares, mu = self.hierarchy()
        places, _ = apart(shares, y)
        velocities, flight = apart(shares, v)
        dv, dy = kepler.moved(mu, h, velocities, places)
        return v + gathered(shares, dv, None), y + gathered(shares, dy, h * flight)

    def hierarchy(self) -> tuple[Array, Array]:
        """Of each body but the first its share in the mass of all up to it, and G times that mass."""
        mass, mu = self.masses[0], self.alone[0]
        shares, strengths = [], []
        for k in range(1, len(self.masses)):
            mass, mu = mass + self.masses[k], mu + self.alone[k]
            shares.append(self.masses[k] / mass)
            strengths.append(mu)
        return np.stack(shares), np.stack(strengths)

    def meet(self, y: Array, potential: Array | None) -> Array:
        """h·v̇; adds h·G·Σⱼ mⱼ·φ to ``potential`` for each body with mass, if it is there."""
        if not len(self.massless):
            return self.among(y, self.strength, potential)
        dv = np.full_like(y, -0.0)
        strength = self.strength[self.massive]
        dv[self.massive] = self.among(y[self.massive], strength, potential)
        alone = dv[self.massless]
        for j, own in zip(self.massive, strength, strict=True):
            d = y[j] - y[self.massless]
            alone = self.plus(alone, d, self.pull(self.softened(d)) * own)
        dv[self.massless] = alone
        return dv

    def among(self, y: Array, strength: Array, potential: Array | None) -> Array:
        """The accelerations, as in ``meet``, among bodies with mass, from every pair once.

        Body i pulls the partner after it, i + k, and is pulled by it; what bodies get from the partners after them and before
        them is summed apart, the latter over two rounds (body n + j is body j) so that no index wraps. These sums start from −0:
        x + −0 is x, also where x is a zero.
        """
        n = len(y)
        dv = np.full_like(y, -0.0)  # of y's type, which may be objects
        twice, strengths = np.concatenate([y, y]), np.concatenate([strength, strength])
        for slab in partners(n):
            after, before, wells = np.full_like(y, -0.0), np.full_like(twice, -0.0), np.full_like(y[:, 0], 0.0)
            for group in slab:
                pushes = []
                for k in group:
                    m = k if 2 * k == n else n  # opposite bodies meet once
                    d = twice[k : k + m] - y[:m]
                    r2 = self.softened(d)
                    pull = self.pull(r2)
                    after[:m] = self.plus(after[:m], d, pull * strengths[k : k + m])
                    pushes.append((k, m, d, pull * strength[:m]))
                    if potential is not None:
                        wells[:m] = wells[:m] + self.phi(r2, pull, strengths[k : k + m])
                for k, m, d, push in reversed(pushes):
                    before[k : k + m] = self.plus(before[k : k + m], d, push)
            dv = dv + (after - (before[:n] + before[n:]))
            if potential is not None:
                potential += wells
        return dv

    def plus(self, total: Array, d: Array, factor: Array) -> Array:
        """The sums of vectors and a factor times others."""
        factor = factor[:, np.newaxis]
        return np.asarray(bits.mul_add(d, factor, total)) if self.fused else total + d * factor

    def softened(self, d: Array) -> Array:
        """d·d + ε²"""
        if not self.fused:
            return square(d) + self.soft
        length = self.soft
        for c in range(d.shape[1]):
            length = bits.mul_add(d[:, c], d[:, c], length)
        return length

    def pull(self, r2: Array) -> Array:
        """f(r²)"""
        if self.force == "newton":
            return inverse_cube(r2) if self.fused else 1.0 / (r2 * np.sqrt(r2))
        return 1.0 / r2

    def phi(self, r2: Array, pull: Array, strength: Array) -> Array:
        """The potential, per mass, that a partner makes: ln r, or −1/r (which ``printed`` has with the wrong force)."""
        if self.force == "logarithmic":
            # The logarithm is of normal numbers; what is added is 0 for these, and of others, such as a distance of 0, a NaN.
            return (0.5 * log(r2) + (r2 - r2) * pull) * strength
        if self.force == "newton":
            return -(r2 * (pull * strength))  # the product is at hand
        return -(np.sqrt(pull) * strength)

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy, and h times the whole energy, in one pass over the pairs."""
        massive = self.massive
        potential = np.full_like(y[massive, 0], 0.0)
        dv = self.meet(y, potential)
        kinetic = total(self.half[massive] * square(v[massive]))
        return dv, kinetic, kinetic + total(self.masses[massive] * potential)

    def unfused(self) -> NBody:
        """Return these bodies without fused forces, for what is recorded."""
        other = copy(self)
        other.fused = False
        return other

    def gradient(self, v: Array, y: Array, dv: Array) -> tuple[Array, Array, Array]:
        """The gradient of the energy, m·v in the velocities and −m·a in the coordinates, and the square of its length."""
        masses, massive = self.masses[:, np.newaxis], self.massive
        along_v, along_y = masses * v, -(masses * (dv / self.h))
        return along_v, along_y, total(square(along_v[massive]) + square(along_y[massive]))


def energy(s: NBody, v: Array, y: Array) -> Array:
    """½·Σ m·v² and the potential of every pair."""
    return s.unfused().energies(v, y)[2] / s.h


def momentum(s: NBody, v: Array, y: Array) -> Array:
    """Σ m·v."""
    return total(s.masses[s.massive, np.newaxis] * v[s.massive])


def angular_momentum(s: NBody, v: Array, y: Array) -> Array:
    """Σ m·y × v about the origin."""
    pairs = [(0, 1)] if y.shape[1] == 2 else [(1, 2), (2, 0), (0, 1)]
    masses, v, y = s.masses[s.massive], v[s.massive], y[s.massive]
    spin = [total(masses * (y[:, a] * v[:, b] - y[:, b] * v[:, a])) for a, b in pairs]
    return spin[0] if len(spin) == 1 else np.stack(spin)


def closest(s: NBody, v: Array, y: Array) -> Array:
    """The least distance of two bodies, of which one has mass."""
    least = np.full(y.shape[2:], np.inf)
    massive, massless = y[s.massive], y[s.massless]
    for i, place in enumerate(massive):
        for others in (massive[i + 1 :], massless):
            for r2 in square(others - place):
                least = bits.where(bits.less(r2, least), r2, least)
    return np.asarray(np.sqrt(least))


NBody.quantities = {
    "energy": Quantity(energy),
    "momentum": Quantity(momentum, lambda dim: (dim,)),
    "angular_momentum": Quantity(angular_momentum, of_spin),
    "closest": Quantity(closest),
}
