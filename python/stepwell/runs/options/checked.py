"""The options of one run, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.arrays import Shape
from ...base.immutable import frozen
from ...errors import ArgumentError
from ...model.methods import Method
from ...model.systems import System
from . import OPTIONS, Options
from .option import No, Way

if TYPE_CHECKING:
    from ..continuation import Continuation


class Checked(dict[str, Any]):
    """The options of a run by name, each checked when it is first read; one that was left out has its default.

    Args:
        options: what the user wrote.
        adaptive: why steps are adaptive, for messages; None if they are fixed.
        way: "World" or "sweep"; None for ``integrate``.
        system: the system that is stepped, with the shapes of the start; a sweep does not know it.
        method: the method.
        before: the run that goes on.

    Raises:
        ArgumentError: if there is an option that does not go with these steps, or with a world or a sweep.
    """

    def __init__(
        self,
        options: Options,
        adaptive: str | None,
        *,
        way: Way | None = None,
        system: System | None = None,
        method: Method | None = None,
        before: Continuation | None = None,
    ) -> None:
        super().__init__()
        self.options, self.is_adaptive, self.way = options, adaptive is not None, way
        self.system: Any = system
        self.method: Any = method
        #: Whether the state at the start must be finite: members may have diverged before.
        self.is_finite = before is None or before.first_bad_step is None
        refuse(options, "fixed" if adaptive is None else "adaptive", adaptive)
        if way is not None:
            refuse(options, way)

    def __missing__(self, name: str) -> Any:
        option, value = OPTIONS[name], getattr(self.options, name)
        if value is None and not option.is_always_checked:
            value = option.default
        elif option.check is not None:
            value = option.check(value, self)
        self[name] = value
        return value

    def given(self, name: str) -> bool:
        """True if the option was not left out."""
        return getattr(self.options, name) is not None

    def of_plan(self) -> dict[str, Any]:
        """The fields of the plan that options set; by then every option is checked."""
        for name in asked_for(self.options):
            self[name]
        return {option.plan: self[name] for name, option in OPTIONS.items() if option.plan is not None}

    def going_on(self) -> dict[str, Any]:
        """The options that a run that goes on has, too, as they were written."""
        return {name: fixed(name, getattr(self.options, name)) for name in asked_for(self.options) if OPTIONS[name].goes_on}

    def batches(self) -> dict[str, Shape]:
        """The batch axes of the system and of the options that were not left out."""
        axes = {"system": self.system.batch}
        for name, option in OPTIONS.items():
            if option.batch is not None and self.given(name):
                axes[name] = option.batch(self[name], self.system)
        return axes


def asked_for(options: Options) -> list[str]:
    """The names of the options that were not left out, and are not as if they were."""
    each = zip(OPTIONS.items(), options, strict=True)
    return [
        name for (name, of), value in each if value is not None and not (isinstance(value, (str, bool)) and value == of.default)
    ]


def fixed(name: str, value: Any) -> Any:
    """An option that does not change any more, whatever the user writes into an array."""
    if isinstance(value, np.ndarray):
        return frozen(name, value)
    if type(value) in (list, tuple):
        return type(value)(frozen(name, each) if isinstance(each, np.ndarray) else each for each in value)
    return value


def refuse(options: Options, way: Way, adaptive: str | None = None) -> None:
    """Raise if there is an option that does not go with a way; ``adaptive`` says why steps are that."""
    refused: dict[str, list[str]] = {}
    for name in asked_for(options):
        if isinstance(no := OPTIONS[name].ways.get(way), No):
            refused.setdefault(no.why, []).append(name)
    for why, names in refused.items():
        raise ArgumentError(f"{', '.join(names)}: {why.format(adaptive=adaptive)}")
