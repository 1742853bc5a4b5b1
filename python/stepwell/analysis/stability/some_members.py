"""Some members of a batch of which something is sought, so that those that have it take no more time."""

from __future__ import annotations

from functools import partial
from math import prod
from typing import Any

from ...base.arrays import Array, Shape
from ...base.immutable import changed, complete
from ...model.methods import Method
from ...model.systems import System
from ...runs import engine
from ...runs.events.members import Members
from . import maps


class Batch:
    """A system, and a state if there is one, of which some members can be taken. These are counted along one axis."""

    def __init__(self, system: System, method: Method, v: Array | None, y: Array | None, members: Shape) -> None:
        self._system = system
        # A system that is the same for all members stays the same object, whose derivatives are traced already.
        self._every = Members(engine.Plan(system, method, members, 1.0)) if system.batch else None
        self._blocks: list[Array] | None = None
        if v is not None and y is not None:
            both, count = ((v, system.v_shape), (y, system.y_shape)), prod(members)
            self._blocks = [maps.spread(block, shape, members).reshape((*shape, count)) for block, shape in both]

    def of(self, index: Any) -> tuple[System, Array | None, Array | None]:
        """The system and the state of these members."""
        system = self._system if self._every is None else self._every.plan(index).system
        if self._blocks is None:
            complete(system, without_inputs=partial(changed, system))  # it has none
            return system, None, None
        v, y = (block[..., index] for block in self._blocks)
        return system, v, y
