"""Findings: what is noticed of a run, as its warnings say it."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Shape, Whole
from ..base.immutable import by_value
from ..base.reprs import first_of, in_words, share


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


class Named(NamedTuple):
    """Some members of a batch, in words."""

    place: Shape  # of the first of them
    share: str  # "2 of 3 members", "the run"
    first: str  # which was first, after a colon or a semicolon; empty for a single member
    has: str  # "member 3 has ", with the space; empty for a single member
    have: str  # "has" or "have"


def named(members: Any, index: Shape | None = None, alone: str = "the run") -> Named:
    """The members at the truths of an array; ``index`` is that of the first, if it is not the first in the array."""
    index = tuple(np.argwhere(members)[0].tolist()) if index is None else index
    some, size = int(np.count_nonzero(members)), members.size
    who, has = share(some, members.shape, size, alone), f"{in_words(index)} has " if size > 1 else ""
    return Named(index, who, first_of(some, index, size), has, "has" if some == 1 else "have")


def only(shape: Shape, places: Any) -> Any:
    """Truths for the members at these places of a batch of this shape."""
    members = np.zeros(shape, dtype=bool)
    members[places] = True
    return members


@by_value
class Found(NamedTuple):
    """Members of a batch with one finding, and the parts of its sentence, which sweeps join for all of their chunks."""

    category: type[Warning]
    members: Whole  # their places in the flattened batch
    shape: Shape  # of the batch
    before: str  # what is said before how many they are
    between: str  # and from there to which was first
    joint: str  # what stands between that and the reason
    why: str  # the reason for the first of them, and what to do

    def sentence(self, who: str, first: str) -> str:
        """The message about so many members, of which that was first."""
        return f"{self.before}{who}{self.between}{first}{self.joint} {self.why}"

    def finding(self) -> Finding:
        """The finding of a run of this batch."""
        members = only((prod(self.shape),), self.members).reshape(self.shape)
        who = named(members)
        return Finding(self.category, self.sentence(who.share, who.first), members)


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
