"""Lyapunov exponents as an outcome."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError
from ...model.methods import Method
from ...model.systems import System
from .outcomes import Outcome, Results, Variable


class Exponents(Outcome):
    """The largest Lyapunov exponents, ``lyapunov``, by ``stepwell.lyapunov`` over the steps after the transient.

    Not with ``control``, ``force``, ``fused``, ``start`` or float32.

    Args:
        exponents: the number of exponents, or "all".
        every: steps from one orthonormalisation to the next. With a tolerance, these are at the times of ``at``.
        transient: with a tolerance, the number of omitted intervals between the times ``t0`` and those of ``at``. With fixed
            steps, the steps of the sweep's ``transient`` are omitted.

    Example:
        >>> axes = {"damping": ("damping", [0.1, 0.2])}
        >>> of = sw.sweeps.Exponents("all")
        >>> found = sw.sweep(sw.Oscillator, {"omega": [1.0], **axes}, "rk4", v=0.0, y=1.0, dt=0.1, steps=200, outcomes=of)
        >>> found.lyapunov.sum("exponent").values.round(4)
        array([[-0.2, -0.4]])
    """

    observes = False

    def __init__(self, exponents: int | str = 1, every: int = 10, transient: int = 0) -> None:
        if isinstance(exponents, str):
            checks.known("exponents", exponents, ("all",))
        else:
            exponents = checks.count("exponents", exponents, 1)
        self.exponents, self.every = exponents, checks.count("every", every, 1)
        self.transient = checks.count("transient", transient, 0)

    def of_start(
        self,
        system: System,
        method: Method,
        options: dict[str, Any],
        transient: int,
        steps: int,
        look: Callable[[], object],
        at: Array | None = None,
    ) -> Results:
        """The exponents of members with these start values and options.

        ``look`` is called now and then, and may raise. ``at`` has the output times of adaptive steps.
        """
        from ...analysis.dynamics.exponents import adaptive_averages, averages

        if refused := [name for name in ("control", "dtype", "force", "fused", "start") if options.get(name)]:
            raise ArgumentError(f"{', '.join(refused)}: goes without Lyapunov exponents, which are those of plain steps")
        more: dict[str, Any] = {"exponents": self.exponents, "t0": options["t0"], "keep_history": False}
        more |= {"look": look, "threads": 1}
        v, y, dt = options.get("v"), options["y"], options.get("dt")
        if at is None:
            averaged = averages(system, method, v, y, dt, steps, transient=transient, every=self.every, **more)
        else:
            more |= {"dt": dt, "max_steps": options.get("max_steps"), "transient": self.transient}
            averaged = adaptive_averages(system, method, v, y, options["tolerance"], at, **more)
        return {
            "lyapunov": Variable(
                ("exponent",), np.array(averaged.exponents), "Lyapunov exponents per unit of time, the largest first"
            )
        }
