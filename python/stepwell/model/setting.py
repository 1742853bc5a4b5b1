"""Other numbers for the parameters of a system, with the same operations: what a world can set between steps."""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..base.immutable import changed
from ..errors import ArgumentError, ShapeError, UnsupportedError
from .controls import ConstraintControl, Control, EnergyControl, Projection
from .inputs import Sampled, Sinusoid
from .parameters import CoreParameters, aligned
from .systems import System

#: Advice where a value cannot be set.
ANEW = "make another World that goes on from here, World(system, method, resume=world)"
#: The arguments of controls that are numbers, with the row of the core and what each number is above.
OF_CONTROLS: dict[type[Any], dict[str, tuple[str, float]]] = {
    EnergyControl: {"gain": ("control.gain", checks.NOT_NEGATIVE), "target": ("control.target", checks.ANY)},
    Control: {"gain": ("control.gain", checks.NOT_NEGATIVE), "target": ("control.target", checks.ANY)},
    Projection: {"target": ("control.target", checks.ANY)},
}


class Direct(NamedTuple):
    """A parameter whose numbers reach the step as they are.

    Attributes:
        numbers: its numbers, shape (*own, *batch); without the axes of the batch if all members have them in common.
        row: the name of its rows in the core.
        least: what each number is above.
    """

    numbers: Array
    row: str
    least: float


def _of_control(system: System) -> dict[str, tuple[str, float]]:
    """The arguments of the system's control that are numbers, without those that the system has under the same name."""
    keeper: Any = system.keeper
    if isinstance(keeper, ConstraintControl):
        mine = {"c" if keeper.constraint == "length" else "k": ("strength", checks.NOT_NEGATIVE)}
    elif isinstance(keeper, Projection) and system.kept is not None:
        mine = {}
    else:
        mine = OF_CONTROLS.get(type(keeper), {})
    return {name: row for name, row in mine.items() if name not in system.arguments()}


def _of_controller(system: System) -> dict[str, tuple[str, float]]:
    controller = system.controller
    return {} if controller is None else {name: (f"controller.{name}", checks.ANY) for name in controller.tunable}


def known_names(system: System) -> tuple[str, ...]:
    """The names of all parameters that can be set: numbers, inputs and surfaces."""
    own = (name for name, value in system.arguments().items() if _is_set(value))
    return (*own, *_of_control(system), *_of_controller(system))


def _is_set(value: Any) -> bool:
    several = value if isinstance(value, tuple) and value else (value,)
    if any(isinstance(each, np.ndarray) for each in several):
        return all(each.dtype.kind == "f" for each in several if isinstance(each, np.ndarray))  # no pairs of ends
    return any(isinstance(each, (Sampled, Sinusoid)) for each in several) or all(
        getattr(each, "way", None) is not None for each in several
    )  # or surfaces


def check_name(system: System, name: str) -> None:
    """Raise if a parameter cannot be set."""
    if system.controller is not None and name in system.controller.sets:
        raise UnsupportedError(
            f"{name}: the sampled controller sets it, so a number for it would not be read; set the controller's"
        )
    if name in ("C", "D", "num", "den") and system.controller is not None and system.controller.reads_outputs:
        raise UnsupportedError(f"{name}: the sampled controller reads outputs by it, which is part of the step; {ANEW}")
    arguments, names = system.arguments(), known_names(system)
    if name in names:
        return
    if name in arguments:
        value = arguments[name]
        left_out = value is None or value == ()
        why = "it was left out, so it is no part of the step" if left_out else "it selects the operations of the step"
        raise UnsupportedError(f"{name}: {why}, and cannot be set; {ANEW}. Those that can: {', '.join(names) or 'none'}")
    checks.known("parameters", name, names)


def with_parameters(system: System, values: dict[str, Any]) -> System:
    """The system with these numbers, inputs or surfaces in place of its own; each is checked as for a new system."""
    for name in values:
        check_name(system, name)
    of_control = _of_control(system)
    of_controller = {name: value for name, value in values.items() if name in _of_controller(system)}
    own = {name: value for name, value in values.items() if name not in of_control and name not in of_controller}
    fresh = system.with_arguments(own) if own else system
    if of_controller:
        fresh = fresh.with_operations(fresh.controller.with_values(of_controller))
    kept = {name: value for name, value in values.items() if name in of_control}
    return _with_control(fresh, system.keeper, kept) if kept else fresh


