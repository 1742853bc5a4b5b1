"""Comparisons by name, as in NumPy; with a NaN all are false except ``not_equal``.

``==`` of symbols is an error, and so is ``<`` of arrays of symbols, since NumPy asks for the truth of each element. These
functions accept both. Their results are combined by ``&``, ``|`` and ``~``, and used in ``where``.
"""

from __future__ import annotations

from typing import Any

from .. import bits
from .elementary import elementary


@elementary
def less(x: Any, y: Any) -> Any:
    """True where x < y."""
    return x < y


@elementary
def less_equal(x: Any, y: Any) -> Any:
    """True where x ≤ y."""
    return x <= y


@elementary
def greater(x: Any, y: Any) -> Any:
    """True where x > y."""
    return x > y


@elementary
def greater_equal(x: Any, y: Any) -> Any:
    """True where x ≥ y."""
    return x >= y


@elementary
def equal(x: Any, y: Any) -> Any:
    """True where x = y, as −0 and 0 are."""
    return bits.equal(x, y)


@elementary
def not_equal(x: Any, y: Any) -> Any:
    """True where x ≠ y, or one of both is NaN."""
    return ~bits.equal(x, y)
