"""Some members of a batch, in any order and any number of times, as a batch along one axis."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.arrays import Array, Shape
from ...base.immutable import changed, complete
from ...model.systems.own import OwnSystem
from ...reference.signal import Constant, Curve, Held, Sine, Stepped
from .. import engine

#: From numbers, and how many axes of their own they have (None if as many as the batch leaves), to others.
Change = Callable[[Array, int | None], Array]


def each(value: Any, change: Change) -> Any:
    """A parameter, of which all numbers were changed."""
    match value:
        case np.ndarray():
            return change(value, None)
        case list():
            return [each(part, change) for part in value]
        case Constant():
            return Constant(change(np.asarray(value.value), None))
        case Sine():
            return Sine(*(change(np.asarray(part), None) for part in (value.amplitude, value.omega, value.phase)))
        case Stepped() | Curve():
            return type(value)(*(each(part, change) for part in value.parts().values()))
        case Held():
            return Held(change(value.values, 1), value.interval, value.start)
        case _:
            return value


def in_a_row(values: Array, own: int | None, batch: Shape) -> Array:
    """Numbers with one batch axis, of all members or of length 1 if they share them, behind the axes of their own."""
    own = max(0, values.ndim - len(batch)) if own is None else own
    over = values.shape[own:]
    if all(size == 1 or stride == 0 for size, stride in zip(over, values.strides[own:], strict=True)):
        return np.array(values[(slice(None),) * own + (0,) * len(over)])[..., np.newaxis]
    wide = values.reshape((*values.shape[:own], *(1,) * (len(batch) - len(over)), *over))
    return np.broadcast_to(wide, (*values.shape[:own], *batch)).reshape((*values.shape[:own], -1))


def for_batch(given: dict[str, Any], batch: Shape) -> dict[str, Any]:
    """Parameters with one batch axis, for a batch of which that is the last."""
    if len(batch) == 1:
        return given

    def wide(values: Array, own: int | None) -> Array:
        return values.reshape((*values.shape[:-1], *(1,) * (len(batch) - 1), values.shape[-1]))

    return {name: each(value, wide) for name, value in given.items()}


class Members:
    """All members of a plan, of which some can be taken.

    Attributes:
        given: the parameters of the system by name, with one batch axis.
    """

    def __init__(self, plan: engine.Plan) -> None:
        system, batch = plan.system, plan.batch
        self._plan = plan

        def row(values: Array, own: int | None) -> Array:
            return in_a_row(values, own, batch)

        self.given = {name: each(value, row) for name, value in system.given(batch).items()}
        self._contacts = {name: each(value, row) for name, value in system.given_contacts(batch).items()}
        numbers: dict[str, Any] = {} if system.control is None else system.control.given()
        self._control = {
            name.removeprefix("control."): row(value, None) for name, value in numbers.items() if isinstance(value, np.ndarray)
        }
        self._rubbing = None if system.stick_friction is None else row(system.stick_friction, None)
        self._force = None if plan.force is None else row(plan.force, len(system.v_shape))

    def plan(self, index: Any) -> engine.Plan:
        """The plan of these members."""

        def some(values: Array, own: int | None = None) -> Array:
            return values if values.shape[-1] == 1 else values[..., index]

        given = {name: each(value, some) for name, value in self.given.items()}
        contacts = {name: each(value, some) for name, value in self._contacts.items()}
        batch = (len(index),)
        system: Any = self._plan.system
        control = system.control
        if control is not None:
            control = changed(control, **{name: some(value) for name, value in self._control.items()})
        taken = changed(system)
        if isinstance(system, OwnSystem):
            complete(taken, _core=system._core)  # its operations, which a copy leaves out
        complete(
            taken,
            batch=batch,
            given=lambda wanted: for_batch(given, wanted),
            given_contacts=lambda wanted: for_batch(contacts, wanted),
            control=control,
            stick_friction=None if self._rubbing is None else some(self._rubbing),
        )
        t0: Any = self._plan.t0
        if np.ndim(t0):
            t0 = np.broadcast_to(t0, self._plan.batch).reshape(-1)[index]
        force = None
        if self._force is not None:
            force = np.broadcast_to(some(self._force), (*system.v_shape, *batch))
        return self._plan._replace(system=taken, batch=batch, t0=t0, force=force)

    def numbers(self, index: Any) -> dict[str, Any]:
        """The parameters of these members that are numbers, by name."""
        arrays = {name: value for name, value in self.given.items() if isinstance(value, np.ndarray)}
        return {name: value if value.shape[-1] == 1 else value[..., index] for name, value in arrays.items()}
