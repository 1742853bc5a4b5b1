"""The axes of a sweep: arguments by name, each with the dimension of its values, and the grid of all members."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, DTypeError, ShapeError
from ...model.methods import Method
from ...model.systems import System

#: Arguments of ``integrate`` that can be axes. All other names are those of parameters of the system.
OF_THE_RUN = ("v", "y", "dt", "force", "tolerance")


class Axis(NamedTuple):
    """The values of one argument, shape (*own axes of the argument, *sizes of the dimensions), and its attributes, as a unit."""

    argument: str
    dims: tuple[str, ...]
    values: Array
    attrs: dict[str, Any]

    @property
    def own(self) -> int:
        """The number of axes of the argument itself."""
        return self.values.ndim - len(self.dims)


class Chunk(NamedTuple):
    """Members that are computed together: a piece of the grid, whose members follow each other, from number ``first`` on.

    ``place``, ``slices`` and ``shape`` are its index, its members and their number along each dimension.
    """

    place: Shape
    slices: tuple[slice, ...]
    shape: Shape
    first: int

    @property
    def members(self) -> int:
        """How many."""
        return prod(self.shape)


class Grid:
    """All members of a sweep: the product of its dimensions.

    Members are numbered with the last dimension fastest. Dimensions of ``dt`` come first, so that members with the same step
    follow each other, since most runs have one step.
    """

    def __init__(self, axes: list[Axis]) -> None:
        self.axes = axes
        sizes: dict[str, int] = {}
        given_by: dict[str, str] = {}
        for axis in sorted(axes, key=lambda axis: axis.argument != "dt"):
            for dim, size in zip(axis.dims, axis.values.shape[axis.own :], strict=True):
                if sizes.setdefault(dim, size) != size:
                    raise ShapeError(
                        f"axes: expected as many values of {axis.argument} as of {given_by[dim]}, since both vary along the "
                        f"dimension {dim!r}, got {size} and {sizes[dim]}"
                    )
                given_by.setdefault(dim, axis.argument)
        self.dims, self.shape = tuple(sizes), tuple(sizes.values())
        #: The number of dimensions along which ``dt`` varies; they are the first ones.
        self.of_dt = next((len(axis.dims) for axis in axes if axis.argument == "dt"), 0)

    @property
    def members(self) -> int:
        """How many."""
        return prod(self.shape)

    def chunk_shape(self, most: int, *, mixed: bool = False) -> Shape:
        """The shape of chunks of at most ``most`` members (and at least one), of about equal size.

        A chunk is whole along the last dimensions, so that its members follow each other, and unless it may be ``mixed``, one
        wide along the first, so that it has one ``dt``.
        """
        shape, room = [1] * len(self.shape), max(1, most)
        for i in range(len(self.shape) - 1, -1 if mixed else self.of_dt - 1, -1):
            size = self.shape[i]
            parts = -(-size // min(size, room))
            shape[i] = -(-size // parts)
            if parts > 1:
                break
            room //= size
        return tuple(shape)

    def chunks(self, shape: Shape) -> Iterator[Chunk]:
        """All members in chunks of that shape, in their order; those at an end may be smaller."""
        counts = [-(-size // width) for size, width in zip(self.shape, shape, strict=True)]
        first = 0
        for place in np.ndindex(*counts):
            bounds = [(i * width, min((i + 1) * width, size)) for i, width, size in zip(place, shape, self.shape, strict=True)]
            chunk = Chunk(place, tuple(slice(*each) for each in bounds), tuple(b - a for a, b in bounds), first)
            yield chunk
            first += chunk.members

    def values(self, chunk: Chunk) -> dict[str, Any]:
        """The arguments of the members of a chunk, shape (*own axes, members); ``dt`` is one number if it is that of all."""
        arguments: dict[str, Any] = {}
        for axis in self.axes:
            own = axis.values.shape[: axis.own]
            order = sorted(range(len(axis.dims)), key=lambda i: self.dims.index(axis.dims[i]))
            values = axis.values.transpose([*range(axis.own), *(axis.own + i for i in order)])
            there = [self.dims.index(axis.dims[i]) for i in order]
            slices: Any = (..., *(chunk.slices[i] for i in there))
            values = values[slices]
            widths = [chunk.shape[i] if i in there else 1 for i in range(len(self.dims))]
            values = np.broadcast_to(values.reshape(*own, *widths), (*own, *chunk.shape)).reshape(*own, chunk.members)
            alone = chunk.members == 1 or len(self.axes) > 1  # else dt says how many members there are
            one = axis.argument == "dt" and alone and bool((values == values[0]).all())
            arguments[axis.argument] = float(values[0]) if one else np.ascontiguousarray(values)
        return arguments

    def place(self, member: int) -> str:
        """The place of a member in words: the values of its dimensions."""
        index = dict(zip(self.dims, np.unravel_index(member, self.shape), strict=True))
        places = []
        for axis in self.axes:
            if axis.own == 0:
                value = axis.values[tuple(index[dim] for dim in axis.dims)]
                places.append(f"{axis.argument} = {value:.6g}")
        return ", ".join(places) or f"member {member}"


def grid(axes: Any) -> Grid:
    """The grid of the user's axes."""
    if not isinstance(axes, Mapping):
        order = "; axes stand before the method, sweep(system, axes, method)" if isinstance(axes, (str, Method)) else ""
        if callable(axes) or isinstance(axes, System):
            order = "; axes stand behind the system, sweep(system, axes, method)"
        raise DTypeError(
            "axes: expected a dictionary of arguments by name, such as {'mu': ('mu', values)}, got "
            f"{type(axes).__name__}{order}"
        )
    if not axes:
        raise ArgumentError("axes: expected at least one, such as {'mu': ('mu', values)}, got none; for one run use integrate")
    return Grid([_axis(name, value) for name, value in axes.items()])


