"""Quantities that can be recorded of a state, beside v and y."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

from ..base.arrays import Array, Shape


class Quantity(NamedTuple):
    """A quantity of a state.

    Attributes:
        of: its formula, a function of the system that is scaled to the step, v and y: a number for each member, or a vector along
            the first axis.
        shape: its shape in so many dimensions.
    """

    of: Callable[[Any, Array, Array], Array]
    shape: Callable[[int], Shape] = lambda dim: ()


class Recorded:
    """The base class of systems of which quantities can be recorded.

    Attributes:
        quantities: these by name; the energy of a system is the one of that name.
    """

    quantities: ClassVar[dict[str, Quantity]]

    def record(self, name: str, v: Array, y: Array) -> Array:
        """A quantity of a state: a number for each member, or a vector along the first axis."""
        return self.quantities[name].of(self, v, y)


def of_spin(dim: int) -> Shape:
    """The shape of an angular momentum: one number in the plane, three in space."""
    return () if dim == 2 else (3,)
