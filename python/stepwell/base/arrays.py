"""Types of the reference: an array, both blocks, a system scaled to the step, and an input."""

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Whole = NDArray[np.int64]
else:  # numpy.typing takes as long to import as all of stepwell's own files
    Array = Whole = np.ndarray

Blocks = tuple[Array, Array]
Shape = tuple[int, ...]


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
        """The input times a factor."""
