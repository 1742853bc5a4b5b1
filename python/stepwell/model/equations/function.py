"""A user's function for blocks of known shapes, as the modules that trace it see it."""

from typing import Any, Protocol

from ...base.arrays import Array, Shape


class TracedFunction(Protocol):
    """The part of ``trace.Equations`` that its invariants and its rates of series use.

    Attributes:
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        own_shapes: the lengths of each parameter's own axes; None for a parameter that depends on time.
    """

    v_shape: Shape
    y_shape: Shape
    own_shapes: dict[str, Any]

    @property
    def name(self) -> str:
        """The name of the function."""

    def own_axes(self, name: str) -> int:
        """How many axes of its own a parameter has."""

    def rates(self, t: Any, v: Array, y: Array, values: dict[str, Any], /) -> tuple[Array, Array]:
        """v̇ and ẏ."""

    def of_state(self, invariant: Any, t: Any, v: Array, y: Array, values: dict[str, Any], /) -> Any:
        """The value of an invariant."""
