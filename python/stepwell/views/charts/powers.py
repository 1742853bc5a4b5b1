"""Powers against steps: cost and error of n steps of a linear system, one by one or by a power of P (§4)."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from ... import _core
from ...analysis.stability import maps
from ...analysis.stability.expansion import polynomials
from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.literals import RunForm
from ...base.pictures import Drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.compatibility import fits_together, one_state
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import Oscillator, System
from ...model.systems.base import a_system
from ...runs.integration import integrate
from ...runs.result import Run

#: The compared forms, in the order of the legend.
FORMS: tuple[RunForm, ...] = ("direct", "matrix", "power")

#: Numbers of steps, by default.
STEPS = tuple(10**k for k in range(8))

#: The number of repeats of each run, whose median counts.
REPEATS = 5

#: The binary digits after the point of the numbers in which the exact states are computed.
BITS = 320


@dataclass(frozen=True, eq=False)
class Powers(Drawn, Table, ValueEquality):
    """Cost and error of n steps in each form.

    A row for each form and number of steps. ``measured_seconds`` is not repeatable.

    Attributes:
        system: the system.
        method: the method.
        dt: the step, in units of time.
        steps: numbers of steps, shape (n,).
        seconds: measured median of the repeats, by form, each of shape (n,).
        errors: distance from the method's exact state after as many steps, divided by the longest exact state so far, by
            form, each of shape (n,).
        isa: the CPU level of the measurements.
    """

    system: System
    method: Method
    dt: float
    steps: np.ndarray[Any, np.dtype[np.int64]]
    seconds: dict[str, Array]
    errors: dict[str, Array]
    isa: str
    _painter = "draw_powers"

    def summary(self) -> list[dict[str, Any]]:
        """A row for each form: the largest error, and the measured time of the longest run."""
        return [
            {
                "form": form,
                "steps": int(self.steps[-1]),
                "largest_error": float(self.errors[form].max()),
                "measured_seconds": float(self.seconds[form][-1]),
            }
            for form in self.seconds
        ]

    def _head(self) -> dict[str, Any]:
        return {"system": repr(self.system), "method": self.method.name, "dt": self.dt, "isa": self.isa}

    def _columns(self) -> dict[str, list[Any]]:
        return stacked(
            {"form": form, "steps": self.steps, "measured_seconds": seconds, "error": self.errors[form]}
            for form, seconds in self.seconds.items()
        )


def powers(
    method: Method | str = "false_euler",
    *,
    system: System | None = None,
    v: Any = 0.0,
    y: Any = 1.0,
    dt: float = 0.3,
    steps: Iterable[int] = STEPS,
    progress: Callable[[float], object] | None = None,
) -> Powers:
    """Make n steps of a linear system one by one, by its transition matrix, and by a power of it, and compare cost and error.

    The exact states are those of the method, not of the equation: P from the reference step run on exact numbers, its
    powers in integers of 320 bits after the point.

    Args:
        method: its name, or what ``stepwell.method`` returns.
        system: a linear system of one member, whose inputs are omitted; the undamped oscillator if None.
        v: velocity block at the start.
        y: coordinate block at the start.
        dt: the step, in units of time, above zero.
        steps: numbers of steps.
        progress: a function that is called with the fraction that is done.

    Returns:
        A ``Powers``.

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if the system is not linear, or the method cannot step it.

    Example:
        >>> chart = sw.charts.powers("rk4", steps=[10, 100])
        >>> [row["form"] for row in chart.summary()]
        ['direct', 'matrix', 'power']
    """
    chosen = find_method(method)
    system = Oscillator() if system is None else a_system(system)
    fits_together(system, chosen)
    one_state("form", chosen)
    if not system.linear:
        raise UnsupportedError(f"system: only linear systems have powers, and {system!r} is not linear")
    if system.batch:
        raise ShapeError(f"system: expected one member, got a batch of shape {system.batch}")
    system = system.without_inputs()
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    counts = sorted({checks.count("steps", n, 1) for n in checks.several("steps", steps, "numbers of steps")})
    progress = checks.callback("progress", progress)
    if not counts:
        raise ShapeError("steps: expected at least one number of steps, got none")
    start = integrate(system, chosen, v=v, y=y, dt=dt, steps=1, every=1)
    if start.status.ndim:
        raise ShapeError(f"v, y: expected one member, got a batch of shape {start.status.shape}")

    seconds: dict[str, Array] = {form: np.empty(len(counts)) for form in FORMS}
    errors: dict[str, Array] = {form: np.empty(len(counts)) for form in FORMS}
    exact = _Exact(system, chosen, dt, start)
    longest = exact.length(0)
    if not longest > 0.0:
        raise ArgumentError(f"v, y: expected a start of more than 2**-{BITS}, got one that stays at rest")
    for i, n in enumerate(counts):
        longest = max(longest, exact.length(n))
        for form in FORMS:
            times = []
            for _ in range(REPEATS):
                begin = time.perf_counter()
                run = integrate(system, chosen, v=v, y=y, dt=dt, steps=n, form=form, threads=1)
                times.append(time.perf_counter() - begin)
            seconds[form][i] = statistics.median(times)
            errors[form][i] = exact.distance(n, run) / longest
        if progress is not None:
            progress((i + 1) / len(counts))
    return Powers(system, chosen, dt, np.array(counts), seconds, errors, _core.isa())


class _Exact:
    """The method's exact states after n steps, as integers in units of 2^−``BITS``."""

    def __init__(self, system: System, method: Method, dt: float, start: Run) -> None:
        self.n_v, _ = maps.size(system)
        self.carries = method.carry is not None
        step = Fraction(dt)
        self.p = [[_fixed(entry(step)) for entry in row] for row in polynomials(system, method)]
        slot, y = start.v[0], start.y[0]
        if self.carries:  # what the method carries at the start, from the run's end by one step back
            slot = method.steps.start(system.scaled(dt, ()), 0, 0.0, slot, y)
        self.start = [_fixed(Fraction(x)) for x in [*np.ravel(slot).tolist(), *np.ravel(y).tolist()]]
        self.states: dict[int, list[int]] = {}

    def state(self, n: int) -> list[int]:
        """The slots after n steps, by squaring."""
        if n not in self.states:
            s, square, left = self.start, self.p, n
            while left:
                if left & 1:
                    s = [sum(a * b for a, b in zip(row, s, strict=True)) >> BITS for row in square]
                left >>= 1
                if left:
                    columns = list(zip(*square, strict=True))
                    square = [[sum(a * b for a, b in zip(row, c, strict=True)) >> BITS for c in columns] for row in square]
            self.states[n] = s
        return self.states[n]

    def length(self, n: int) -> float:
        """The length of the exact slots, which are coordinates and velocities, or what the method carries in their place."""
        return _length(self.state(n))

    def distance(self, n: int, run: Run) -> float:
        """The distance of a run's end from the exact state."""
        slot = run.v[-1] if run.carry is None else run.carry
        ends = [*np.ravel(slot).tolist(), *np.ravel(run.y[-1]).tolist()]
        return _length([_fixed(Fraction(a)) - b for a, b in zip(ends, self.state(n), strict=True)])


def _fixed(x: Fraction) -> int:
    return (x.numerator << BITS) // x.denominator


def _number(x: int) -> float:
    return float(Fraction(x, 1 << BITS))


def _length(state: list[int]) -> float:
    """The length of a state."""
    try:
        return float(np.sqrt(sum(_number(x) ** 2 for x in state)))
    except OverflowError:
        raise ArgumentError("v, y, dt, steps: expected states whose squares are numbers, got larger ones") from None
