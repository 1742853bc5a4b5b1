"""Memory of large results: a new page costs more than filling it, so released memory is reused.

A run that saves every step writes some megabytes in a few milliseconds. The operating system clears each new page before it is
written, a small page (4 KiB) at a time unless it can give large ones (2 MiB), and takes all pages back when the arrays are
gone. So large arrays begin at the boundary of a large page; and when the last array over such memory is gone, the pool keeps the
memory for the next result, up to ``MOST_FREE`` bytes in all.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from .arrays import Array, Shape

#: Smaller arrays, in bytes, are NumPy's own: the allocator keeps memory of such sizes. The pages of larger arrays, such as the
#: results of 100 000 members, it returns to the system as soon as some of them are free together.
LEAST_POOLED = 1 << 17
#: The most bytes that the pool keeps in all while no array uses them.
MOST_FREE = 1 << 26
#: Sizes of a large page and of a cache line, in numbers. Other programs take arrays without a copy only if they begin at a line.
_LARGE_PAGE, _CACHE_LINE = (1 << 21) // 8, 64 // 8

#: Memory that no array uses, by identity, the newest last. Memory may be released between any two operations on this.
_free: dict[int, Array] = {}


def _keep(memory: Array, free: dict[int, Array] = _free, most: int = MOST_FREE) -> None:
    """Keep released memory. The defaults: as the interpreter ends, the last memory is released after this module's names."""
    if memory.nbytes > most:
        return
    free[id(memory)] = memory
    for oldest in list(free):
        if sum([each.nbytes for each in list(free.values())]) <= most:
            break
        free.pop(oldest, None)


class _Loan:
    """Memory in use: the base of all arrays over it, which keep it alive."""

    __slots__ = ("__array_interface__", "_memory")

    def __init__(self, memory: Array, shape: Shape) -> None:
        self._memory = memory
        self.__array_interface__: dict[str, Any] = memory.__array_interface__ | {"shape": shape, "strides": None}

    def __del__(self, keep: Callable[[Array], None] = _keep) -> None:
        keep(self._memory)


def _memory(numbers: int) -> Array:
    """Memory for so many floats: free memory of the pool that is not much larger, or else new memory."""
    for memory in list(_free.values()):
        if numbers <= memory.size <= numbers + numbers // 8 and _free.pop(id(memory), None) is memory:
            return memory
    boundary = _CACHE_LINE if numbers < 2 * _LARGE_PAGE else _LARGE_PAGE
    room = np.empty(numbers + boundary)
    first = -(room.__array_interface__["data"][0] // 8) % boundary
    return room[first : first + numbers]


def empty(shape: Shape, dtype: Any = np.float64) -> Any:
    """As ``np.empty``, for a type of four or eight bytes."""
    numbers = prod(shape)
    if 8 * numbers < LEAST_POOLED:
        return np.empty(shape, dtype)
    if dtype is np.float64:
        return np.asarray(_Loan(_memory(numbers), shape))
    size = np.dtype(dtype).itemsize
    whole: Array = empty((-(-numbers * size // 8),))
    return whole.view(dtype)[:numbers].reshape(shape)
