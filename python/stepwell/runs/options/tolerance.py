"""The argument ``tolerance=``: relative, or relative and absolute, each for all, for components or for members."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import DTypeError, ShapeError, UnsupportedError
from ...model.methods import Method
from ...model.systems import System
from ...reference.acceptance import NO_GROUP, Acceptance
from .. import engine


def tolerances_of(tolerance: Any, system: System, acceptance: Acceptance, batch: Shape) -> engine.Tolerances:
    """The relative one, and the absolute one of a pair: numbers over the batch, or of each component along the first axis."""
    if isinstance(tolerance, list):
        raise DTypeError(
            "tolerance: expected a number, an array, or a tuple (relative, absolute), got a list, which might be meant as "
            "either; make it a NumPy array or a tuple"
        )
    parts = tolerance if isinstance(tolerance, tuple) else (tolerance,)
    if isinstance(tolerance, tuple) and len(parts) != 2:
        raise ShapeError(f"tolerance: expected a number or a pair (relative, absolute), got {len(parts)} of them")
    relative = checks.numbers("tolerance", parts[0], positive=True)
    absolute = None if len(parts) == 1 else checks.not_negative("tolerance", parts[1])
    axes = len(system.y_shape)
    of_members = [
        part.ndim > axes and part.shape[:axes] == axes * (1,) and axes > 0 for part in (relative, absolute) if part is not None
    ]
    each = [relative] if absolute is None else [relative, absolute]
    each = [part.reshape(part.shape[axes:]) if one else part for part, one in zip(each, of_members, strict=True)]
    relative, absolute = each[0], each[1] if len(each) > 1 else None
    of_components = [not one and _is_of_components(part, system, batch) for part, one in zip(each, of_members, strict=True)]
    if not any(of_components):
        return engine.Tolerances(relative, absolute)
    of_groups = [_of_groups(part, own, system, acceptance) for part, own in zip(each, of_components, strict=True)]
    return engine.Tolerances(of_groups[0], of_groups[1] if len(of_groups) > 1 else None, of_groups=True)


def _is_of_components(part: Array, system: System, batch: Shape) -> bool:
    """True if a tolerance is one for each component of y, shape (*block, …), and not one for each member."""
    axes = len(system.y_shape)
    fits = bool(axes) and part.ndim >= axes and part.shape[:axes] == system.y_shape
    if fits and not system.groups and part.ndim <= len(batch):
        return False  # the components of its blocks count together, so it is meant for members
    if fits and part.ndim <= len(batch) and part.shape == batch[len(batch) - part.ndim :]:
        raise ShapeError(
            f"tolerance: an array of shape {part.shape} may be meant for each component of y or for each member; give it the "
            f"shape (*block, *batch): {system.y_shape + len(batch) * (1,)} for components, {axes * (1,) + part.shape} for members"
        )
    return fits


def _of_groups(part: Array, of_components: bool, system: System, acceptance: Acceptance) -> Array:
    """A tolerance for each group of components: the least of its components."""
    n_v, n_y = prod(system.v_shape), prod(system.y_shape)
    groups = acceptance.of_numbers(n_v, n_y)
    count = sum(acceptance.counts(n_v, n_y))
    if not of_components:
        return np.broadcast_to(part, (count, *part.shape)) if part.ndim else checks.over(part, (count,))
    if n_v not in (0, n_y):
        raise ShapeError(
            f"tolerance: v and y have different shapes, {system.v_shape} and {system.y_shape}; give one number for all"
        )
    rows = part.reshape(n_y, *part.shape[len(system.y_shape) :])
    of_each = np.concatenate([rows, rows]) if n_v else rows
    if groups == tuple(range(len(of_each))):
        return of_each  # each component is a group
    least = np.full((count, *rows.shape[1:]), np.inf)
    for group, row in zip(groups, of_each, strict=True):
        if group != NO_GROUP:
            least[group] = np.minimum(least[group], row)
    return least


def order_of_series(method: Method, relative: Array) -> int:
    """The order of a series for relative tolerances, one for each member or all; 0 for a method with one order.

    Raises:
        UnsupportedError: if members would need different orders.
    """
    if not method.has_series or not relative.size:
        return 0
    from ...reference import series_pace  # only such runs need it

    least, most = (relative.item(),) * 2 if relative.size == 1 else (float(relative.min()), float(relative.max()))
    order = series_pace.order_of(least)
    if most != least and series_pace.order_of(most) != order:
        raise UnsupportedError(
            f"tolerance: expected tolerances of one order for all members, so that a member does not depend on others, got "
            f"{least:g} (order {order}) to {most:g} (order {series_pace.order_of(most)}); make a run for each"
        )
    return order
