"""The interface of a user's function for blocks of known shapes."""

from typing import Any, Protocol

from ...base.arrays import Array, Shape
from ...reference.mass import Mass


class TracedFunction(Protocol):
    """The part of ``trace.Equations`` that invariants and Taylor series need.

    Attributes:
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        own_shapes: the lengths of each parameter's own axes; None for a parameter that depends on time.
    """

    v_shape: Shape
    y_shape: Shape
    own_shapes: dict[str, Any]

    @property
    def mass_matrix(self) -> Mass | None:
        """The mass matrix if equations are algebraic."""

    @property
    def name(self) -> str:
        """The name of the function."""

    def own_axes(self, name: str) -> int:
        """How many axes of its own a parameter has."""

    def rates(self, t: Any, v: Array, y: Array, values: dict[str, Any], /) -> tuple[Array, Array]:
        """The rates (v̇, ẏ) of a state."""

    def of_state(self, invariant: Any, t: Any, v: Array, y: Array, values: dict[str, Any], /) -> Any:
        """The value of an invariant at a state."""
