"""Some members of a batch, in any order and with repetitions, as a batch along one axis."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.parameters import in_a_row, with_numbers
from .. import engine


class Members:
    """The members of a plan, from which some can be selected.

    Attributes:
        parameters: those of the system's own equations, by name, with one batch axis.
    """

    def __init__(self, plan: engine.Plan) -> None:
        system, batch = plan.system, plan.batch
        self._plan = plan

        def row(values: Array, own: int | None) -> Array:
            return in_a_row(values, batch, own)

        self.parameters = with_numbers(system.own_parameters(batch), row)
        self._parts = [(part, with_numbers(parameters, row)) for part, parameters in system.parts(batch)]
        self._force = None if plan.force is None else row(plan.force, len(system.v_shape))

    def plan(self, index: Any) -> engine.Plan:
        """The plan of these members."""

        def some(values: Array, own: int | None = None) -> Array:
            return values if values.shape[-1] == 1 else values[..., index]

        batch = (len(index),)
        parts = [(part, with_numbers(parameters, some)) for part, parameters in self._parts]
        system = self._plan.system.of_members(batch, with_numbers(self.parameters, some), parts)
        t0: Any = self._plan.t0
        if np.ndim(t0):
            t0 = np.broadcast_to(t0, self._plan.batch).reshape(-1)[index]
        force = None
        if self._force is not None:
            force = np.broadcast_to(some(self._force), (*system.v_shape, *batch))
        return self._plan._replace(system=system, batch=batch, t0=t0, force=force)

    def numbers(self, index: Any) -> dict[str, Any]:
        """The parameters of these members that are numbers, by name."""
        arrays = {name: value for name, value in self.parameters.items() if isinstance(value, np.ndarray)}
        return {name: value if value.shape[-1] == 1 else value[..., index] for name, value in arrays.items()}
