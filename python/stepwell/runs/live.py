"""Parameters of a world that are written to between its steps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape, Whole
from ..errors import ArgumentError, DTypeError
from ..model import setting

#: The largest finite number.
LARGEST = float(np.finfo(np.float64).max)
#: The types of one number whose check is no more than two comparisons.
PLAIN = (float, int, np.float64)


class Live(NamedTuple):
    """A parameter that lives.

    Attributes:
        array: its numbers, to write into, shape (*own, *batch) or (*own,).
        known: its numbers as they are in the system.
        row: the name of its rows in the core.
        least: what each number is above.
        most: what each number is at most.
    """

    array: Array
    known: Array
    row: str
    least: float
    most: float

    def differs(self) -> bool:
        """True if something else was written than the system has."""
        return self.array.tobytes() != self.known.tobytes()


class Parameters(Mapping[str, Array]):
    """The parameters of a world as arrays to write into, by name; see ``World.parameters``."""

    __slots__ = ("_world",)

    def __init__(self, world: Any) -> None:
        self._world = world

    def __getitem__(self, name: str) -> Array:
        array: Array = self._world._live_array(name)
        return array

    def __setitem__(self, name: str, value: Any) -> None:
        """Set parameters, as ``world.set`` does."""
        self._world.set(**{name: value})

    def __iter__(self) -> Iterator[str]:
        return iter(setting.direct(self._world.system, self._world._plan.batch))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def __repr__(self) -> str:
        return f"<parameters of a world: {', '.join(self)}>"


def members_at(members: Any, batch: Shape) -> Whole:
    """The places in the flattened batch of the members that an index, a slice, a mask or an array of indices chooses."""
    if not batch:
        raise ArgumentError("members: expected a world with a batch, got one of a single member; write into world.v and world.y")
    try:
        index = np.asarray(members) if isinstance(members, list) else members
        places = np.arange(int(np.prod(batch))).reshape(batch)[index]
    except (IndexError, TypeError, ValueError, RuntimeError, MemoryError) as error:
        text = f"members: expected an index, a slice, a mask or an array of indices of a batch {batch}, got "
        kind = DTypeError if isinstance(error, TypeError) else ArgumentError
        raise kind(f"{text}{checks.short(members)} ({error})") from None
    places = np.asarray(places)
    if len(np.unique(places)) != places.size:
        raise ArgumentError(f"members: expected each member once, got {checks.short(members)}")
    return places
