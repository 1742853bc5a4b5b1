"""Lyapunov exponents as an outcome."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _checks
from ..errors import ArgumentError
from ..systems import System
from .outcomes import Found, Outcome, Variable


class Exponents(Outcome):
    """The largest Lyapunov exponents, ``lyapunov``, by ``stepwell.lyapunov`` over the steps after the transient.

    Not with ``control``, ``force``, ``fused``, ``start`` or float32.

    Args:
        exponents: how many, or "all".
        every: steps from one orthonormalisation to the next.

    Example:
        >>> axes = {"damping": ("damping", [0.1, 0.2])}
        >>> of = sw.sweeps.Exponents("all")
        >>> found = sw.sweep(sw.Oscillator, {"omega": [1.0], **axes}, "rk4", v=0.0, y=1.0, dt=0.1, steps=200, outcomes=of)
        >>> found.lyapunov.sum("exponent").values.round(4)
        array([[-0.2, -0.4]])
    """

    observes = False

    def __init__(self, exponents: int | str = 1, every: int = 10) -> None:
        if isinstance(exponents, str):
            _checks.known("exponents", exponents, ("all",))
        else:
            exponents = _checks.count("exponents", exponents, 1)
        self.exponents, self.every = exponents, _checks.count("every", every, 1)

    def of_start(self, system: System, method: str, given: dict[str, Any], transient: int, steps: int) -> Found:
        """Of members that start so."""
        from ..dynamics import lyapunov

        if refused := [name for name in ("control", "dtype", "force", "fused", "start") if given.get(name)]:
            raise ArgumentError(f"{', '.join(refused)}: goes without Lyapunov exponents, which are those of plain steps")
        start = {name: given[name] for name in ("v", "y", "dt", "t0") if name in given}
        found = lyapunov(system, method, steps=steps, transient=transient, exponents=self.exponents, every=self.every, **start)
        return {
            "lyapunov": Variable(
                ("exponent",), np.array(found.exponents), "Lyapunov exponents per unit of time, the largest first"
            )
        }
