"""Appendix A: the frequencies as Taylor series."""

from __future__ import annotations

import math

import numpy as np

from ...analysis.stability import analyse
from ...model.systems import Oscillator
from . import Finding, Section

section = Section("App. A")


def _order(name: str, coefficient: float) -> tuple[float, float]:
    """The order of the remainder of Ψ ≅ Φ(1 + coefficient·Φ²), from Φ = 0.2 and 0.1, and its size at Φ = 0.2."""
    phi = np.array([0.2, 0.1])
    remainder = np.abs(analyse(Oscillator(), name, dt=phi).angle - phi * (1 + coefficient * phi**2))
    return math.log2(remainder[0] / remainder[1]), float(remainder[0])


@section("formula", "Damped and False Euler: Ψ ≅ Φ(1 + Φ²/24).", "`criteria(…)`: the exact series, by rational arithmetic")
def euler_series() -> Finding:
    """The remainder is 3Φ⁵/640 in leading order."""
    orders = [_order(name, 1 / 24) for name in ("damped_euler", "false_euler")]
    return Finding(
        all(abs(power - 5) < 0.1 for power, _ in orders), f"the remainder is {orders[1][1]:.1e} at Φ = 0.2 and falls as Φ⁵"
    )


@section("formula", "Standard Heun: Ψ ≅ Φ(1 + Φ²/6).", "`criteria(…)`")
def heun_series() -> Finding:
    """The remainder is −Φ⁵/20 in leading order."""
    power, remainder = _order("standard_heun", 1 / 6)
    return Finding(abs(power - 5) < 0.1, f"the remainder is {remainder:.1e} at Φ = 0.2 and falls as Φ⁵")
