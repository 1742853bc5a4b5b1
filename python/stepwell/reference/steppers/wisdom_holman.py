"""Wisdom and Holman's method (1991): kicks by what bodies do to each other's orbits, and Kepler's motion between them.

Between steps the place of ``v`` holds the velocity of half a kick ago, as leapfrog's does.
"""

from ...base.arrays import Array, Blocks, Scaled
from ..splitting import drift, kick


def step(s: Scaled, t: float, h: float, v_half: Array, y: Array) -> Blocks:
    """A whole kick, which ends that of the step before, and a whole drift."""
    return drift(s, 1.0, t, v_half + kick(s, t, v_half, y), y)


def start(s: Scaled, choice: int, t: float, v: Array, y: Array) -> Array:
    """Half a kick back."""
    return v + -0.5 * kick(s, t, v, y)


def finish(s: Scaled, choice: int, t: float, v_half: Array, y: Array) -> Array:
    """Half a kick forward."""
    return v_half + 0.5 * kick(s, t, v_half, y)
