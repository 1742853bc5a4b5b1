"""Appendix A: the frequencies as Taylor series."""

from __future__ import annotations

import math

import numpy as np

from ...analysis.stability import analyse
from ...model.systems import Oscillator
from . import Finding, Section

section = Section("App. A")


def _order(name: str, coefficient: float) -> tuple[float, float]:
    """How the rest of Ψ ≅ Φ(1 + coefficient·Φ²) falls when Φ is halved, as a power of Φ, and its size at Φ = 0.2."""
    phi = np.array([0.2, 0.1])
    rest = np.abs(analyse(Oscillator(), name, dt=phi).angle - phi * (1 + coefficient * phi**2))
    return math.log2(rest[0] / rest[1]), float(rest[0])


@section("formula", "Damped and False Euler: Ψ ≅ Φ(1 + Φ²/24).", "`criteria(…)`: the exact series, by rational arithmetic")
def euler_series() -> Finding:
    """The rest is of the fifth power, 3Φ⁵/640."""
    orders = [_order(name, 1 / 24) for name in ("damped_euler", "false_euler")]
    return Finding(all(abs(power - 5) < 0.1 for power, _ in orders), f"the rest is {orders[1][1]:.1e} at Φ = 0.2 and falls as Φ⁵")


@section("formula", "Standard Heun: Ψ ≅ Φ(1 + Φ²/6).", "`criteria(…)`")
def heun_series() -> Finding:
    """The rest is of the fifth power, −Φ⁵/20."""
    power, rest = _order("standard_heun", 1 / 6)
    return Finding(abs(power - 5) < 0.1, f"the rest is {rest:.1e} at Φ = 0.2 and falls as Φ⁵")
