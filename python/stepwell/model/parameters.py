"""Parameters by name (arrays, signals, strings), converted for the core. An array has its own axes before those of the batch."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from ..base.arrays import Array, Shape
from ..reference.signal import COMPOSED, Held, converted

#: Parameters as the core takes them: names with strings, whole numbers, lists of whole numbers (as bytes, four for each), rows of
#: numbers for each member (or one for all), and tables of samples: start, interval, a row for each sample.
CoreParameters = list[tuple[str, Any]]

#: The strides of an array of floats along one axis, one after the other in memory.
CONTIGUOUS = (8,)


def flat(parameters: dict[str, Any], batch: Shape) -> CoreParameters:
    """Parameters as the core takes them: without those that are None, and with a list as its length and its elements."""
    entries: CoreParameters = []
    for name, value in parameters.items():
        if value is None:
            continue
        if type(value) is np.ndarray:  # first, because it is the most frequent case and quick to test
            entries.append((name, rows(value, batch)))
            continue
        match value:
            case str() | int() | bytes():
                entries.append((name, value))
            case list():
                entries.append((name, len(value)))
                entries += flat({f"{name}[{i}]": each for i, each in enumerate(value)}, batch)
            case Held():
                entries.append((name, (value.start, value.interval, rows(value.values, batch, 1))))
            case _ if isinstance(value, COMPOSED):
                entries += flat({name + behind: part for behind, part in value.parts().items()}, batch)
            case _:
                entries.append((name, rows(value, batch)))
    return entries


def rows(values: Array, batch: Shape, own: int | None = None) -> Array:
    """Numbers as rows for the core, with one number for each member or one for all.

    ``own`` is the number of axes before those of the batch; if None, all axes that the batch does not have.
    """
    if not batch:
        return np.ascontiguousarray(values).reshape(-1, 1)
    if not own and values.strides == CONTIGUOUS and values.shape == batch:
        return values.reshape(1, -1)  # the most frequent shape of a batch: one number for each member along one axis
    own = max(0, values.ndim - len(batch)) if own is None else own
    counted, over = values.shape[:own], values.shape[own:]
    if is_common(values, own):
        for _ in over:
            values = values[..., 0]
        return np.ascontiguousarray(values.reshape(-1, 1))
    if over != batch:
        values = np.broadcast_to(aligned(values, own, batch), (*counted, *batch))
    return np.ascontiguousarray(values.reshape(prod(counted), prod(batch)))


def is_common(values: Array, own: int) -> bool:
    """True if all members share these numbers."""
    return all(size == 1 or stride == 0 for size, stride in zip(values.shape[own:], values.strides[own:], strict=True))


def aligned(values: Array, own: int, batch: Shape) -> Array:
    """Numbers with ``own`` axes of their own first, and then as many axes as the batch has."""
    return values.reshape((*values.shape[:own], *(1,) * (len(batch) - values.ndim + own), *values.shape[own:]))


def in_a_row(values: Array, batch: Shape, own: int | None = None) -> Array:
    """Numbers with a single batch axis after their own; its length is that of the batch, or 1 if all members share them."""
    own = max(0, values.ndim - len(batch)) if own is None else own
    over = values.shape[own:]
    if is_common(values, own):
        return np.array(values[(slice(None),) * own + (0,) * len(over)])[..., np.newaxis]
    return np.broadcast_to(aligned(values, own, batch), (*values.shape[:own], *batch)).reshape((*values.shape[:own], -1))


def of_shape(parameters: dict[str, Any], batch: Shape) -> dict[str, Any]:
    """Parameters with a single batch axis, reshaped for a batch whose last axis it is."""
    if len(batch) == 1:
        return parameters
    return with_numbers(parameters, lambda values, own: values.reshape((*values.shape[:-1], *(1,) * (len(batch) - 1), -1)))


def with_numbers(parameters: dict[str, Any], change: Callable[[Array, int | None], Array]) -> dict[str, Any]:
    """Parameters with ``change`` applied to their numbers.

    Its arguments are the numbers and the number of their own axes: None for all axes that the batch does not have.
    """

    def table(samples: Held) -> Held:
        return Held(change(samples.values, 1), samples.interval, samples.start)

    return {name: converted(value, lambda each: change(each, None), table) for name, value in parameters.items()}
