"""A small star cluster: Plummer's sphere (Aarseth, Hénon and Wielen 1974)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import count, fits, number
from ...errors import ArgumentError
from ...model.systems import NBody
from ..base import Scene

#: The share of the mass that is sampled; the outermost thousandth would be too far away.
INNER = 0.999


def plummer(n: Any = 64, seed: Any = 1, softening: Any = 0.05) -> Scene:
    """Equal stars at random in Plummer's sphere, over ten of Hénon's units of time.

    In Hénon's units G = 1, the total mass is 1 and the energy −1/4; the potential energy is −2 times the kinetic energy, and
    the centre of mass rests at the origin. The stars are drawn as Aarseth, Hénon and Wielen do (Astronomy and Astrophysics 37,
    1974), then moved and scaled, so that these values hold exactly and not only on average. The motion is chaotic: no solution is
    accurate for long.

    Args:
        n: number of stars, two or more.
        seed: seed of the random numbers, a whole number of zero or more; the same seed gives the same stars.
        softening: length ε of the force, in Hénon's units of length, zero or more. With 0 close pairs need a very small step.
    """
    n, seed = count("n", n, 2), count("seed", seed, 0)
    fits("n: the pairs", 4 * n * n, (), "take fewer stars")
    softening = number("softening", softening)
    if softening < 0.0:
        raise ArgumentError(f"softening: expected a length of zero or more, got {softening:g}")
    random = np.random.default_rng(seed)
    masses = np.full(n, 1.0 / n)
    y, v = _drawn(random, n)
    y, v = y - y.mean(axis=0), v - v.mean(axis=0)
    system = NBody(masses, force="newton", softening=softening, dim=3)
    y = y * _scale(masses, y, softening)
    v = v * math.sqrt(0.25 / float(system.energy(v, y) - system.energy(0.0 * v, y)))
    return Scene(
        name="plummer",
        title=f"Plummer's sphere of {n} stars",
        section="not in Hoffmann (2002)",
        description="A star cluster in space, softened, in equilibrium as a whole and chaotic star by star.",
        error="not measured: the motion is chaotic",
        system=system,
        v=v,
        y=y,
        dt=0.01,
        horizon=10.0,
    )


def _drawn(random: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Positions and velocities of n stars in a sphere with radius, mass and G of 1; shape (n, 3) each."""
    radius = ((INNER * (1.0 - random.random(n))) ** (-2.0 / 3.0) - 1.0) ** -0.5
    # The share q of the escape velocity has the density q²·(1 − q²)^(7/2), at most 0.0923; drawn and rejected.
    share = np.empty(n)
    for i in range(n):
        while True:
            q, height = random.random(2)
            if 0.1 * height < q * q * (1.0 - q * q) ** 3.5:
                share[i] = q
                break
    speed = share * math.sqrt(2.0) * (1.0 + radius * radius) ** -0.25
    return radius[:, np.newaxis] * _directions(random, n), speed[:, np.newaxis] * _directions(random, n)


def _directions(random: np.random.Generator, n: int) -> Array:
    """Unit vectors in directions of equal probability, shape (n, 3)."""
    z, angle = 1.0 - 2.0 * random.random(n), 2.0 * math.pi * random.random(n)
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=-1)


def _scale(masses: Array, y: Array, softening: float) -> float:
    """The factor of all positions that makes the potential energy −1/2, by bisection."""
    i, j = np.triu_indices(len(masses), 1)
    square = ((y[i] - y[j]) ** 2).sum(axis=-1)
    product = masses[i] * masses[j]

    def depth(scale: float) -> float:
        with np.errstate(divide="ignore"):  # the square of a softening may underflow to zero
            return float((product / np.sqrt(scale * scale * square + softening * softening)).sum())

    low, high = 0.0, 1.0
    if softening > 0.0 and depth(0.0) <= 0.5:
        raise ArgumentError(f"softening: {softening:g} is too long for {len(masses)} stars to have the energy −1/4")
    while depth(high) > 0.5:
        high *= 2.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if depth(middle) > 0.5 else (low, middle)
    return high
