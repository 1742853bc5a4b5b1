"""Memory of large results: fresh pages cost more than to fill them, so what is given back is lent again.

A run that keeps every step writes some megabytes in a few milliseconds. The system clears each new page before it is written,
a small page (4 KiB) at a time unless it may give large ones (2 MiB), and takes all back when the arrays are gone. So large arrays
begin at the edge of a large page; and when the last array over such memory is gone, the memory stays for the next result, up to
``MOST_KEPT`` bytes in all.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from ._checks import Array, Shape

#: Arrays of fewer bytes are NumPy's own: the allocator keeps memory of such sizes by itself.
LEAST_LENT = 1 << 20
#: What is kept in all, in bytes, while nobody uses it.
MOST_KEPT = 1 << 26
#: Size of a large page, in numbers.
_LARGE_PAGE = (1 << 21) // 8

#: What nobody uses, by identity, the newest last. Arrays may be given back at any moment, between any two operations on it.
_kept: dict[int, Array] = {}


def _keep(memory: Array, kept: dict[int, Array] = _kept, most: int = MOST_KEPT) -> None:
    """Keep what is given back. The last of it comes when the interpreter ends, and finds no names of this file any more."""
    if memory.nbytes > most:
        return
    kept[id(memory)] = memory
    for oldest in list(kept):
        if sum([each.nbytes for each in list(kept.values())]) <= most:
            break
        kept.pop(oldest, None)


class _Loan:
    """Memory that is lent: the base of all arrays over it, which keep it alive."""

    __slots__ = ("__array_interface__", "_memory")

    def __init__(self, memory: Array, shape: Shape) -> None:
        self._memory = memory
        self.__array_interface__: dict[str, Any] = memory.__array_interface__ | {"shape": shape, "strides": None}

    def __del__(self, keep: Callable[[Array], None] = _keep) -> None:
        keep(self._memory)


def _memory(numbers: int) -> Array:
    """Room for so many numbers: what was used before and is not much larger, or else new."""
    for memory in list(_kept.values()):
        if numbers <= memory.size <= numbers + numbers // 8 and _kept.pop(id(memory), None) is memory:
            return memory
    if numbers < 2 * _LARGE_PAGE:
        return np.empty(numbers)
    room = np.empty(numbers + _LARGE_PAGE)
    first = -(room.__array_interface__["data"][0] // 8) % _LARGE_PAGE
    return room[first : first + numbers]


def empty(shape: Shape) -> Array:
    """As ``np.empty``, of float64."""
    numbers = prod(shape)
    if 8 * numbers < LEAST_LENT:
        return np.empty(shape)
    return np.asarray(_Loan(_memory(numbers), shape))
