"""Rosenbrock methods by their coefficients, as Hairer and Wanner print them (*Solving Ordinary Differential Equations II*, IV.7).

Stage i is the solution of linear equations, (M − γhJ)·uᵢ = γ·(h·f(t + αᵢh, y + Σ aᵢⱼuⱼ) + M·Σ cᵢⱼuⱼ + dᵢ·h²·∂f/∂t), with the
Jacobian J and ∂f/∂t of the start of the step, and the mass matrix M of the system, or that of units.
"""

from __future__ import annotations

from typing import NamedTuple

from ..base.arrays import Array, Scaled
from . import mass
from .implicit import Implicit
from .tableau import Increments, Weights, combined, plus


class Rosenbrock(NamedTuple):
    """The coefficients.

    Attributes:
        gamma: γ.
        nodes: αᵢ.
        by_time: dᵢ.
        rows: aᵢⱼ, a row for each stage, and the same of cᵢⱼ.
        of_solutions: cᵢⱼ.
    """

    gamma: float
    nodes: Weights
    by_time: Weights
    rows: tuple[Weights, ...]
    of_solutions: tuple[Weights, ...]


def stages(method: Rosenbrock, s: Scaled, t: float, h: float, v: Array, y: Array, count: int | None = None) -> Increments:
    """The solutions uᵢ of both blocks, one stage after the other; the first few of them, or all."""
    gamma = method.gamma
    equations = Implicit(s, t, v, y)
    solutions: Increments = []
    for node, by_time, row, of_solutions in list(zip(*method[1:], strict=True))[:count]:
        at = t + node * h if node not in (0.0, 1.0) else t + h if node else t
        vi, yi = plus(v, y, row, solutions) if row else (v, y)
        right_v, right_y = s.dv(at, vi, yi), s.dy(at, vi, yi)
        if of_solutions:
            sum_v, sum_y = combined(of_solutions, solutions)
            right_v, right_y = right_v + sum_v, right_y + mass.times(s, sum_y)
        if by_time:
            time_v, time_y = equations.by_time(h)
            right_v, right_y = right_v + by_time * time_v, right_y + by_time * time_y
        solutions.append(equations.solve(gamma, gamma * right_v, gamma * right_y))
    return solutions
