"""What a scene is, and how wrong a run of it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .. import _checks
from .._checks import Array, Shape
from ..control import EnergyControl, Projection
from ..errors import ArgumentError
from ..integrate import integrate
from ..methods import Method
from ..result import Run
from ..systems import System

#: How many times of the horizon give the exact solution's scale.
SCALE_SAMPLES = 1001


@dataclass(frozen=True, eq=False)
class Scene:
    """A system with its start, a step and a time over which to judge a method.

    Attributes:
        name: what you type.
        title: what it is called in a picture.
        section: section of the document, and what is stepwell's own.
        description: what moves, and what it shows.
        error: what an error of 1 means here.
        system: what to step.
        v: velocity block at t = 0, of the system's ``v_shape``.
        y: coordinate block at t = 0, of the system's ``y_shape``.
        dt: the usual step, in units of time; the document's where it gives one.
        horizon: time over which errors are measured, in units of time.
        exact: the solution as a function of times of shape (n,): blocks v and y of shape (n, *block). A formula, or an orbit
            computed to more digits than a float holds; None for a chaotic motion, which nothing follows for long.
        until: the last time that ``exact`` is asked for, in units of time; errors after it are NaN, for they are not known.
        control: the control with which ``run`` steps, or None.
        period: time after which the exact solution is where it began, in units of time, or None.
    """

    name: str
    title: str
    section: str
    description: str
    error: str
    system: System
    v: Array
    y: Array
    dt: float
    horizon: float
    exact: Callable[[Array], tuple[Array, Array]] | None = None
    until: float = math.inf
    control: EnergyControl | Projection | None = None
    period: float | None = None

    def run(self, method: str | Method, dt: float | None = None, *, steps: int | None = None, **options: Any) -> Run:
        """Step the scene from its start.

        Args:
            method: its name, or what ``stepwell.method`` returns.
            dt: the step, in units of time; the scene's if None.
            steps: how many steps; if None, the least number that reaches the horizon.
            **options: further arguments of ``stepwell.integrate``, such as ``every`` or ``backend``. ``control`` is the
                scene's own if it is not given; ``control=None`` leaves it out.

        Returns:
            A ``Run`` with blocks of shape (saved, *block).

        Raises:
            ArgumentError: what was given and what was expected.
            UnsupportedError: if the method cannot do the system.

        Warns:
            DivergenceWarning: if the state left the range of finite numbers.
        """
        dt = self.dt if dt is None else dt
        steps = self.steps_for(dt) if steps is None else steps
        return integrate(self.system, method, v=self.v, y=self.y, dt=dt, steps=steps, **({"control": self.control} | options))

    def steps_for(self, dt: float) -> int:
        """The least number of steps of ``dt`` that reach the horizon.

        Raises:
            ArgumentError: if ``dt`` is no step, or needs more steps than can be counted.
        """
        dt = _checks.number("dt", dt, positive=True, unit="units of time")
        quotient = self.horizon / dt
        if quotient > _checks.LAST_STEP:
            raise ArgumentError(f"dt: {dt:g} needs more than {_checks.LAST_STEP} steps to reach {self.horizon:g}")
        # A quotient that misses a whole number by rounding alone asks for no further step.
        return max(1, math.ceil(quotient - 1e-9))

    def state_error(self, run: Run) -> Array:
        """How wrong each kept state is, shape (saved,); infinite where it is not finite, NaN where the true one is not known.

        The larger of the errors of the two blocks; that of a block is the length of its difference from the exact one,
        divided by the block's largest length in the exact solution. At 1 the error is as large as the solution.

        Raises:
            ArgumentError: if the scene has no exact solution.
        """
        exact, known = self._solution(run.t)
        with np.errstate(all="ignore"):
            errors = [
                _relative(_length(block - true, shape), scale)
                for block, true, shape, scale in zip((run.v, run.y), exact, self._shapes, self.scales, strict=True)
            ]
        error = np.maximum(*errors)
        return np.where(known, np.where(np.isfinite(error), error, np.inf), np.nan)

    def energy_error(self, run: Run) -> Array:
        """How wrong the energy of each kept state is, shape (saved,), relative to the largest kinetic energy.

        The kinetic energy is the scale because it has a zero of its own; that of a potential is a convention.
        Not finite and not known are as in ``state_error``.

        Raises:
            ArgumentError: if the scene has no exact solution.
        """
        (true_v, true_y), known = self._solution(run.t)
        with np.errstate(all="ignore"):
            error = np.abs(run.energy - self._energy(true_v, true_y)) / self._kinetic_scale
        return np.where(known, np.where(np.isfinite(error), error, np.inf), np.nan)

    def amplitude(self, run: Run) -> Array:
        """The larger of both blocks' lengths in each kept state, shape (saved,), in the exact solution's ``scales``."""
        with np.errstate(all="ignore"):
            lengths = [
                _relative(_length(block, shape), scale)
                for block, shape, scale in zip((run.v, run.y), self._shapes, self.scales, strict=True)
            ]
        return np.maximum(*lengths)

    @cached_property
    def scales(self) -> tuple[float, float]:
        """The largest lengths of v and of y in the exact solution over the horizon."""
        v, y = (float(_length(block, shape).max()) for block, shape in zip(self._sampled, self._shapes, strict=True))
        return v, y

    @cached_property
    def _sampled(self) -> tuple[Array, Array]:
        return self._solution(np.linspace(0.0, self.horizon, SCALE_SAMPLES))[0]

    @cached_property
    def _kinetic_scale(self) -> float:
        v, y = self._sampled
        return float((self._energy(v, y) - self._energy(np.zeros_like(v), y)).max())

    @property
    def _shapes(self) -> tuple[Shape, Shape]:
        return self.system.v_shape, self.system.y_shape

    def _solution(self, t: Array) -> tuple[tuple[Array, Array], np.ndarray[Any, np.dtype[np.bool_]]]:
        """The exact blocks, and at which times they are known; at the others they are those of the last known time."""
        if self.exact is None:
            raise ArgumentError(f"scene: {self.name} has no exact solution, so there is no error to measure")
        return self.exact(np.minimum(t, self.until)), t <= self.until

    def _energy(self, v: Array, y: Array) -> Array:
        return self.system.energy(np.moveaxis(v, 0, -1), np.moveaxis(y, 0, -1))

    def __repr__(self) -> str:
        return f"<scene {self.name}: {self.title}, dt = {self.dt:g}, horizon {self.horizon:g}>"


def _relative(length: Array, scale: float) -> Array:
    """Lengths in a scale; in that of a block that is always zero, or empty, zero is zero and all else infinite."""
    return length / scale if scale else np.where(length == 0.0, 0.0, np.inf)


def _length(block: Array, shape: Shape) -> Array:
    """The length of a block of that shape at each time."""
    return np.asarray(np.sqrt((block * block).sum(axis=tuple(range(1, 1 + len(shape))))))
