"""Equality by value, for objects that hold arrays: ``==`` of arrays is an array, and a copy or a pickle is another object."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np

Kind = TypeVar("Kind")


class Value:
    """Equal to another of its class if all that it holds is equal, arrays number by number; NaN equals NaN."""

    def _held(self) -> dict[str, Any]:
        """What counts, by name: the fields of a dataclass (and not what it has cached), or else all attributes."""
        if dataclasses.is_dataclass(self):
            return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.compare}
        return vars(self)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return same(self._held(), other._held())

    def __hash__(self) -> int:
        # Arrays cannot be hashed; words and whole numbers distinguish many objects.
        return hash((type(self), *(each for each in self._held().values() if isinstance(each, (str, int)))))


def by_value(kind: type[Kind]) -> type[Kind]:
    """A named tuple likewise: without this ``==``, and ``!=`` apart from it, would ask arrays for their truth."""

    def equal(self: Any, other: Any) -> bool:
        return bool(type(other) is kind) and same(tuple(self), tuple(other))

    def unequal(self: Any, other: Any) -> bool:
        return not equal(self, other)

    def digest(self: Any) -> int:
        return hash((kind, *(each for each in self if isinstance(each, (str, int)))))

    methods = {"__eq__": equal, "__ne__": unequal, "__hash__": digest}
    for name, method in methods.items():
        setattr(kind, name, method)
    return kind


def same(a: Any, b: Any) -> bool:
    """Whether two things hold the same: arrays by shape, kind and numbers, the parts of containers one by one."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        if type(a) is not type(b) or a.dtype != b.dtype or a.shape != b.shape:
            return False
        return bool(((a == b) | ((a != a) & (b != b))).all())
    if isinstance(a, float) and isinstance(b, float):
        return a == b or (a != a and b != b)
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)) and type(a) is type(b):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)
