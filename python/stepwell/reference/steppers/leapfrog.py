"""Leapfrog (velocity Verlet). Between steps the place of ``v`` holds the velocity of half a step ago."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, v_half: Array, y: Array) -> Blocks:
    """False Euler, from a ``v`` of half a step ago."""
    v_half = v_half + s.dv(t, v_half, y)
    return v_half, y + s.dy(t, v_half, y)


def start(s: Scaled, choice: int, t: float, v: Array, y: Array) -> Array:
    """Half a kick back."""
    return v + -0.5 * s.dv(t, v, y)


def finish(s: Scaled, choice: int, t: float, v_half: Array, y: Array) -> Array:
    """Half a kick forward."""
    return v_half + 0.5 * s.dv(t, v_half, y)
