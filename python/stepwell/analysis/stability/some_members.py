"""Some members of a batch, so that a search takes no more time for members that have their result."""

from __future__ import annotations

from functools import partial
from math import prod
from typing import Any

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import changed, complete
from ...model.methods import Method
from ...model.systems import System
from ...runs import engine
from ...runs.events.members import Members


class Batch:
    """A system, and a state if there is one, from which some members can be taken, by their indices in the flattened batch."""

    def __init__(self, system: System, method: Method, v: Array | None, y: Array | None, members: Shape) -> None:
        self._system = system
        # A system without a batch stays the same object, so that its cached derivatives are found.
        self._every = Members(engine.Plan(system, method, members, 1.0)) if system.batch else None
        self._blocks: list[Array] | None = None
        if v is not None and y is not None:
            both, count = ((v, system.v_shape), (y, system.y_shape)), prod(members)
            self._blocks = [checks.spread(block, shape, members).reshape((*shape, count)) for block, shape in both]

    def of(self, index: Any) -> tuple[System, Array | None, Array | None]:
        """The system and the state of the members with these indices."""
        system = self._system if self._every is None else self._every.plan(index).system
        if self._blocks is None:
            own = changed(system)  # the given one stays as it is
            complete(own, without_inputs=partial(changed, own))  # it has none
            return own, None, None
        v, y = (block[..., index] for block in self._blocks)
        return system, v, y
