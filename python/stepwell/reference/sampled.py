"""A sampled controller: every so many steps it reads the state and sets parameters of a system, which it holds in between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from . import bits

#: From a time, v, y and the numbers of a controller's state: the numbers that it sets, and its next state.
Controlled = Callable[[Any, Any, Any, list[Any]], tuple[list[Any], list[Any]]]


class Loop(NamedTuple):
    """A controller in a loop of steps.

    What it remembers is a list of numbers: how many steps ago it read the state last; its own state; what it has computed and not
    put out yet, of each sample a number for each that it sets, the oldest first; and, with ``later``, what it holds.

    Attributes:
        control: what it computes.
        sets: how many numbers it sets.
        waiting: how many samples its results wait.
        last: how many steps there are from one sample to the next, less one.
        later: so many steps after a sample results are put out; None where that is at a sample.
    """

    control: Controlled
    sets: int
    waiting: int
    last: Any
    later: Any = None

    def step(self, t: Any, v: Any, y: Any, memory: list[Any]) -> tuple[list[Any], list[Any]]:
        """The values set for a step from this state, and the memory then."""
        steps = memory[0]
        behind = (self.waiting + 1) * self.sets + (0 if self.later is None else self.sets)
        own = memory[1 : len(memory) - behind]
        queue = memory[1 + len(own) : 1 + len(own) + (self.waiting + 1) * self.sets]
        due = bits.at_most(steps, 0.0)
        made, following = self.control(t, v, y, own)
        own = [bits.where(due, new, old) for new, old in zip(following, own, strict=True)]
        shifted = [*queue[self.sets :], *made]
        queue = [bits.where(due, new, old) for new, old in zip(shifted, queue, strict=True)]
        held = out = queue[: self.sets]
        if self.later is not None:
            now = bits.at_most(steps, self.later) & bits.at_most(self.later, steps)
            out = held = [bits.where(now, new, old) for new, old in zip(held, memory[-self.sets :], strict=True)]
        remembered = [bits.where(bits.at_most(self.last, steps), 0.0, steps + 1.0), *own, *queue]
        return out, [*remembered, *(held if self.later is not None else [])]

    def held(self, memory: list[Any]) -> list[Any]:
        """The values held between two steps."""
        if self.later is not None:
            return memory[-self.sets :]
        first = len(memory) - (self.waiting + 1) * self.sets
        return memory[first : first + self.sets]
