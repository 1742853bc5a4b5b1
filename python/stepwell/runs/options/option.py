"""An option of a run: its documentation, its check, and the runs with which it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

from ...base.arrays import Shape

#: What a run is, as far as options know: by its steps, and by what makes it, if not ``integrate``. A step is one of an export.
Way = Literal["fixed", "adaptive", "World", "sweep", "step"]


class No(NamedTuple):
    """An option does not go with a way; ``why`` follows its name in the message, with what made steps adaptive for {adaptive}."""

    why: str


class Option(NamedTuple):
    """One option of a run.

    Attributes:
        text: its documentation.
        check: the option as the request has it, from what the user wrote and ``Checked``; raises if it is wrong. It is not
            called for None, which stands for an option that was left out.
        default: what the request has if it was left out.
        ways: for the ways of which more is to be said, another documentation, or why it does not go with them.
        batch: the batch axes, from the option as it was checked and the system; None if it has none.
        plan: the field of the plan that it sets; None if it sets none.
        goes_on: whether a run that goes on has it, unless it is given again.
        given_again: whether each piece of a run is given it, since it says how the piece is computed.
        is_always_checked: whether None is checked, too, since it means what the environment says.
    """

    text: str
    check: Callable[[Any, Any], Any] | None = None
    default: Any = None
    ways: Mapping[Way, str | No] = {}
    batch: Callable[[Any, Any], Shape] | None = None
    plan: str | None = None
    goes_on: bool = False
    given_again: bool = False
    is_always_checked: bool = False

    def text_of(self, way: Way | None) -> str | None:
        """The documentation for ``integrate``, or for a way; None if it does not go with it."""
        text = self.text if way is None else self.ways.get(way, self.text)
        return text if isinstance(text, str) else None
