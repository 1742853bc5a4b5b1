"""Values of a tape for many members at once: by the core, or, for the reference, line by line."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base.arrays import Array
from ...reference.tape.replay import Replay

#: Fewer operations take NumPy less time than to hand all numbers to the core.
FEWEST_BY_CORE = 6


class Evaluated:
    """Values of a tape, as a function of rows of a state and of parameters; both ways compute the same bits.

    Args:
        tape: the tape.
        values: its symbols.
        states: how many numbers of a state they may read.
        by_core: whether the core computes them.
    """

    def __init__(self, tape: _core.Tape, values: list[Any], states: int, *, by_core: bool) -> None:
        self._tape, self._values, self._states, self.operations = tape, values, states, len(tape)
        self._core = self.evaluation if by_core and self.operations >= FEWEST_BY_CORE + states else None

    @cached_property
    def evaluation(self) -> _core.Evaluation | None:
        """How the core computes them; None if they depend on sampled inputs."""
        return self._tape.evaluation(self._values, self._states)

    @cached_property
    def _replay(self) -> Replay:
        return Replay(*self._tape.operations(self._values))

    def __call__(self, state: Sequence[Any], numbers: Sequence[Any]) -> list[Array]:
        """The values for these rows, which broadcast."""
        if self._core is None:
            with np.errstate(all="ignore"):
                return self._replay(state, numbers)
        shapes = {each.shape if isinstance(each, np.ndarray) else () for each in (*state, *numbers)}
        shape = shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes)
        members = prod(shape)
        rows = self._core(members, [_row(each, shape) for each in state], [_row(each, shape) for each in numbers])
        return [row.reshape(shape) for row in rows]


def _row(numbers: Any, shape: tuple[int, ...]) -> Any:
    """A row as the core takes it: one number for all members, or one for each."""
    if not isinstance(numbers, np.ndarray) or numbers.size == 1:
        return float(numbers) if not isinstance(numbers, np.ndarray) else numbers.item()
    wide = numbers if numbers.shape == shape else np.broadcast_to(numbers, shape)
    return np.ascontiguousarray(wide, dtype=np.float64).reshape(-1)
