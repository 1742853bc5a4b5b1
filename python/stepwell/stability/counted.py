"""Operations per step (the document's third criterion), counted by running the reference step on counting numbers."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from .._checks import Shape
from ..errors import ShapeError
from ..integrate import fits_together
from ..methods import Method
from ..methods import method as find_method
from ..systems import Oscillator, System
from .numbers import Counting


class Operations(NamedTuple):
    """Operations of one step of one member.

    Attributes:
        additions: additions and subtractions.
        multiplications: products.
        divisions: quotients.
        square_roots: square roots.
        rate_evaluations: evaluations of the rate of v.
        rate_evaluations_y: evaluations of the rate of y, which cost little where ẏ is v times a number.
    """

    additions: int
    multiplications: int
    divisions: int
    square_roots: int
    rate_evaluations: int
    rate_evaluations_y: int


def operations(method: str | Method, system: System | None = None) -> Operations:
    """Count the operations of a step, those of the system's rates included.

    Changes of sign are not counted, since a processor subtracts as fast as it adds. What is computed once for a whole
    run (Φ = ω₀·dt) and what an input takes is not counted either.

    Args:
        method: its name, or what ``stepwell.method`` returns.
        system: what is stepped; the undamped oscillator if None.

    Raises:
        ArgumentError: if the system is a batch.
        UnsupportedError: if the method cannot do the system.
    """
    how = find_method(method)
    system = Oscillator() if system is None else system
    fits_together(system, how)
    if system.batch:
        raise ShapeError(f"system: expected one member to count the operations of, got a batch of shape {system.batch}")
    tally: Counter[str] = Counter()

    def block(shape: Shape) -> Any:
        numbers = np.empty(shape, dtype=object)
        for index in np.ndindex(shape):
            numbers[index] = Counting(tally)
        return numbers

    class Counted:
        """The system, with a note of how often each rate is asked for."""

        def __init__(self, s: Any) -> None:
            self.s = s

        def dv(self, t: float, v: Any, y: Any) -> Any:
            tally["rate_evaluations"] += 1
            return self.s.dv(t, v, y)

        def dy(self, t: float, v: Any, y: Any) -> Any:
            tally["rate_evaluations_y"] += 1
            return self.s.dy(t, v, y)

    s: Any = system.scaled(1.0, ())
    v, y = how.steps.step(Counted(s), 0.0, 1.0, block(system.v_shape), block(system.y_shape))  # type: ignore[arg-type]
    if hasattr(s, "settle"):  # what is set back onto its energy after a step
        s.settle(v, y)
    return Operations(**{name: tally[name] for name in Operations._fields})
