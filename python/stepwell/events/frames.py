"""Events of a world: looked for after each of its steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .. import _checks, engine
from .._checks import Array
from ..errors import UnsupportedError
from ..reference.types import Whole
from .collected import Collected
from .event import Event
from .members import Members
from .parts import Changes
from .result import Occurrences
from .trials import Trials


class Frames(Collected):
    """The events of one call of ``World.step``, in place of the core's.

    Args:
        plan: of the world; ``force`` is the array of the world, which its owner changes.
        events: what was asked for.
        v: the arrays that are stepped.
        y: likewise.
        steps: the core's ``step``.
        number: tells at which step the world stands.
    """

    def __init__(
        self,
        plan: engine.Plan,
        events: Sequence[Event],
        v: Array,
        y: Array,
        steps: Callable[[int], None],
        number: Callable[[], int],
    ) -> None:
        if stops := [each for each in events if each.terminal]:
            raise UnsupportedError(
                f"events: no event stops a member of a world, got {stops[0]!r}; read world.events after a step, and write "
                f"into world.v and world.y"
            )
        if changing := [each for each in events if each.then is not None]:
            raise UnsupportedError(
                f"events: no event changes the state of a world by then=, got {changing[0]!r}; "
                f"integrate(…, dt=…, steps=…) takes it"
            )
        super().__init__(plan, events)
        self._blocks, self._steps, self._number = (v, y), steps, number
        self._told: dict[str, Occurrences] | None = None
        self._all = np.arange(plan.members)

    def step(self, n: int = 1) -> None:
        """Make n steps in place; what happened in them is then in ``World.events``."""
        n = _checks.count("n", n, 0)
        self.clear()
        self._told = None
        g = self._quantities(self._number())
        self.before[:] = np.nan
        for _ in range(n):
            step, before = self._number(), [each.copy() for each in self._blocks]
            self._steps(1)
            after = self._quantities(self._number())
            may = [self.may_change(e, self._all, np.stack(ends)) for e, ends in enumerate(zip(g, after, strict=True))]
            if np.any(may):
                self._found(step, may, g, after, before)
            g = after
        for e in range(len(self.events)):
            self.locate_waiting(e)

    @property
    def told(self) -> dict[str, Occurrences]:
        """What happened in the last call."""
        if self._told is None:
            self._told = self.occurrences()
        return self._told

    def _quantities(self, step: int) -> list[Array]:
        """The quantities of all members where the world stands."""
        t: Any = np.array(self.plan.t0 + step * self.plan.dt)
        given = self.members.numbers(slice(None))
        v, y = self._flat(self._blocks)
        return [quantity(t, v, y, given).copy() for quantity in self.quantities]  # not views of what is stepped in place

    def _flat(self, blocks: Sequence[Array]) -> tuple[Array, ...]:
        """Blocks with one axis for all members."""
        shapes = self.plan.system.v_shape, self.plan.system.y_shape
        return tuple(each.reshape(*shape, len(self._all)) for each, shape in zip(blocks, shapes, strict=True))

    def _found(self, step: int, may: list[Any], g: list[Array], after: list[Array], before: list[Array]) -> None:
        """Take what happened in a step."""
        if self.plan.force is not None:  # which may be another one than in the last call
            force = np.array(self.plan.force)
            self.members = Members(self.plan._replace(force=force))
            self.trials = Trials(self.plan._replace(force=force), self.members)
        states = *self._flat(before), *self._flat(self._blocks)
        finite = np.logical_and.reduce([np.isfinite(each).all(axis=tuple(range(each.ndim - 1))) for each in states[2:]])
        t = self.plan.t0 + step * self.plan.dt

        def known(e: int, row: Whole, place: Whole) -> Changes:
            number, times, lengths = (np.full(len(place), each) for each in (step, t, self.plan.dt))
            low, high, values = np.zeros(len(row)), np.ones(len(row)), (g[e][place], after[e][place])
            v, y, v_end, y_end = (each[..., place] for each in states)
            return Changes(row, place, place, number, times, lengths, low, high, *values, v, y, v_end, y_end)

        self.take(self._all, 1, [self.changes(e, each & finite, known) for e, each in enumerate(may)])
