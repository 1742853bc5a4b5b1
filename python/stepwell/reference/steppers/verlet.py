"""Verlet (§8). Between steps the place of ``v`` holds ``y_prev``."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, y_prev: Array, y: Array) -> Blocks:
    """The next ``y`` from the last two: h²·a is the increment of y that the increment of v makes."""
    d = s.dy(t, s.dv(t, y_prev, y), y)
    return y, (2.0 * y - y_prev) + d


def start(s: Scaled, choice: int, t: float, v: Array, y: Array) -> Array:
    """``y`` one step ago: y₀ − h·v₀, and ½h²·a₀ more for the second-order start (choice 0)."""
    y_prev = y - s.dy(t, v, y)
    if choice == 0:
        y_prev = y_prev + 0.5 * s.dy(t, s.dv(t, v, y), y)
    return y_prev


def finish(s: Scaled, choice: int, t: float, y_prev: Array, y: Array) -> Array:
    """The velocity: what ``start`` would have begun with."""
    v = s.velocity(y - y_prev)
    if choice == 0:
        v = v + 0.5 * s.dv(t, y_prev, y)
    return v
