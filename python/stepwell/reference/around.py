"""Parts around a system, which wrap it one after the other, each a system itself, scaled to the step."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..base.arrays import Array, Scaled

#: The kinds of parts, from the inside out: friction resists all other forces, so it comes last.
ORDER = (
    "surfaces",
    "control",
    "force",
    "friction",
    "controller",
)

#: A part, and its parameters by name: numbers, or symbols.
Bound = tuple[Any, dict[str, Any]]


def wrapped(s: Any, h: Any, parts: Iterable[Bound]) -> Any:
    """A system, scaled to the step h, with these parts around it."""
    for part, parameters in sorted(parts, key=lambda each: ORDER.index(each[0].kind)):
        s = part.wrap(s, h, parameters)
    return s


class Around:
    """A system around another one, which has whatever it does not define itself."""

    def __init__(self, s: Any) -> None:
        self.s = s

    def __getattr__(self, name: str) -> Any:
        return getattr(self.s, name)

    @property
    def work(self) -> Any:
        """The sum that a control within it accumulates; an AttributeError without one."""
        return self.s.work

    @work.setter
    def work(self, work: Any) -> None:
        self.s.work = work


class Forced(Around):
    """A force is added to v̇, but to that of fixed particles."""

    def __init__(self, s: Scaled, h: float, force: Array) -> None:
        super().__init__(s)
        self.push = h * force

    def dv(self, t: float, v: Array, y: Array) -> Array:
        """h·v̇ and h times the force."""
        dv = np.asarray(self.s.dv(t, v, y))
        pushed = np.asarray(dv + self.push)
        if len(fixed := getattr(self.s, "fixed", ())):
            pushed[fixed] = dv[fixed]
        return pushed


def whole_step(step: Callable[..., Any], s: Any, t: float, h: float, v: Array, y: Array, *kept: Array) -> Any:
    """A step of a method, and coming to rest and projection after it; what the method keeps stands behind v and y."""
    new_v, new_y, *kept_now = step(s, t, h, v, y, *kept)
    if hasattr(s, "bring_to_rest"):
        new_v = s.bring_to_rest(t, v, y, new_v)
    new_v, new_y = s.project(new_v, new_y) if hasattr(s, "project") else (new_v, new_y)
    return new_v, new_y, *kept_now
