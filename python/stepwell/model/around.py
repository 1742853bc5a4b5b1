"""The parts around a system's own equations, such as surfaces, controls and forces. Each wraps the system and the parts within.

``System.around`` lists them from the inside out. The order of all kinds is ``ORDER`` of ``reference/around.py``, and is the same
in the core, in ``rust/core/src/model/around/mod.rs``. All code that steps, traces or describes a system goes through that list,
so a new kind of part is one class here, one that wraps in ``reference/``, and one in the core.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from ..base.arrays import Array, Shape
from ..base.immutable import Immutable, ValueEquality, changed
from ..reference import around as reference
from .inputs import Input, Sampled, Sinusoid

if TYPE_CHECKING:
    from .equations.definition import Definition


class Part(Immutable, ValueEquality, ABC):
    """The base class of parts around a system's equations.

    Attributes:
        kind: its name in ``ORDER``.
        velocity_term: the name of a term of it that depends on the velocity, so that methods for ÿ = a(t, y) refuse it; or None.
        acts_on_rates: whether it changes the rates in every stage. Otherwise it changes the state after a step.
        is_scaled: whether attempts at adaptive steps have it in the rates for a step of 1, which are multiplied by the step.
    """

    kind: ClassVar[str]
    velocity_term: ClassVar[str | None] = None
    acts_on_rates: ClassVar[bool] = True
    is_scaled: ClassVar[bool] = False

    def check(self, system: Any) -> None:
        """Raise if it does not work with a system."""
        return

    def beside(self, other: Any) -> Part:
        """Combine with another part of its kind that a system has, or None; by default this part replaces it."""
        return self

    @property
    def batch(self) -> Shape:
        """The shape to which its numbers broadcast."""
        return ()

    @property
    def inputs(self) -> dict[str, Input]:
        """Its inputs by name."""
        return {}

    @property
    def keeps_energy(self) -> bool:
        """True if the energy of the system stays constant with this part."""
        return False

    @abstractmethod
    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """Its parameters by name, for coordinates and a batch of these shapes; see ``System.equation_parameters``."""

    def own_axes(self, name: str) -> int:
        """How many axes of its own a parameter has, before those of the batch."""
        return 0

    @abstractmethod
    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> Any:
        """The NumPy reference ``s``, scaled to the step h, with this part around it; parameters are numbers or symbols."""

    def member(self, one: Callable[..., Array]) -> Self:
        """The part for one member of a batch; ``one(numbers, n)`` takes the member's from numbers with n axes of their own."""

        def of(value: Any) -> Any:
            if isinstance(value, Sinusoid):
                return Sinusoid(*(one(each) for each in (value.amplitude, value.omega, value.phase)))
            if isinstance(value, Sampled):
                return changed(value, values=one(value.values, 1))
            return one(value) if isinstance(value, np.ndarray) else value

        return changed(self, **{name: of(value) for name, value in vars(self).items()})

    def repr_arguments(self) -> list[str]:
        """The texts that show the part among the arguments in the repr of a system."""
        return [repr(self)]


#: The name of the parameter that is the force from outside.
FORCE = "added.force"


class Force(Part):
    """A force from outside, which is added to v̇, whose block has ``axes`` axes, in every stage; the run has its numbers."""

    kind = "force"

    def __init__(self, axes: int) -> None:
        self.axes = axes

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """None, because its numbers belong to the run."""
        return {}

    def own_axes(self, name: str) -> int:
        """The axes of the block."""
        return self.axes

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> Any:
        """The system with the force added to its rates."""
        return reference.Forced(s, h, parameters[FORCE])


class StickFriction(Part):
    """Coulomb's friction that sticks; ``limit`` is the deceleration of each velocity, which broadcasts over the batch."""

    kind = "friction"
    velocity_term = "friction"

    def __init__(self, limit: Array) -> None:
        self.limit = limit

    @property
    def batch(self) -> Shape:
        """The shape of the limit."""
        return self.limit.shape

    @property
    def keeps_energy(self) -> bool:
        """True if the friction is zero for all members."""
        return not self.limit.any()

    def repr_arguments(self) -> list[str]:
        """None, because it is among the arguments of its system."""
        return []

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """The limit."""
        return {"friction.limit": self.limit}

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> Any:
        """The system with friction around all other forces."""
        return _rubbing(s, h, parameters["friction.limit"])


class OwnFriction(Part):
    """Friction that sticks, as the definition of own equations declares it, with the parameters of the system."""

    kind = "friction"
    velocity_term = "friction"

    def __init__(self, definition: Definition) -> None:
        self.definition = definition

    def repr_arguments(self) -> list[str]:
        """None, because it belongs to the equations."""
        return []

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """None, because they are those of the system."""
        return {}

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> Any:
        """The system with friction around all other forces."""
        return _rubbing(s, h)


def _rubbing(s: Any, h: Any, *deceleration: Any) -> Any:
    from ..reference import friction  # a run by the core does without

    return friction.Rubbing(s, h, *deceleration)
