"""Findings about a run, which the public functions turn into warnings."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Shape, Whole
from ..base.immutable import by_value
from ..model.systems import System


@by_value
class Finding(NamedTuple):
    """A finding about a run, of which ``integrate`` warns.

    Attributes:
        category: the class of the warning, such as ``stepwell.DivergenceWarning``.
        message: the text of the warning.
        members: which members it is about, an array of truths of shape (*batch).
    """

    category: type[Warning]
    message: str
    members: np.ndarray[Any, np.dtype[np.bool_]]


def at_places(category: type[Warning], message: str, places: Whole, shape: Shape) -> Finding:
    """A finding about the members at these places of a flattened batch of this shape."""
    members = np.zeros(shape, dtype=bool)
    members.reshape(-1)[places] = True
    return Finding(category, message, members)


def is_heard(category: type[Warning]) -> bool:
    """True if a warning of this class may be shown; if not, a search that takes a while can be left out."""
    for action, message, ignored, module, _ in warnings.filters:
        if message is None and module is None and issubclass(category, ignored):
            return action != "ignore"
    return True


def warn_of(findings: Iterable[Finding], stacklevel: int = 2) -> None:
    """Warn of findings, as of the caller of the function that calls this."""
    for each in findings:
        warnings.warn(each.message, each.category, stacklevel=stacklevel + 1)


def may_have_amounts(system: System) -> bool:
    """True if the numbers of a system may be amounts: its own equations of first order, whose rates do not change by themselves.

    What algebraic equations give is no rate, and rates at one time say nothing of those at another.
    """
    is_own = bool(system.groups) and not prod(system.v_shape) and system.mass_matrix is None
    return is_own and not system.reads_time and not system.all_inputs()
