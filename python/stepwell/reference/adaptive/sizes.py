"""Sizes of components, and of groups of them."""

import operator
from collections.abc import Sequence
from functools import reduce
from math import prod
from typing import Any

import numpy as np

from ...base.arrays import Array
from ..acceptance import NO_GROUP
from ..bits import and_bits, less, where


def absolute(x: Any) -> Any:
    """|x|; among symbols there may be numbers."""
    if isinstance(x, np.ndarray) and x.dtype == object:
        return np.frompyfunc(lambda each: absolute(each) if hasattr(each, "and_bits") else abs(each), 1, 1)(x)
    return and_bits(x, (1 << 63) - 1)


def longer(a: Any, b: Any) -> Any:
    """The larger of two sizes."""
    return where(less(a, b), b, a)


def largest(sizes: Any) -> Any:
    """The largest of some sizes."""
    return reduce(longer, sizes)


def total(sizes: Any) -> Any:
    """The sum of some sizes."""
    return reduce(operator.add, sizes)


def stacked(numbers: Sequence[Any]) -> Any:
    """Rows as one array; a row may be the same number for all members."""
    if any(isinstance(each, np.ndarray) and each.dtype != object for each in numbers):
        return np.stack(np.broadcast_arrays(*numbers))
    out = np.empty(len(numbers), dtype=object if any(not isinstance(each, float) for each in numbers) else float)
    out[:] = numbers
    return out


def sizes(v: Array, y: Array, block_axes: tuple[int, int], groups: tuple[int, ...]) -> Any:
    """The size of each group of components along the first axis: of one number its absolute value, of several their length."""
    if not groups:
        return stacked([size_of(block, axes) for block, axes in zip((v, y), block_axes, strict=True) if np.size(block)])
    rows = [row for block, axes in zip((v, y), block_axes, strict=True) for row in rows_of(block, axes)]
    members: dict[int, list[Any]] = {}
    for group, row in zip(groups, rows, strict=True):
        if group != NO_GROUP:
            members.setdefault(group, []).append(row)
    return stacked([length_of(members[group]) for group in sorted(members)])


def component(v: Array, y: Array, block_axes: tuple[int, int], place: int) -> Any:
    """The number of v, then of y, at a place."""
    return [row for block, axes in zip((v, y), block_axes, strict=True) for row in rows_of(block, axes)][place]


def numbers_in(v: Array, y: Array, block_axes: tuple[int, int]) -> list[int]:
    """How many numbers v and y of a member have."""
    return [prod(np.shape(block)[:axes]) for block, axes in zip((v, y), block_axes, strict=True)]


def rows_of(block: Array, axes: int) -> list[Any]:
    """The numbers of a block, each of all members."""
    block = np.asarray(block)
    if block.dtype == object and not any(hasattr(each, "and_bits") for each in block.flat):  # as a series has them
        block = block.astype(np.float64)
    return list(block.reshape((-1, *block.shape[axes:])))


def size_of(block: Array, axes: int) -> Any:
    """The size of a block."""
    block = np.asarray(block)
    if block.ndim == axes and block.dtype == np.float64:  # of one member: the same sum in floats, ten times as fast
        numbers = block.ravel().tolist()
        if len(numbers) == 1:
            return np.float64(abs(numbers[0]))
        squares = 0.0
        for number in numbers:
            squares += number * number
        return np.sqrt(np.float64(squares))
    return length_of(rows_of(block, axes))


def length_of(numbers: Sequence[Any]) -> Any:
    """The length of some numbers, each of all members; of one number its absolute value."""
    if len(numbers) == 1:
        return absolute(numbers[0])
    return np.sqrt(reduce(operator.add, (number * number for number in numbers), 0.0))
