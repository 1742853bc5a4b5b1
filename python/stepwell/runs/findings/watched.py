"""Steps of a world, watched for findings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...errors import AccuracyWarning
from ...model.methods import Method
from ...model.systems import Springs, System
from ..finding import Finding, named, warn_of
from . import may_have_amounts
from .growth import MOST_NUMBERS, growth

#: A world first checks its state after ``FIRST_CHECK`` steps. Each interval is twice the one before, up to ``LAST_CHECK`` steps:
#: by then a state that grows by a thousandth a step has grown a millionfold. Calls of ``step`` may be shorter or longer.
FIRST_CHECK, LAST_CHECK, ENDLESS = 8, 16_384, 1 << 62


def watched(
    make: Callable[..., bool], loop: Any, system: System, method: Method, dt: float, v: Array, y: Array, grows: bool
) -> Callable[..., None]:
    """``make``, the ``step`` of a world, that warns once if the state is no longer finite.

    With ``grows``, it checks the state now and then as well, and warns once of growth by steps alone.
    """
    grows = grows and v.size + y.size <= MOST_NUMBERS
    start = (np.array(v, dtype=np.float64), np.array(y, dtype=np.float64)) if grows else (v, y)
    first, t0 = loop.step_number, loop.t
    every, has_diverged = FIRST_CHECK, False
    left = every if grows else ENDLESS
    waits, pause = 0, 1

    def check() -> int:
        """Check the state, and return the number of steps until the next check, ``ENDLESS`` if there is none."""
        nonlocal every
        if loop.changes:
            return ENDLESS  # what was set may explain the growth
        grown = growth(system, method, dt, loop.step_number - first, t0, start, (v, y))
        found = None if grown is None else grown.finding()
        if found is None and (about := system.doubt(y[np.newaxis])) is not None:
            found = Finding(AccuracyWarning, *about)
        if found is None and isinstance(system, Springs) and system.keeper is None:
            from .gain import GAINED, gain  # only such worlds need it

            found = gain(system, method, dt, list(zip(start, (v, y), strict=True)), GAINED)
        if found is not None:
            warn_of([found], 3)
            return ENDLESS
        every *= 2
        return every if every <= LAST_CHECK else ENDLESS

    def diverged() -> None:
        nonlocal has_diverged
        has_diverged = True
        from . import divergence  # only such worlds need it

        both = zip((v, y), (system.v_shape, system.y_shape), strict=True)
        lost = np.any([~np.isfinite(block).all(axis=tuple(range(len(own)))) for block, own in both], axis=0)
        where = f", before step {loop.step_number} (t = {loop.t:g})"
        warn_of([divergence.diverged(lost, named(lost, alone="the state"), where, method, dt)], 3)

    def step(n: int = 1) -> None:
        """Make n steps in place."""
        nonlocal left
        if make(n) and not has_diverged:
            diverged()
        left -= n or 1  # None is one step, too
        if left <= 0:
            left = check()

    if not (grows and y.size and may_have_amounts(system)):
        return step
    from .negative import negative  # only such worlds need it

    def step_of_amounts(n: int = 1) -> None:
        """Make n steps in place; after calls 1, 2, 4, … negative numbers are looked for, which takes ten times a short step."""
        nonlocal waits, pause
        waits -= 1
        looks = waits <= 0 and not y.min() < 0.0  # else it was set so
        step(n)
        if waits > 0:
            return
        waits = pause = min(2 * pause, LAST_CHECK)
        if not looks or loop.changes or not y.min() < 0.0:
            return
        if (amounts := negative(system, method, (start[1], y), loop.t)) is not None:
            warn_of([amounts.finding()], 2)
            waits = ENDLESS

    return step_of_amounts
