"""Checks of what users give, before any work. Each raises one clear error or returns what it was given, made usable."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable
from functools import cache
from math import isfinite
from typing import Any

import numpy as np

from .errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, TooLargeError, UnknownNameError
from .reference.types import Array as Array
from .reference.types import Whole

Shape = tuple[int, ...]

#: Step numbers above this are no longer exact as floating-point numbers, so neither would be t = t0 + k·dt.
LAST_STEP = 2**53


def known(argument: str, name: object, names: Iterable[str]) -> str:
    """Return ``name`` if it is one of ``names``; otherwise say which is the nearest."""
    names = tuple(names)
    if isinstance(name, str) and name in names:
        return name
    import difflib  # a mistake may take its time; the import of stepwell may not

    near = difflib.get_close_matches(str(name).lower().replace(" ", "_").replace("-", "_"), names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise UnknownNameError(f"{argument}: there is no {name!r}{hint} Known: {', '.join(names)}.")


def numbers(argument: str, value: Any, *, positive: bool = False, finite: bool = True, unit: str = "") -> Array:
    """Return ``value`` as float64, if it is real, finite unless told otherwise, and positive if asked."""
    if type(value) is float and isfinite(value) and (not positive or value > 0.0):
        return np.array(value)  # what is given most often: no more to look at
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{argument}: expected a number or a regular array, got {type(value).__name__} ({error})") from None
    if array.dtype.kind not in "iuf":
        raise DTypeError(f"{argument}: expected real numbers{_in(unit)}, got {_kind(value, array)}")
    array = np.asarray(array, dtype=np.float64)
    # One look at all; where it is wrong is asked only if it is.
    if finite and not np.isfinite(array).all():
        wrong = ~np.isfinite(array)
        raise NotFiniteError(f"{argument}: expected finite numbers{_in(unit)}, got {array[wrong][0]}{_where(wrong)}")
    if positive and (wrong := array <= 0).any():
        raise ArgumentError(f"{argument}: expected numbers above zero{_in(unit)}, got {array[wrong][0]:g}{_where(wrong)}")
    return array


def number(argument: str, value: Any, *, positive: bool = False, unit: str = "") -> float:
    """Return ``value`` as one float."""
    if type(value) is float and isfinite(value) and (not positive or value > 0.0):
        return value
    array = numbers(argument, value, positive=positive, unit=unit)
    if array.ndim:
        raise ShapeError(f"{argument}: expected one number{_in(unit)}, got an array of shape {array.shape}")
    return float(array)


def count(argument: str, value: Any, least: int, most: int = LAST_STEP) -> int:
    """Return ``value`` as a whole number in ``least … most``."""
    try:
        n = operator.index(value)
    except TypeError:
        raise DTypeError(f"{argument}: expected a whole number, got {value!r} ({type(value).__name__})") from None
    if isinstance(value, (bool, np.bool_)):
        raise DTypeError(f"{argument}: expected a whole number, got {value!r} (bool)")
    if not least <= n <= most:
        raise ArgumentError(f"{argument}: expected {least} or more{'' if n < least else f', up to {most}'}, got {n}")
    return n


def block(argument: str, value: Any, shape: Shape, axes: str, *, finite: bool = True) -> Array:
    """Return a state block whose leading axes are ``shape``; a single number fills the whole block."""
    array = numbers(argument, value, finite=finite)
    if array.ndim == 0:
        return over(array, shape)
    if array.shape[: len(shape)] != shape:
        raise ShapeError(f"{argument}: expected shape {_shape(shape, axes)}, got {array.shape}; batch axes come last")
    return array


def over(array: Array, shape: Shape) -> Array:
    """One number over a whole shape, as ``np.broadcast_to`` gives it, which takes ten times as long."""
    if not shape:
        return array
    wide = np.ndarray(shape, np.float64, np.ascontiguousarray(array), strides=(0,) * len(shape))
    wide.flags.writeable = False
    return wide


def batch_shape(shapes: dict[str, Shape]) -> Shape:
    """Return the shape to which all batches broadcast, the arguments by name."""
    different = set(shapes.values()) - {()}
    if not different:
        return ()
    try:
        shape = different.pop() if len(different) == 1 else np.broadcast_shapes(*different)
    except ValueError:
        given = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise ShapeError(f"these batch shapes do not broadcast to one: {given}") from None
    if 0 in shape:
        empty = ", ".join(name for name, shape in shapes.items() if 0 in shape)
        raise ShapeError(f"{empty}: expected at least one member, got an empty batch of shape {shape}")
    return shape


def diverged_before(first_bad_step: Any, v: Array, y: Array, batch: Shape) -> Whole | None:
    """Return the first bad step of each member, −1 for none; only members that have one may hold what is not finite."""
    if first_bad_step is None:
        return None
    steps = np.asarray(first_bad_step)
    if steps.dtype.kind not in "iu" or steps.shape != batch:
        raise ShapeError(f"first_bad_step: expected whole numbers of shape {batch}, got {steps.dtype} of shape {steps.shape}")
    for argument, array in (("v", v), ("y", y)):
        if (wrong := ~np.isfinite(array) & (steps < 0)).any():
            raise NotFiniteError(f"{argument}: expected finite numbers, got {array[wrong][0]}{_where(wrong)}")
    return np.array(steps, dtype=np.int64)


def member(array: Array, index: Shape) -> Array:
    """The part of an array that belongs to one member; batch axes come last."""
    for i in reversed(index):
        array = array[..., i]
    return np.asarray(array)


def fits(what: str, rows: int, batch: Shape, remedy: str) -> None:
    """Raise if ``rows`` numbers for each member of a batch do not fit in this machine's memory."""
    members = 1
    for n in batch:
        members *= int(n)
    needed = 8.0 * rows * members
    if needed > (memory := _memory()):
        raise TooLargeError(
            f"{what} of {members} members need {needed / 2**30:.3g} GiB, but this machine has {memory / 2**30:.3g} GiB; {remedy}"
        )


@cache
def _memory() -> float:
    """This machine's memory in bytes; no bound where it cannot be asked."""
    return float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES")) if hasattr(os, "sysconf") else 2.0**63


def in_place(argument: str, array: Any, shape: Shape) -> Array:
    """Return ``array`` if it can be stepped in place; it is never copied."""
    if not isinstance(array, np.ndarray):
        raise DTypeError(f"{argument}: expected a NumPy array to step in place, got {type(array).__name__}")
    if array.dtype != np.float64 or not array.dtype.isnative:
        raise DTypeError(f"{argument}: expected dtype float64 to step in place, got {array.dtype}")
    if array.shape != shape:
        raise ShapeError(f"{argument}: expected shape {shape}, got {array.shape}")
    if not array.flags.c_contiguous:
        raise ArgumentError(f"{argument}: expected a C-contiguous array to step in place, got strides {array.strides}")
    if not array.flags.writeable:
        raise ArgumentError(f"{argument}: expected a writeable array to step in place, got a read-only one")
    numbers(argument, array)
    return array


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""


def _kind(value: Any, array: np.ndarray[Any, Any]) -> str:
    return repr(value) if array.ndim == 0 else f"an array of dtype {array.dtype}"


def _where(wrong: np.ndarray[Any, np.dtype[np.bool_]]) -> str:
    return f" at index {tuple(int(i) for i in np.argwhere(wrong)[0])}" if wrong.ndim else ""


def _shape(shape: Shape, axes: str) -> str:
    return f"({', '.join(str(n) for n in shape)}, batch…){f' = ({axes}, batch…)' if axes else ''}"
