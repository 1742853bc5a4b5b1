"""Operations per step (Hoffmann's third criterion), counted on the tape of the step."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from ... import _core
from ...errors import ShapeError
from ...model.compatibility import fits_together
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import Oscillator, System
from ...model.systems.base import a_system
from ...runs.engine import Plan, evaluations
from ...runs.engine.counted import written


class Operations(NamedTuple):
    """Operations of one step of one member.

    Attributes:
        additions: additions and subtractions.
        multiplications: products.
        divisions: quotients.
        square_roots: square roots.
        rate_evaluations: evaluations of the rate of v; for a series, the number of evaluations that have as many operations.
        rate_evaluations_y: evaluations of the rate of y, which cost little where ẏ is v times a number.
    """

    additions: int
    multiplications: int
    divisions: int
    square_roots: int
    rate_evaluations: int
    rate_evaluations_y: int


def operations(method: str | Method, system: System | None = None) -> Operations:
    """Count the operations of a step, including those of the system's rates.

    Changes of sign are not counted, since a processor subtracts as fast as it adds. Operations that are done once for a whole run
    (Φ = ω₀·dt) are not counted either; those of an input that changes with time are.

    Args:
        method: its name, or what ``stepwell.method`` returns.
        system: the system; the undamped oscillator if None.

    Raises:
        ArgumentError: if the system is a batch.
        UnsupportedError: if the method cannot step the system.

    Example:
        >>> sw.stability.operations("rk4").rate_evaluations
        4
    """
    method = find_method(method)
    system = Oscillator() if system is None else a_system(system)
    fits_together(system, method)
    if system.batch:
        raise ShapeError(f"system: expected one member to count the operations of, got a batch of shape {system.batch}")
    counted = written(Plan(system, method, (), 1.0))
    kinds = Counter(name for name, _, _ in _core.program(method.key)[0])
    of_v, of_y = (
        [evaluations(method, system)] * 2
        if method.has_series
        else [kinds["dv"] + kinds["kick"], kinds["dy"] + kinds["drift of y"]]
    )
    arithmetic = {kind: counted[kind] for kind in Operations._fields[:4]}
    return Operations(**arithmetic, rate_evaluations=of_v, rate_evaluations_y=of_y)