def _with_control(system: System, keeper: Any, values: dict[str, Any]) -> System:
    numbers = {}
    for name, value in values.items():
        check = checks.numbers if name == "target" else checks.not_negative
        numbers["strength" if isinstance(keeper, ConstraintControl) else name] = check(name, value)
    other = changed(keeper, **numbers)
    batch = checks.batch_shape({"system": system.uncontrolled.batch, "control": other.batch})
    if system.kept is not None:
        return changed(system, kept=other, batch=batch)
    if getattr(system, "push", None) is not None:
        return changed(system, **system.operations(), push=other, batch=batch)
    around = tuple(other if part.kind == "control" else part for part in system.around)
    return changed(system, **system.operations(), around=around, batch=batch)


def same_operations(before: CoreParameters, after: CoreParameters, names: Any) -> None:
    """Raise unless both have the same operations: the same parameters, each with as many numbers."""

    def kinds(parameters: CoreParameters) -> list[Any]:
        return [(name, _kind(value)) for name, value in parameters]

    for (one, kind), (other, its) in zip(kinds(before), kinds(after), strict=False):
        if one != other or kind != its:
            break
    else:
        if len(before) == len(after):
            return
    raise UnsupportedError(
        f"{', '.join(names)}: expected numbers, inputs and surfaces of the kinds and sizes that are there, since others have "
        f"other operations; {ANEW}"
    )


def _kind(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return len(value)
    return "samples" if isinstance(value, tuple) else value


def direct(system: System, batch: Shape) -> dict[str, Direct]:
    """The parameters whose numbers reach the step as they are, by name."""
    rows = {name: value for name, value in system.parameters(batch) if isinstance(value, np.ndarray)}
    all_of_them = system.all_parameters(batch)
    result = {}
    for name, (row, least) in (system.direct() | _of_control(system) | _of_controller(system)).items():
        if row not in rows or (system.controller is not None and name in system.controller.sets):
            continue  # an input that changes with the time, or what a controller sets
        value = all_of_them.get(row)
        own = value.shape[: max(0, value.ndim - len(batch))] if isinstance(value, np.ndarray) else ()
        if prod(own) != len(rows[row]):
            continue
        width = rows[row].shape[1]
        shape = (*own, *batch) if width == prod(batch) else own
        result[name] = Direct(rows[row].reshape(shape), row, least)
    return result


def of_each_member(system: System, name: str, batch: Shape) -> Array:
    """The numbers of a parameter for each member, shape (*own, *batch); a copy."""
    value: Any
    if (known := direct(system, batch).get(name)) is not None:
        value, own = known.numbers, _own_axes(known, batch)
    else:
        value = system.own_parameters(batch).get(name)
        own = max(0, value.ndim - len(batch)) if isinstance(value, np.ndarray) else 0
        if not isinstance(value, np.ndarray):
            value, own = system.arguments().get(name), system.own_axes(name)
        if not isinstance(value, np.ndarray):
            raise UnsupportedError(f"{name}: an input or a surface is that of all members; world.set changes it for all of them")
    return np.array(np.broadcast_to(aligned(value, own, batch), (*value.shape[:own], *batch)))


def _own_axes(known: Direct, batch: Shape) -> int:
    numbers = known.numbers
    has_members = numbers.ndim >= len(batch) and numbers.shape[numbers.ndim - len(batch) :] == batch
    return numbers.ndim - len(batch) if has_members else numbers.ndim


def of_some(argument: str, value: Any, own: Shape, over: Shape, least: float = checks.ANY) -> Array:
    """Numbers for some members: shape (*own, *over), or those of one member, or one number for all; flat over the members."""
    array = checks.numbers(argument, value)
    if array.ndim == 0:
        array = np.broadcast_to(array, (*own, *over))
    elif array.shape == own and over:
        array = np.broadcast_to(array.reshape(*own, *(1,) * len(over)), (*own, *over))
    if array.shape != (*own, *over):
        expected = f"{own} or {(*own, *over)}" if over else f"{own}"
        raise ShapeError(f"{argument}: expected shape {expected}, got {array.shape}")
    if (wrong := ~(array > least)).any():
        bound = "above zero" if least == checks.POSITIVE else "of zero or more"
        raise ArgumentError(f"{argument}: expected numbers {bound}, got {array[wrong][0]:g}")
    return array.reshape(*own, prod(over))
