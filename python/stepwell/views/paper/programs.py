"""Appendix B: each method as a program that steps by its formulas or by its transition matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...model.systems import Oscillator
from ...runs.execution import quietly
from . import Finding, Section

section = Section("App. B")

#: The methods of the seven programs, in the order of the appendix.
METHODS = ("standard_euler", "damped_euler", "false_euler", "verlet", "standard_heun", "false_heun", "semi_false_heun")


@section(
    "program",
    "Seven programs. Each integrates directly or steps by its transition matrix.",
    '`integrate(…, form="direct")`, `form="matrix"`',
)
def both_forms() -> Finding:
    """The samples of both forms of each method: ω₀ = 2, T = 0.1, 200 steps from v = 0, y = 1."""
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 200, "every": 1}
    apart = [
        float(
            np.abs(quietly(Oscillator(2.0), name, **options).y - quietly(Oscillator(2.0), name, form="matrix", **options).y).max()
        )
        for name in METHODS
    ]
    return Finding(max(apart) < 1e-12, "both forms of all seven methods give the same samples, to rounding")


@section(
    "program",
    "Verlet starts with y₋₁ = y₀ for v₀ = 0.",
    '`integrate(…, "verlet", start="first_order")`',
    "That start is of first order; y₋₁ = y₀ − T·v₀ + ½T²·a₀ is of second order.",
)
def verlet_program() -> Finding:
    """The printed recursion against the method."""
    phi, now, before, y = 0.5, 1.0, 1.0, [1.0]
    for _ in range(50):
        now, before = 2 * now - before + phi**2 * -now, now
        y.append(now)
    run = quietly(Oscillator(), "verlet", v=0.0, y=1.0, dt=phi, steps=50, every=1, start="first_order")
    apart = float(np.abs(run.y - y).max())
    return Finding(apart < 1e-13, "the printed recursion and the method: the same samples, to rounding")
