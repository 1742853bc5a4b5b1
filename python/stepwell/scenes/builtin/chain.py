"""A chain of masses and springs in a sum of its normal modes; each mode is an oscillator of §3."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import count, number, short
from ...errors import ArgumentError, DTypeError
from ...model.systems import Chain
from ..base import Scene


def chain(n: Any = 8, modes: Mapping[int, float] | None = None) -> Scene:
    """Unit masses and springs between two walls, from rest in a sum of normal modes, over ten periods of the slowest.

    Mode j swings with ω_j = 2·sin(½πj/(n + 1)) in the shape sin(πij/(n + 1)), i = 1 … n. The default is the slow motion
    that one observes, with a little of the fastest mode, which alone limits the step.

    Args:
        n: how many masses, one or more.
        modes: amplitude of each mode by its number, 1 … n; if None, 1 of the slowest and 0.05 of the fastest.
    """
    system = Chain(n)
    n = system.n
    modes = ({1: 1.0} | ({n: 0.05} if n > 1 else {})) if modes is None else modes
    if not isinstance(modes, Mapping):
        raise DTypeError(f"modes: expected a mapping of numbers of modes to amplitudes, got {short(modes)}")
    if not modes:
        raise ArgumentError("modes: expected the amplitude of at least one mode, got none")
    number_of = np.array([count("modes", j, 1, n) for j in modes])
    amplitude = np.array([number(f"modes[{j}]", a) for j, a in modes.items()])
    omega = 2.0 * np.sin(0.5 * np.pi * number_of / (n + 1))
    shapes = np.sin(np.pi * number_of[:, np.newaxis] * np.arange(1, n + 1) / (n + 1))

    def exact(t: Array) -> tuple[Array, Array]:
        angle = t[:, np.newaxis] * omega
        return (-amplitude * omega * np.sin(angle)) @ shapes, (amplitude * np.cos(angle)) @ shapes

    v, y = exact(np.zeros(1))
    return Scene(
        name="chain",
        title=f"Chain of {n} masses",
        section="§3",
        description="Masses and springs in a slow mode with a little of the fastest, which alone limits the step.",
        error="as far from the true displacements or velocities as the largest true ones",
        system=system,
        v=v[0],
        y=y[0],
        dt=0.3,
        horizon=float(20.0 * np.pi / omega.min()),
        exact=exact,
    )
