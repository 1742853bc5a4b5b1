"""Comparisons by name, as NumPy has them; true of no NaN but ``not_equal``.

Of symbols, ``==`` is an error, and where arrays of symbols are compared by ``<``, NumPy asks for the truth of each element. These
do neither. What they give is joined by ``&``, ``|`` and ``~``, and goes into ``where``.
"""

from __future__ import annotations

from typing import Any

from . import operations
from .operations import elementary


@elementary
def less(x: Any, y: Any) -> Any:
    """Whether x < y."""
    return x < y


@elementary
def less_equal(x: Any, y: Any) -> Any:
    """Whether x ≤ y."""
    return x <= y


@elementary
def greater(x: Any, y: Any) -> Any:
    """Whether x > y."""
    return x > y


@elementary
def greater_equal(x: Any, y: Any) -> Any:
    """Whether x ≥ y."""
    return x >= y


@elementary
def equal(x: Any, y: Any) -> Any:
    """Whether x = y; of −0 and 0 it is."""
    return operations.equal(x, y)


@elementary
def not_equal(x: Any, y: Any) -> Any:
    """Whether x ≠ y, or one of both is NaN."""
    return ~operations.equal(x, y)
