"""A user's own equations: their function, run with the numbers of a state."""

import copy
from typing import Any

import numpy as np

from ...base.arrays import Array
from ..bits import where
from ..friction import OnOne, OnVectors, Separate


class Equations:
    """The rates as ``rates`` computes them from the time, the state, and parameters and inputs by name.

    ``rates`` runs the user's function over arrays whose last axes are those of the batch. Under a control both rates are pushed
    along the gradient of an invariant I, by −gain·(I − target)·∇I/|∇I|², so that I − target decays as exp(−gain·t) (Baumgarte
    1972); the limited form uses gain/(1 + h·gain), as backward Euler would, for which no gain is too large.
    """

    def __init__(self, h: float, /, **parameters: Any) -> None:
        self.h = np.asarray(h)
        self.equations = parameters.pop("equations()")
        self.gain, self.target = parameters.pop("control.gain", None), parameters.pop("control.target", None)
        self.parameters = parameters

    def stretched(self, h: Any) -> "Equations":
        """The system scaled to another step, which may be one for each member: what a limited control pushes depends on it."""
        other = copy.copy(self)
        other.h = np.asarray(h)
        return other

    def rates(self, t: float, v: Array, y: Array) -> tuple[Array, Array]:
        """v̇ and ẏ."""
        rates: tuple[Array, Array] = self.equations.rates(t, v, y, self.parameters)
        if self.gain is None:
            return rates
        push, along = self._push(v, y), self.gradient(v, y)
        return rates[0] - push * along[0], rates[1] - push * along[1]

    def _push(self, v: Array, y: Array) -> Any:
        """The multiple of the gradient that is added to both rates; zero where the gradient is."""
        square = self.gradient(v, y)[2]
        gain = self.gain[()]
        if self.equations.limited:
            gain = gain / (1.0 + self.h[()] * gain)
        off = self._invariant().value(v, y, self.parameters) - self.target[()]
        return where(square > 0.0, (gain * off) / square, 0.0)

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.h * self.rates(t, v, y)[0]

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * (v if self.equations.second_order else self.rates(t, v, y)[1])

    @property
    def mass_matrix(self) -> Any:
        """The mass matrix, if equations are algebraic: dy is then h·f of M·ẏ = f."""
        return self.equations.mass_matrix

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        velocity: Array = d / self.h
        return velocity

    def _invariant(self) -> Any:
        return self.equations.invariants[self.equations.kept]

    def energies(self, v: Array, y: Array) -> tuple[Any, Any, Any]:
        """Zero for h·v̇ and for the kinetic energy, and the invariant that is kept, times h."""
        return None, None, self.h * self._invariant().value(v, y, self.parameters)

    def gradient(self, v: Array, y: Array, dv: Any = None) -> tuple[Array, Array, Any]:
        """The derivatives of the invariant that is kept by v and y, and the square of their length."""
        along_v, along_y, square = self._invariant().gradient(v, y, self.parameters)
        (own_v, own_y), (batch_v, batch_y) = self.equations.shapes, self.equations.batches(v, y)
        return stacked(along_v, own_v, batch_v), stacked(along_y, own_y, batch_y), square

    def friction(self, t: float, v: Array, y: Array) -> Separate:
        """The friction that sticks, with h times its decelerations."""
        limit, along = self.equations.friction(t, v, y, self.parameters)
        limit, on = self.h * limit, self.equations.friction_on
        if on.component is not None:
            return OnOne(limit, on.component, along)
        return Separate(limit) if on.of == "component" else OnVectors(limit, len(self.equations.v_shape) - 1)

    def record(self, name: str, v: Array, y: Array) -> Array:
        """An invariant of a state."""
        value: Array = self.equations.invariants[name].value(v, y, self.parameters)
        return value


def stacked(rows: list[Any], own: tuple[int, ...], batch: tuple[int, ...]) -> Any:
    """Numbers, symbols or series as a block of this shape, whose last axes are those of the batch."""
    kind = object if any(np.asarray(row).dtype == object for row in rows) else float
    block = np.empty((len(rows), *np.broadcast_shapes(batch, *(np.shape(row) for row in rows))), dtype=kind)
    for i, row in enumerate(rows):
        block[i] = row
    return block.reshape((*own, *block.shape[1:]))
