"""The words of the reference: an array, both blocks, and a system scaled to the step."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Blocks = tuple[Array, Array]


class Scaled(Protocol):
    """A system scaled to the step h: its rates times h."""

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d; second-order systems only."""


class Signal(Protocol):
    """An input as a function of time."""

    def at(self, t: float) -> Array:
        """The value at time t."""

    def scaled(self, factor: Array) -> "Signal":
        """The same input, times a factor."""
