"""Damped Euler (§6)."""

from ...base.arrays import Array, Blocks, Scaled


def step(s: Scaled, t: float, h: float, v: Array, y: Array) -> Blocks:
    """``y`` first with the old ``v``, then ``v`` with the new ``y``: False Euler with the blocks exchanged."""
    y = y + s.dy(t, v, y)
    return v + s.dv(t, v, y), y


def damped_form(phi: float, v: Array, y: Array) -> Blocks:
    """Hoffmann's own form on the oscillator: Standard Euler with the artificial damping D = Φ/2.

    v − Φ(y + 2Dv) = v − Φ(y + Φv) is the force at the new y, so both forms are the same method; they differ by rounding.
    """
    damping = 0.5 * phi
    return v - phi * (y + 2.0 * damping * v), y + phi * v
