"""Any linear system (§3): ṡ = A·s + B·x with the state s = (v, y), and auxiliary outputs z = C·s + D·x."""

from collections.abc import Sequence

from ...base.arrays import Array, Signal
from ..product import times


class Linear:
    """``rows`` is [A B], of shape (n, n + inputs, *batch); its first ``n_v`` rows and columns belong to v, the next to y.

    ``kind`` is "acceleration" if ẏ is v times a number and v̇ does not depend on v; nothing here asks for it.
    """

    def __init__(self, h: float, n_v: int, rows: Array, inputs: Sequence[Signal], kind: str = "") -> None:
        rows = h * rows
        self.of_v, self.of_y, self.inputs = rows[:n_v], rows[n_v:], inputs

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        return times(self.of_v, [*v, *y, *(x.at(t) for x in self.inputs)])

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return times(self.of_y, [*v, *y, *(x.at(t) for x in self.inputs)])

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d, where ẏ is v times a number."""
        velocity: Array = d / self.of_y[0, 0]
        return velocity
