"""The prepared real-time loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _checks, _core, engine
from ._checks import Array
from .control import EnergyControl, Projection
from .errors import ArgumentError, DTypeError, ShapeError
from .integrate import fits_together
from .methods import Method
from .methods import method as find_method
from .systems import System


class World:
    """A loop over the user's own arrays: everything is checked and prepared once, then ``step`` works in place.

    Args:
        system: what to step.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block, a writeable C-contiguous float64 array of shape (*block, *batch).
        y: coordinate block, likewise; it may share no memory with ``v``.
        dt: the step, in units of time, above zero.
        t0: time of step 0.
        start_step: number of the first step.
        start: how a method with a choice starts.
        control: what keeps the energy: an ``EnergyControl`` or a ``Projection``.

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if the method cannot do the system.

    ``step(n)`` steps in place and allocates nothing: it is meant for the few microseconds of a frame, and keeps the GIL for
    them. A method that carries something else than v (Verlet) keeps it inside; if you change ``v`` or ``y`` between steps, it
    starts anew from what you wrote. Nothing looks for divergence here: ``numpy.isfinite`` on your arrays does.
    """

    __slots__ = ("_core", "_v", "_y", "dt", "method", "step", "system")

    def __init__(
        self,
        system: System,
        method: str | Method,
        *,
        v: Array,
        y: Array,
        dt: float,
        t0: float = 0.0,
        start_step: int = 0,
        start: str | None = None,
        control: EnergyControl | Projection | None = None,
    ) -> None:
        if not isinstance(system, System):
            raise DTypeError(f"system: expected a stepwell system such as Oscillator(), got {type(system).__name__}")
        self.system = system = system.sized(v, y)
        self.method = find_method(method)
        fits_together(system, self.method)
        self.dt = _checks.number("dt", dt, positive=True, unit="units of time")
        t0 = _checks.number("t0", t0, unit="units of time")
        batch = np.shape(y)[len(system.y_shape) :]
        self._v = _checks.in_place("v", v, (*system.v_shape, *batch))
        self._y = _checks.in_place("y", y, (*system.y_shape, *batch))
        if np.shares_memory(v, y):
            raise ArgumentError("v and y: expected two arrays to step in place, got arrays that share memory")
        if _checks.batch_shape({"system": system.batch, "v and y": batch}) != batch:
            raise ShapeError(f"v and y: the system's batch {system.batch} does not broadcast to theirs, {batch}")
        first = _checks.count("start_step", start_step, 0)
        if control is not None:
            if not isinstance(control, (EnergyControl, Projection)):
                raise DTypeError(f"control: expected an EnergyControl or a Projection, got {type(control).__name__}")
            if _checks.batch_shape({"control": control.batch, "v and y": batch}) != batch:
                raise ShapeError(f"control: its batch {control.batch} does not broadcast to that of v and y, {batch}")
            self.system = system = system.controlled(control, self._v, self._y, self.dt)
            fits_together(system, self.method)
        system.check_time(abs(t0) + first * self.dt)
        plan = engine.Plan(system, self.method, batch, self.dt, t0, first, choice=self.method.start_choice(start))
        # Views: the core knows rows, not axes.
        self._core = _core.World(engine.model(plan), plan, self._v.reshape(-1), self._y.reshape(-1))
        #: ``step(n=1)`` makes n steps in place.
        self.step: Any = self._core.step

    @property
    def v(self) -> Array:
        """The velocities, the array that was given."""
        return self._v

    @property
    def y(self) -> Array:
        """The coordinates, the array that was given."""
        return self._y

    @property
    def t(self) -> float:
        """The time at which the world stands: t0 + k·dt."""
        return self._core.t

    @property
    def step_number(self) -> int:
        """The number of the step at which the world stands."""
        return self._core.step_number
