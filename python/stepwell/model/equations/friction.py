"""Friction that sticks, of users' own systems: a function of the state says how much it can decelerate."""

from __future__ import annotations

from collections.abc import Callable, Collection
from types import FunctionType
from typing import Any, Literal, NamedTuple, get_args

from ...base import checks
from ...base.arrays import Shape
from ...errors import ArgumentError, DTypeError
from .of_state import parameters_of
from .values import of_shape

#: Parts of the velocities on which friction acts.
FrictionOf = Literal["component", "row"]
FRICTION_OF = get_args(FrictionOf)


class Friction(NamedTuple):
    """Friction that sticks.

    Attributes:
        function: a function of t, v, y and parameters of the system by name, which returns the decelerations.
        parameters: the names of these parameters.
        of: whether it acts on each component of v, or on its rows, which are vectors along the last axis.
        component: the place of the one number of v that it acts on, or None.
    """

    function: Callable[..., Any]
    parameters: tuple[str, ...]
    of: str
    component: tuple[int, ...] | None

    def shape(self, name: str, v_shape: Shape) -> Shape:
        """The shape of the decelerations for a block v of this shape. Raises if the block has no such rows or component."""
        if self.of == "row":
            if not v_shape:
                raise of_shape(f'{name}: of="row" needs vectors along the last axis of v, got a v of one number')
            return v_shape[:-1]
        if self.component is None:
            return v_shape
        if len(self.component) != len(v_shape) or any(k >= n for k, n in zip(self.component, v_shape, strict=False)):
            place = self.component[0] if len(self.component) == 1 else self.component
            raise of_shape(f"{name}: component={place} is no number of a v of shape {v_shape}")
        return ()


def place_of(of: Any, component: Any) -> tuple[int, ...] | None:
    """The place of the one number of v that friction acts on, or None; see ``Definition.friction``."""
    of = checks.known("of", of, FRICTION_OF)
    if component is None:
        return None
    if of == "row":
        raise ArgumentError('component: one number of v is no row; leave of="row" out')
    indices = component if isinstance(component, tuple) else (component,)
    return tuple(checks.count("component", each, 0) for each in indices)


def friction(system: str, parameters: Collection[str], function: Any, of: str, component: tuple[int, ...] | None) -> Friction:
    """The friction that a function declares, for a system of this name and parameters; see ``Definition.friction``."""
    if not isinstance(function, FunctionType):
        raise DTypeError(f"{system}: expected a function as friction, got {type(function).__name__}")
    return Friction(function, parameters_of(system, ("t", "v", "y"), parameters, function, "(t, v, y, *, …)"), of, component)
