"""A run as an xarray ``Dataset`` or a pandas ``DataFrame``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..base import checks
from ..base.arrays import Array, Shape
from ..base.optional import imported
from ..errors import ArgumentError, DTypeError, ShapeError

if TYPE_CHECKING:
    from ..runs.result import Run

#: The axis of saved states.
TIME = "t"

#: The times of saved states, where each member has its own.
OWN_TIME = "time"


def to_xarray(run: Run, dims: Sequence[str] | None = None, coords: Mapping[str, Any] | None = None) -> Any:
    """A run as a ``Dataset``; see ``Run.to_xarray``."""
    xarray = imported("xarray", "to_xarray")
    members = _members(run, dims)
    v_axes, y_axes = _axes(run)
    variables: dict[str, tuple[tuple[str, ...], Any]] = {
        "v": ((TIME, *v_axes, *members), run.v),
        "y": ((TIME, *y_axes, *members), run.y),
        "status": (members, run.status),
        "first_bad_step": (members, run.first_bad_step),
    }
    if run.system.v_shape == (0,):
        del variables["v"]  # a system of first order
    for name, array in run.recorded.items():
        own = array.ndim - 1 - len(members)
        variables[name] = (TIME, *(f"{name}_{i}" for i in range(own)), *members), array
    if run.work is not None:
        variables["work"] = members, run.work
    if run.paces is not None:
        variables |= {name: (members, getattr(run.paces, name)) for name in ("accepted", "rejected", "evaluations")}
    if coords is not None and not isinstance(coords, Mapping):
        raise DTypeError(f"coords: expected coordinates by name, got {checks.short(coords)} ({type(coords).__name__})")
    coordinates = dict(coords or {})
    if clash := [name for name in coordinates if name in variables or name == TIME]:
        raise ArgumentError(f"coords: expected names of their own, got {', '.join(clash)}, which the run has")
    try:
        times: dict[str, Any] = {TIME: run.t} if run.t.ndim == 1 else {OWN_TIME: ((TIME, *members), run.t)}
        return xarray.Dataset(variables, coords={**times, **coordinates}, attrs=_attributes(run))
    except (ValueError, TypeError, RuntimeError) as error:  # the variables of the run always fit
        raise ArgumentError(f"coords: expected coordinates that fit the axes {', '.join((TIME, *members))}: {error}") from None


def to_dataframe(run: Run, dims: Sequence[str] | None = None) -> Any:
    """A run as a ``DataFrame``; see ``Run.to_dataframe``."""
    pandas = imported("pandas", "to_dataframe")
    members = _members(run, dims)
    batch = run.status.shape
    columns: dict[str, Array] = {}
    if run.system.v_shape != (0,):
        columns |= _columns("v", run.v, run.system.v_shape)
    columns |= _columns("y", run.y, run.system.y_shape)
    for name, array in run.recorded.items():
        columns |= _columns(name, array, array.shape[1 : array.ndim - len(batch)])
    if batch:
        at: Any = run.t
        if run.t.ndim > 1:
            at, columns = np.arange(len(run.t)), {OWN_TIME: run.t} | columns
        index = pandas.MultiIndex.from_product([at, *map(range, batch)], names=[TIME, *members])
    else:
        index = pandas.Index(run.t, name=TIME)
    table = pandas.DataFrame({name: np.ascontiguousarray(each).reshape(-1) for name, each in columns.items()}, index=index)
    table.attrs = _attributes(run)
    return table


def _columns(name: str, array: Array, block: Shape) -> dict[str, Array]:
    """The numbers of a block by the names of their columns: y, or y_0, y_1, or y_0_0."""
    return {"_".join(map(str, (name, *index))): array[(slice(None), *index)] for index in np.ndindex(block)}


def _members(run: Run, dims: Sequence[str] | None) -> tuple[str, ...]:
    """The names of the batch's axes."""
    axes = len(run.status.shape)
    if dims is None:
        return ("member",) if axes == 1 else tuple(f"member_{i}" for i in range(axes))
    names = [dims] if isinstance(dims, str) else checks.several("dims", dims, "names")
    if len(names) != axes or not all(isinstance(each, str) for each in names):
        raise ShapeError(f"dims: expected a name for each of the {axes} batch axes, got {checks.short(dims)}")
    if len({TIME, *names}) != axes + 1:
        raise ArgumentError(f"dims: expected different names, none of them {TIME!r}, got {checks.short(dims)}")
    return tuple(names)


def _axes(run: Run) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of the blocks' axes; those of v and y differ where the blocks do."""
    v_shape, y_shape = run.system.v_shape, run.system.y_shape
    named = [each.strip() for each in run.system.axes.split(",")]

    def names(shape: Shape, before: str) -> tuple[str, ...]:
        if len(named) == len(shape) > 1:
            return tuple(f"{before}{each}" for each in named)
        return (f"{before}component",) if len(shape) == 1 else tuple(f"{before}component_{i}" for i in range(len(shape)))

    return (names(v_shape, ""), names(y_shape, "")) if v_shape == y_shape else (names(v_shape, "v_"), names(y_shape, "y_"))


def _attributes(run: Run) -> dict[str, Any]:
    """The attributes of a table of a run: text and numbers only, which files can store."""
    attributes: dict[str, Any] = {"system": repr(run.system), "method": run.method.name}
    if np.ndim(run.t0) == 0:
        attributes["t0"] = run.t0
    if run.paces is None:
        attributes |= {"dt": run.dt, "start_step": run.start_step, "steps": run.steps}
    return attributes | {"fused": int(run.fused), "stepwell": _core.__version__}