def _axis(name: Any, axis: Any) -> Axis:
    if not isinstance(name, str) or not name.isidentifier():
        raise ArgumentError(f"axes: expected names of arguments, got {checks.short(name)}")
    argument, attrs = f"axes: {name}", {}
    if hasattr(axis, "dims") and hasattr(axis, "values"):  # of xarray
        dims, values, attrs = axis.dims, axis.values, dict(axis.attrs)
    elif isinstance(axis, tuple) and axis and (isinstance(axis[0], str) or _words(axis[0])):
        if len(axis) not in (2, 3):
            raise ShapeError(
                f"{argument}: expected (dimension, values) or (dimension, values, attributes), got {len(axis)} parts"
            )
        dims, values, *more = axis
        if more:
            if not isinstance(more[0], Mapping):
                raise DTypeError(
                    f"{argument}: expected attributes by name, such as {{'units': 's'}}, got {checks.short(more[0])}"
                )
            attrs = dict(more[0])
    else:
        dims, values = name, axis
    dims = (dims,) if isinstance(dims, str) else tuple(dims)
    numbers = checks.numbers(argument, values, positive=name in ("dt", "tolerance"))
    if len(set(dims)) < len(dims) or not all(isinstance(dim, str) and dim for dim in dims):
        raise ArgumentError(f"{argument}: expected different names of dimensions, got {checks.short(dims)}")
    if numbers.ndim < len(dims):
        raise ShapeError(
            f"{argument}: expected values along {', '.join(map(repr, dims))}, the last of their axes, got shape {numbers.shape}"
        )
    if 0 in numbers.shape:
        raise ShapeError(f"{argument}: expected at least one value, got shape {numbers.shape}")
    if name == "dt" and numbers.ndim > len(dims):
        raise ShapeError(f"{argument}: expected one number for each member, got shape {numbers.shape}")
    return Axis(name, dims, numbers, attrs)


def _words(value: Any) -> bool:
    return isinstance(value, (tuple, list)) and bool(value) and all(isinstance(each, str) for each in value)
