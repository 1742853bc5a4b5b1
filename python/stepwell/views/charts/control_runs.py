"""The runs of a control chart: one method under one kind of control, with all gains as one batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...errors import ArgumentError, ShapeError
from ...model import controls
from ...model.methods import Method
from ...model.systems import System
from ...runs import engine
from ...runs.execution import quietly
from ...runs.result import Run

#: States of a run, evenly spaced, that are saved to measure energy, lengths and coordinates.
SAVED_STATES = 1000

#: Number of times at which the exact solution is evaluated for its scale.
SCALE_SAMPLES = 1001

#: The kinds of control of the lengths of rods: ``LengthControl``, and resetting, ``Projection("length")``.
LENGTH_KINDS = ("control", "length")

Whole = np.ndarray[Any, np.dtype[np.int64]]
Exact = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Held(ValueEquality):
    """One method under one kind of control, over the gains. Runs that diverged have infinite errors.

    Attributes:
        method: the method.
        kind: ``"none"``; a form of ``EnergyControl`` or a way of ``Projection``; for rods ``"control"`` for ``LengthControl`` and
            ``"length"`` for ``Projection("length")``.
        dt: the step, in units of time.
        steps: the number of steps.
        relative: the gains, h·C·K at the start, or c for rods, shape (gains,); one NaN if the kind has no gain.
        energy_error: the largest |E − E₀| of the saved states, divided by the kinetic energy at the start, or where that is zero
            by the largest of the exact motion, shape (gains,).
        state_error: the distance of the last state from the exact one, shape (gains,); NaN without an exact solution.
        largest: the largest coordinate of the saved states, shape (gains,).
        length_error: the largest relative error of a rod's length in the saved states, shape (gains,); NaN without rods.
        first_bad_step: the first step that was not finite, or −1, shape (gains,).
    """

    method: Method
    kind: str
    dt: float
    steps: int
    relative: Array
    energy_error: Array
    state_error: Array
    largest: Array
    length_error: Array
    first_bad_step: Whole

    @property
    def diverged(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """The gains at which a run diverged."""
        return self.first_bad_step >= 0


class Runs:
    """The runs of a chart: the system, its start, the horizon and the exact solution."""

    def __init__(self, system: System, v: Array, y: Array, horizon: float, exact: Exact | tuple[Any, Any] | None) -> None:
        self.system = system
        self.v = v
        self.y = y
        self.horizon = horizon
        self.end: tuple[Array, Array] | None = None
        self.energy = float(system.energy(v, y))
        self.kinetic = self._kinetic(v, y)
        blocks = None if exact is None else self._known(exact)
        if not self.kinetic > 0.0 and system.constraint is not None and blocks is not None:
            self.kinetic = float(self._kinetic(*(np.moveaxis(block, 0, -1) for block in blocks)).max())
        if not self.kinetic > 0.0:
            raise ArgumentError("v: a start at rest has no kinetic energy, which is the scale of gains and of energies here")
        if blocks is not None:
            self.scales = [float(_length(block, range(1, block.ndim)).max()) for block in blocks]

    def _kinetic(self, v: Array, y: Array) -> Any:
        return self.system.energy(v, y) - self.system.energy(np.zeros_like(v), y)

    def _known(self, exact: Exact | tuple[Any, Any]) -> tuple[Array, Array]:
        """Samples of the exact solution; ``end`` is the last."""
        shape = self.v.shape
        if callable(exact):
            blocks = exact(np.linspace(0.0, self.horizon, SCALE_SAMPLES))
            if not (isinstance(blocks, tuple) and [np.shape(block) for block in blocks] == [(SCALE_SAMPLES, *shape)] * 2):
                raise ShapeError(f"exact: expected a function of n times that returns v and y of shape (n, {str(shape)[1:]}")
            self.end = blocks[0][-1], blocks[1][-1]
            return blocks
        pair = checks.several("exact", exact, "blocks, v and y at the end")
        if len(pair) != 2:
            raise ShapeError(f"exact: expected a pair of blocks, v and y at the end, got {len(pair)} of them")
        pair = [checks.block("exact", block, shape, self.system.axes) for block in pair]
        self.end = pair[0], pair[1]
        return np.stack([self.v, pair[0]]), np.stack([self.y, pair[1]])

    def line(self, method: Method, kind: str, gains: Array, evaluations: int) -> Held:
        """Run a method under one kind of control, all gains at once, with this number of function evaluations."""
        steps = max(1, round(evaluations / engine.evaluations(method, self.system)))
        dt = self.horizon / steps
        relative = np.array([np.nan])
        control: controls.AnyControl | None = None
        if kind in controls.FORMS:
            relative, control = gains, controls.EnergyControl(form=kind, relative=gains)
        elif kind == LENGTH_KINDS[0]:
            relative, control = gains, controls.LengthControl(gains)
        elif kind != "none":
            control = controls.Projection(kind)
        shape = (*self.system.v_shape, len(relative))
        v, y = (np.broadcast_to(block[..., np.newaxis], shape) for block in (self.v, self.y))
        with np.errstate(all="ignore"):
            # No warnings: the chart shows which gains are too large.
            run = quietly(self.system, method, v=v, y=y, dt=dt, steps=steps, every=max(1, steps // SAVED_STATES), control=control)
            energy = np.abs(run.energy - self.energy).max(axis=0) / self.kinetic
            largest = np.abs(run.y).max(axis=tuple(range(run.y.ndim - 1)))
            rods = "length_error" in self.system.quantities
            lengths = run.quantity("length_error").max(axis=0) if rods else np.full(len(relative), np.nan)
            state = self._state_error(run)
        fell = run.first_bad_step >= 0
        energy, largest, state = (np.where(fell, np.inf, a) for a in (energy, largest, state))
        lengths = np.where(fell, np.inf, lengths) if rods else lengths
        return Held(method, kind, dt, steps, relative, energy, state, largest, lengths, run.first_bad_step)

    def _state_error(self, run: Run) -> Array:
        """The larger of the errors of the two blocks at the end, divided by the block's scale."""
        if self.end is None:
            return np.full(run.status.shape, np.nan)
        ends = zip((run.v[-1], run.y[-1]), self.end, self.scales, strict=True)
        own = range(len(self.system.y_shape))
        return np.maximum(*(_length(block - true[..., np.newaxis], own) / scale for block, true, scale in ends))


def _length(block: Array, axes: range) -> Array:
    return np.asarray(np.sqrt((block * block).sum(axis=tuple(axes))))
