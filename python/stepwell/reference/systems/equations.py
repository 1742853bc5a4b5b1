"""A user's own equations: their function, run with the numbers of a state."""

from typing import Any

import numpy as np

from ..types import Array


class Equations:
    """The rates are what ``rates`` makes of the time, the state and what the system is given by name.

    ``rates`` runs the user's function over arrays whose last axes are those of the batch.
    """

    def __init__(self, h: float, /, **given: Any) -> None:
        self.h = np.asarray(h)
        self.equations = given.pop("equations()")
        self.given = given

    def rates(self, t: float, v: Array, y: Array) -> tuple[Array, Array]:
        """v̇ and ẏ."""
        rates: tuple[Array, Array] = self.equations.rates(t, v, y, self.given)
        return rates

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.h * self.rates(t, v, y)[0]

    def dy(self, t: float, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * (v if self.equations.second_order else self.rates(t, v, y)[1])

    def velocity(self, d: Array) -> Array:
        """The v whose increment of y is d."""
        velocity: Array = d / self.h
        return velocity
