"""The labelled arrays of a sweep: their dimensions, coordinates and attributes, and the hash of their bits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from hashlib import blake2b
from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, ShapeError
from ...runs.result import Status
from .axes import Chunk, Grid
from .outcomes import Results

#: The value of whole numbers of members that are not computed yet.
NOT_YET = -1
#: The length in bytes of a hash of all results, and of those of a chunk.
BYTES_OF_HASH, BYTES_OF_CHUNK_HASH = 16, 8


class Planned(NamedTuple):
    """One array of the result; the dimensions of the sweep come first."""

    dims: tuple[str, ...]
    shape: Shape
    dtype: Any
    attrs: dict[str, Any]

    @property
    def fill(self) -> Any:
        """The value of elements that are not computed yet."""
        return {"f": np.nan, "i": NOT_YET}.get(self.dtype.kind, 0)


class Layout(NamedTuple):
    """The layout of the results of a sweep of a grid: coordinates by name, as dimensions, values and attributes.

    ``attrs`` say how the dataset was made, ``units`` are by "t", "v", "y" or the name of a variable, ``renamed`` are other names
    for own dimensions.
    """

    grid: Grid
    coords: dict[str, tuple[tuple[str, ...], Array, dict[str, Any]]]
    attrs: dict[str, Any]
    units: Mapping[str, str]
    renamed: dict[str, str]

    def arrays(self, results: Results) -> dict[str, Planned]:
        """The arrays of the whole sweep, which follow from the results of one chunk."""
        sizes = dict(zip(self.grid.dims, self.grid.shape, strict=True))
        taken = set(sizes) | set(self.coords)
        own: dict[str, int] = {}
        arrays = {}
        for name, variable in results.items():
            if name in taken:
                raise ArgumentError(
                    f"axes: there is a dimension or coordinate {name!r}, which is the name of a result; name it otherwise"
                )
            dims = tuple(self.renamed.get(dim, dim) for dim in variable.dims)
            for dim, size in zip(dims, variable.values.shape[:-1], strict=True):
                if dim in sizes:
                    raise ArgumentError(f"axes: there is a dimension {dim!r}, which {name} has of its own; name it otherwise")
                if own.setdefault(dim, size) != size:
                    raise ShapeError(f"outcomes: expected one size of the dimension {dim!r}, got {own[dim]} and {size} in {name}")
            attrs: dict[str, Any] = {"long_name": variable.about}
            unit = self.units.get(name, self.units.get(variable.unit or ""))
            if unit is not None:
                attrs["units"] = unit
            if name == "status":
                attrs["flag_values"] = [NOT_YET, *(int(each) for each in Status)]
                attrs["flag_meanings"] = " ".join(["not_computed", *(each.name.lower() for each in Status)])
            arrays[name] = Planned(
                (*self.grid.dims, *dims), (*self.grid.shape, *variable.values.shape[:-1]), _plain(variable.values).dtype, attrs
            )
        return arrays


def coordinates(grid: Grid, units: Mapping[str, str]) -> dict[str, tuple[tuple[str, ...], Array, dict[str, Any]]]:
    """Coordinates of the axes.

    An argument that alone varies along its dimension has the name of the dimension; others have their own names, except that
    ``v`` and ``y``, which may be names of results, become ``v_start`` and ``y_start``.
    """
    coords = {}
    for axis in grid.axes:
        alone = len(axis.dims) == 1 and axis.own == 0 and sum(axis.dims[0] in each.dims for each in grid.axes) == 1
        name = axis.dims[0] if alone else f"{axis.argument}_start" if axis.argument in ("v", "y") else axis.argument
        attrs = {"argument": axis.argument, **axis.attrs}
        unit = units.get(axis.argument, units.get("t") if axis.argument == "dt" else None)
        if unit is not None:
            attrs.setdefault("units", unit)
        own = tuple(f"{axis.argument}_start_{i}" for i in range(axis.own))
        values = np.moveaxis(axis.values, range(axis.own), range(-axis.own, 0)) if axis.own else axis.values
        if name in coords or (len(values.shape) > 1 and name in (*axis.dims, *own)) or (name in grid.dims and not alone):
            raise ArgumentError(
                f"axes: two coordinates would be called {name!r}; give the dimension that several arguments share another name, "
                f'such as {{{axis.argument!r}: ("run", values), …}}'
            )
        coords[name] = ((*axis.dims, *own), values, attrs)
    return coords


def _plain(values: Array) -> Array:
    """Numbers of types that every format has, with one bit pattern for NaN."""
    if values.dtype.kind == "b":
        values = values.astype(np.int8)
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), values.dtype.type(np.nan), values)
    return values


def along_dims(results: Results, chunk: Chunk) -> dict[str, Array]:
    """The results of a chunk, its members along the dimensions of the sweep, which come first."""
    arrays = {}
    for name, variable in results.items():
        values = np.moveaxis(_plain(variable.values), -1, 0)
        arrays[name] = np.ascontiguousarray(values.reshape(*chunk.shape, *values.shape[1:]))
    return arrays


def hash_of_chunk(arrays: Mapping[str, Array]) -> int:
    """A hash of the results of a chunk, never 0."""
    digest = blake2b(digest_size=BYTES_OF_CHUNK_HASH)
    for name in sorted(arrays):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return int.from_bytes(digest.digest(), "little") or 1


def hash_of_all(chunks: Iterable[Mapping[str, Array]]) -> str:
    """A hash of the bits of all results, independent of the division into chunks, since a chunk's members follow each other."""
    digests: dict[str, Any] = {}
    for arrays in chunks:
        for name, values in arrays.items():
            digests.setdefault(name, blake2b(f"{name} {values.dtype.str}".encode(), digest_size=BYTES_OF_HASH))
            digests[name].update(np.ascontiguousarray(values).tobytes())
    whole = blake2b(digest_size=BYTES_OF_HASH)
    for name in sorted(digests):
        whole.update(digests[name].digest())
    return whole.hexdigest()


def named_units(units: Any) -> dict[str, str]:
    """Units by name, checked."""
    if units is None:
        return {}
    if not isinstance(units, Mapping) or not all(isinstance(each, str) for pair in units.items() for each in pair):
        raise ArgumentError(f"units: expected words by name, such as {{'t': 's', 'y': 'm'}}, got {checks.short(units)}")
    return dict(units)
