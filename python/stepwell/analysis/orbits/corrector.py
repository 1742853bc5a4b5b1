"""The symplectic correctors of Wisdom and Holman's method, as changes of coordinates before and after a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Blocks
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.parameters import aligned
from ...model.systems import NBody
from ...reference import corrector
from ...runs.result import Run
from .hierarchy import newtonian


def corrected(system: Any, v: Any, y: Any, *, dt: Any, order: int = 7) -> Blocks:
    """The start of a run by ``wisdom_holman`` whose states are to be corrected.

    Its steps move in coordinates that differ from the true ones by the masses of the planets in units of the star's. A run that
    starts from the changed state and whose states are changed back has an error of the square of these masses, and of their first
    power a remainder that falls with the step.

    Args:
        system: the bodies, under Newton's force.
        v: their velocities, shape (bodies, dim, *batch).
        y: their places, likewise.
        dt: the step of the run.
        order: 3, 5 or 7: the power of the step up to which the first power of the masses is gone.

    Returns:
        v and y from which to start, of the same shape.

    Raises:
        ArgumentError: if an argument is wrong, or the step is too long: Kepler's motion is followed over up to 2.6 steps.
        UnsupportedError: if the force is another one.

    Example:
        >>> bodies, v, y = sw.orbits.system([1.0, 1e-3, 3e-4], a=[5.2, 9.5], e=0.05, G=sw.orbits.gravity())
        >>> start = sw.orbits.corrected(bodies, v, y, dt=0.5)
        >>> run = sw.integrate(bodies, "wisdom_holman", v=start[0], y=start[1], dt=0.5, steps=5000, every=10)
        >>> energy = bodies.energy(*(np.moveaxis(block, 0, -1) for block in sw.orbits.uncorrected(run)))
        >>> bool(np.abs(energy / energy[0] - 1.0).max() < 1e-8 < np.abs(run.energy / run.energy[0] - 1.0).max())
        True
    """
    order = _order(order)
    bodies = newtonian("system", system).for_state_shapes(v, y)
    v, y = (checks.block(name, block, bodies.v_shape, "bodies, dim") for name, block in (("v", v), ("y", y)))
    return _changed(bodies, v, y, checks.step(dt), corrector.corrected, order)


def uncorrected(of: Any, v: Any = None, y: Any = None, *, dt: Any = None, order: int = 7) -> Blocks:
    """The true states of a run that began from ``orbits.corrected``.

    Args:
        of: the run, by ``wisdom_holman``, or the bodies alone.
        v: with bodies alone, their velocities, shape (bodies, dim, *batch).
        y: their places, likewise.
        dt: with bodies alone, the step.
        order: that of the corrector.

    Returns:
        v and y, of the shape of those of the run, or of the state. Of members that diverged they are NaN.

    Raises:
        ArgumentError: if an argument is wrong, or the step is too long: Kepler's motion is followed over up to 2.6 steps.
        UnsupportedError: if the run is by another method, or has a force from outside.

    Example:
        >>> bodies, v, y = sw.orbits.system([1.0, 1e-3, 3e-4], a=[5.2, 9.5], e=0.05, G=sw.orbits.gravity())
        >>> start = sw.orbits.corrected(bodies, v, y, dt=0.6, order=5)
        >>> back = sw.orbits.uncorrected(bodies, *start, dt=0.6, order=5)
        >>> bool(np.abs(back[1] - y).max() < 1e-13)
        True
    """
    order = _order(order)
    if not isinstance(of, Run):
        bodies = newtonian("of", of)
        if v is None or y is None or dt is None:
            raise ArgumentError("v, y, dt: expected the state of the bodies and the step, got none; a run has its own")
        bodies = bodies.for_state_shapes(v, y)
        v, y = (checks.block(name, block, bodies.v_shape, "bodies, dim") for name, block in (("v", v), ("y", y)))
        return _changed(bodies, v, y, checks.step(dt), corrector.uncorrected, order)
    if v is not None or y is not None or dt is not None:
        raise ArgumentError("v, y, dt: expected none beside a run, which has its own")
    bodies = newtonian("of", of.system)
    if not of.method.splits or of.force is not None:
        what = "a force from outside" if of.method.splits else f"a run by {of.method.name}"
        raise UnsupportedError(f"of: expected a run by wisdom_holman, which a corrector belongs to, got {what}")
    # The saved states become the first axis of the batch.
    v, y = _changed(bodies, np.moveaxis(of.v, 0, 2), np.moveaxis(of.y, 0, 2), of.dt, corrector.uncorrected, order)
    return np.moveaxis(v, 2, 0), np.moveaxis(y, 2, 0)


def _order(order: Any) -> int:
    order = checks.count("order", order, -checks.LAST_STEP)  # all of one error, which names those that there are
    if order not in corrector.KICKS:
        raise ArgumentError(f"order: expected one of {', '.join(map(str, corrector.KICKS))}, got {order}")
    return int(order)


def _changed(bodies: NBody, v: Array, y: Array, dt: float, change: Any, order: int) -> Blocks:
    """States of shape (bodies, dim, *batch) in other coordinates."""
    if len(bodies.masses) < 2:
        raise ShapeError("system: expected two bodies or more, got one")
    if not (bodies.masses[0] > 0.0).all():
        raise ArgumentError("system: expected the first body to have a mass, got 0")
    batch = checks.batch_shape({"v": v.shape[2:], "y": y.shape[2:], "system": bodies.batch})
    checks.fits("v, y: the states", 40.0 * v.shape[0] * v.shape[1], batch, "select fewer saved states")
    v, y = (np.broadcast_to(aligned(block, 2, batch), (*block.shape[:2], *batch)) for block in (v, y))
    with np.errstate(all="ignore"):
        new: Blocks = change(bodies.scaled(dt, batch), 0.0, v, y, order)
    lost = ~(np.isfinite(new[0]) & np.isfinite(new[1])) & np.isfinite(v) & np.isfinite(y)
    if lost.any():
        raise ArgumentError(
            f"dt: expected a step over some of which Kepler's motion can be followed from every state, got {dt:g}; take shorter "
            f"steps or a corrector of a lower order than {order}"
        )
    return new
